// SPDX-License-Identifier: MIT OR Apache-2.0
/*
 * Input pins that a test pulls, as a kernel module: Debian's kernel has no gpio-sim, and QEMU raises no interrupts for the
 * pins of a Raspberry Pi. Its chip has the name of the board's own.
 *
 *     echo "23 1" >/sys/module/pulled/parameters/pull    pulls pin 23 up, and raises its interrupt when that is an edge
 *     cat /sys/module/pulled/parameters/pull             the last pull: pin, level, monotonic time before and after it, ns
 */
#include <linux/bitops.h>
#include <linux/gpio/driver.h>
#include <linux/interrupt.h>
#include <linux/irq.h>
#include <linux/irqdomain.h>
#include <linux/ktime.h>
#include <linux/module.h>

/* As many as a Raspberry Pi 3 has. */
#define PINS 54

static DECLARE_BITMAP(levels, PINS);
static unsigned int pulled_pin, pulled_level;
static u64 before_ns, after_ns;

static int pin_level(struct gpio_chip *chip, unsigned int pin)
{
	return test_bit(pin, levels);
}

static int pin_direction(struct gpio_chip *chip, unsigned int pin)
{
	return GPIO_LINE_DIRECTION_IN;
}

static int pin_input(struct gpio_chip *chip, unsigned int pin)
{
	return 0;
}

/* There is no line that could be masked. */
static void nothing(struct irq_data *data)
{
}

static int any_edge(struct irq_data *data, unsigned int type)
{
	return 0;
}

static const struct irq_chip edges = {
	.name = "pulled",
	.irq_mask = nothing,
	.irq_unmask = nothing,
	.irq_set_type = any_edge,
	.flags = IRQCHIP_IMMUTABLE,
	GPIOCHIP_IRQ_RESOURCE_HELPERS,
};

static struct gpio_chip chip = {
	.label = "pinctrl-bcm2835",
	.owner = THIS_MODULE,
	.base = -1,
	.ngpio = PINS,
	.get = pin_level,
	.get_direction = pin_direction,
	.direction_input = pin_input,
};

static int pull_set(const char *text, const struct kernel_param *parameter)
{
	unsigned int pin, level;

	if (sscanf(text, "%u %u", &pin, &level) != 2 || pin >= PINS || level > 1)
		return -EINVAL;
	pulled_pin = pin;
	pulled_level = level;
	before_ns = ktime_get_ns();
	if (test_bit(pin, levels) != level) {
		assign_bit(pin, levels, level);
		generic_handle_irq_safe(irq_find_mapping(chip.irq.domain, pin));
	}
	after_ns = ktime_get_ns();
	return 0;
}

static int pull_get(char *text, const struct kernel_param *parameter)
{
	return sprintf(text, "%u %u %llu %llu\n", pulled_pin, pulled_level, before_ns, after_ns);
}

static const struct kernel_param_ops pull_ops = { .set = pull_set, .get = pull_get };
module_param_cb(pull, &pull_ops, NULL, 0600);

static int __init pulled_init(void)
{
	gpio_irq_chip_set_chip(&chip.irq, &edges);
	chip.irq.handler = handle_simple_irq;
	chip.irq.default_type = IRQ_TYPE_NONE;
	return gpiochip_add_data(&chip, NULL);
}

static void __exit pulled_exit(void)
{
	gpiochip_remove(&chip);
}

module_init(pulled_init);
module_exit(pulled_exit);
MODULE_DESCRIPTION("Input pins that a test pulls");
MODULE_LICENSE("Dual MIT/GPL");
