//! The pins of a Raspberry Pi: lamps of lit targets, a status lamp, a push button, a sync input.

use std::fmt::Write as _;
use std::time::{Duration, Instant};

use anyhow::Context as _;
use gangway_engine::{Command, MAX_MARK};
use gangway_linux::{Notices, State};
use gangway_setup::Board;
use rppal::gpio::{Event, Gpio, InputPin, OutputPin, Pin, Trigger};

/// Pressed for longer, the button marks the start or the end of a run instead of setting the rest pose.
const LONG: Duration = Duration::from_millis(1_500);
/// Edges of the sync input that follow one another within this time are of one switch that bounces.
const BOUNCE: Duration = Duration::from_micros(100);
/// Half a period of the status lamp while the box waits and while it has no camera.
const SLOW: Duration = Duration::from_millis(500);
const FAST: Duration = Duration::from_millis(100);

/// The pins that the setup names.
pub(crate) struct Pins {
    lamps: Vec<OutputPin>,
    status: Option<OutputPin>,
    button: Option<Button>,
    /// Kept: its edges are told as long as it lives.
    _sync: Option<InputPin>,
    notices: Notices,
    begun: Instant,
}

impl Pins {
    /// Takes the pins; every lamp is dark from here on.
    pub(crate) fn take(board: &Board, notices: Notices) -> anyhow::Result<Self> {
        let named = [board.status_pin, board.button_pin, board.sync_pin];
        let is_needed = !board.lamp_pins.is_empty() || named.iter().any(|pin| *pin > 0);
        let gpio = is_needed.then(Gpio::new).transpose().context(
            "the pins cannot be used; is this a Raspberry Pi, and is the user in the group 'gpio'?",
        )?;
        let take = |pin: u8| -> anyhow::Result<Option<Pin>> {
            let Some(gpio) = gpio.as_ref().filter(|_| pin > 0) else { return Ok(None) };
            gpio.get(pin).map(Some).with_context(|| format!("pin {pin} cannot be used; name every pin once"))
        };
        let mut lamps = Vec::new();
        for pin in &board.lamp_pins {
            lamps.extend(take(*pin)?.map(dark));
        }
        let status = take(board.status_pin)?.map(dark);
        let button = take(board.button_pin)?.map(|pin| Button::new(pin.into_input_pullup()));
        let mut sync = take(board.sync_pin)?.map(Pin::into_input_pulldown);
        if let Some(pin) = &mut sync {
            let (notices, mut bounces) = (notices.clone(), Bounces::default());
            // The kernel's own debouncing would give the time at which its timer ran out, milliseconds late.
            pin.set_async_interrupt(Trigger::Both, None, move |edge| {
                if bounces.is_first(edge.timestamp) {
                    notices.command(Command::Mark(edge_mark(&edge)));
                }
            })
            .with_context(|| format!("pin {} gives no edges", board.sync_pin))?;
        }
        Ok(Self { lamps, status, button, _sync: sync, notices, begun: Instant::now() })
    }

    /// The lamps of lit targets, for the frame loop.
    pub(crate) fn lamps(&mut self) -> Vec<OutputPin> {
        std::mem::take(&mut self.lamps)
    }

    /// Looks at the button and moves the status lamp on; to be called every 50 ms or so.
    pub(crate) fn turn(&mut self, state: State) {
        if let Some(lamp) = &mut self.status {
            lamp.write(is_lit(state, self.begun.elapsed()).into());
        }
        let Some(button) = &mut self.button else { return };
        let is_down = button.pin.is_low();
        match button.press.turn(is_down, Instant::now()) {
            Some(Press::Short) => self.notices.command(Command::SetRest),
            Some(Press::Long { starts: true }) => self.notices.mark("start"),
            Some(Press::Long { starts: false }) => self.notices.mark("end"),
            None => {}
        }
    }
}

impl Drop for Pins {
    fn drop(&mut self) {
        for lamp in self.lamps.iter_mut().chain(&mut self.status) {
            lamp.set_low();
        }
    }
}

/// A lamp that is dark now and stays as it was left when the program ends.
fn dark(pin: Pin) -> OutputPin {
    let mut pin = pin.into_output_low();
    pin.set_reset_on_drop(false);
    pin
}

/// Tells the first edge of a switch from those of its bouncing.
#[derive(Debug, Default)]
struct Bounces {
    last: Option<Duration>,
}

