//! Lights a lamp on a line of a GPIO chip until standard input ends or gives a line: `lamp /dev/gpiochip0
//! 17`.

use std::path::Path;

use embedded_hal::digital::OutputPin as _;
use gangway_linux::GpioLamp;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [chip, line] = args.as_slice() else { return Err("usage: lamp CHIP LINE".into()) };
    let mut lamp = GpioLamp::open(Path::new(chip), line.parse()?)?;
    lamp.set_high().map_err(|_| "the line cannot be switched")?;
    println!("lamp: lit");
    std::io::stdin().read_line(&mut String::new())?;
    Ok(())
}