impl Bounces {
    /// Whether the pin was quiet before the edge at this time of the kernel.
    fn is_first(&mut self, time: Duration) -> bool {
        let last = self.last.replace(time);
        last.is_none_or(|last| time.saturating_sub(last) >= BOUNCE)
    }
}

/// The mark of an edge of the sync input, with the kernel's time of it: CLOCK_MONOTONIC (linux/gpio.h,
/// version 2), ns.
fn edge_mark(edge: &Event) -> heapless::String<MAX_MARK> {
    let way = if edge.trigger == Trigger::RisingEdge { "rise" } else { "fall" };
    let mut text = heapless::String::new();
    // 10 letters and at most 20 digits: they always fit.
    let _ = write!(text, "sync {way} {}", edge.timestamp.as_nanos());
    text
}

/// The blink code: slowly while the box waits, steadily while it measures, fast while it has no camera.
fn is_lit(state: State, since: Duration) -> bool {
    let half = match state {
        State::Measuring => return true,
        State::Waiting => SLOW,
        State::Fault => FAST,
    };
    (since.as_millis() / half.as_millis()).is_multiple_of(2)
}

struct Button {
    pin: InputPin,
    press: Presses,
}

impl Button {
    fn new(pin: InputPin) -> Self {
        Self { pin, press: Presses::default() }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Press {
    Short,
    Long { starts: bool },
}

/// From the button's position to presses, told when it is let go.
#[derive(Debug, Default)]
struct Presses {
    down: Option<Instant>,
    is_running: bool,
}

impl Presses {
    fn turn(&mut self, is_down: bool, now: Instant) -> Option<Press> {
        if is_down {
            self.down.get_or_insert(now);
            return None;
        }
        let held = now - self.down.take()?;
        if held < LONG {
            return Some(Press::Short);
        }
        self.is_running = !self.is_running;
        Some(Press::Long { starts: self.is_running })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_short_press_sets_the_rest_pose_and_long_ones_mark_start_and_end() {
        let (mut presses, start) = (Presses::default(), Instant::now());
        let at = |ms: u64| start + Duration::from_millis(ms);
        let mut press = |from: u64, to: u64| {
            assert_eq!(presses.turn(true, at(from)), None);
            assert_eq!(presses.turn(true, at((from + to) / 2)), None);
            let press = presses.turn(false, at(to));
            assert_eq!(presses.turn(false, at(to + 50)), None, "told once");
            press
        };
        assert_eq!(press(0, 300), Some(Press::Short));
        assert_eq!(press(1_000, 2_500), Some(Press::Long { starts: true }));
        assert_eq!(press(5_000, 5_100), Some(Press::Short));
        assert_eq!(press(6_000, 9_000), Some(Press::Long { starts: false }));
    }

    #[test]
    fn the_status_lamp_tells_three_states_apart() {
        let changes = |state: State| {
            let lit: Vec<bool> = (0..40).map(|i| is_lit(state, Duration::from_millis(50 * i))).collect();
            lit.windows(2).filter(|pair| pair[0] != pair[1]).count()
        };
        // Two seconds, in turns of 50 ms.
        let counted = [State::Measuring, State::Waiting, State::Fault].map(changes);
        assert_eq!(counted, [0, 3, 19]);
    }

    #[test]
    fn of_a_switch_that_bounces_the_first_edge_counts() {
        let mut bounces = Bounces::default();
        let mut first = |us: u64| bounces.is_first(Duration::from_micros(us));
        // Closes at 1000 us and bounces for longer than the limit, in shorter steps; opens at 2000 us.
        let told = [1_000, 1_030, 1_090, 1_180, 2_000, 2_099].map(&mut first);
        assert_eq!(told, [true, false, false, false, true, false]);
    }

    #[test]
    fn an_edge_is_marked_with_its_way_and_its_time() {
        let edge = |trigger, timestamp| edge_mark(&Event { timestamp, seqno: 1, trigger });
        let time = Duration::new(12, 345);
        assert_eq!(edge(Trigger::RisingEdge, time).as_str(), "sync rise 12000000345");
        // As long as the kernel can count.
        let longest = Duration::from_nanos(u64::MAX);
        assert_eq!(edge(Trigger::FallingEdge, longest).as_str(), "sync fall 18446744073709551615");
    }
}
