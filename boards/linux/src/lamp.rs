//! A lamp on the GPIO character device (linux/gpio.h, version 2), for boards without pins of their own crate.

use std::path::Path;

use embedded_hal::digital::{Error, ErrorKind, ErrorType, OutputPin};
use gpiocdev::Request;
use gpiocdev::line::Value;

/// A line of a GPIO chip as an output; dark when it is made and when it is dropped.
#[derive(Debug)]
pub struct GpioLamp {
    line: Request,
    offset: u32,
}

/// What can go wrong with a line.
#[derive(Debug, thiserror::Error)]
#[error(
    "line {offset} of {chip} cannot be used as a lamp: {why}; is it the right chip, and is the line free?"
)]
pub struct LampError {
    chip: String,
    offset: u32,
    why: String,
}

/// The kernel refused to switch a line.
#[derive(Debug)]
pub struct NotSwitched;

impl Error for NotSwitched {
    fn kind(&self) -> ErrorKind {
        ErrorKind::Other
    }
}

impl GpioLamp {
    /// Takes a line of a chip such as /dev/gpiochip0, dark.
    ///
    /// # Errors
    /// There is no such chip or line, or somebody else has it.
    pub fn open(chip: &Path, offset: u32) -> Result<Self, LampError> {
        let line = Request::builder()
            .on_chip(chip)
            .with_consumer("gangway")
            .with_line(offset)
            .as_output(Value::Inactive)
            .request();
        line.map(|line| Self { line, offset }).map_err(|error| LampError {
            chip: chip.display().to_string(),
            offset,
            why: error.to_string(),
        })
    }

    fn set(&mut self, value: Value) -> Result<(), NotSwitched> {
        self.line.set_value(self.offset, value).map(|_| ()).map_err(|_| NotSwitched)
    }
}

impl ErrorType for GpioLamp {
    type Error = NotSwitched;
}

impl OutputPin for GpioLamp {
    fn set_low(&mut self) -> Result<(), NotSwitched> {
        self.set(Value::Inactive)
    }

    fn set_high(&mut self) -> Result<(), NotSwitched> {
        self.set(Value::Active)
    }
}

impl Drop for GpioLamp {
    fn drop(&mut self) {
        // The kernel keeps a line as it was left.
        let _ = self.set(Value::Inactive);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_chip_that_is_not_there_is_one_sentence() {
        let said = GpioLamp::open(Path::new("/dev/no-such-chip"), 4).unwrap_err().to_string();
        assert!(said.starts_with("line 4 of /dev/no-such-chip cannot be used as a lamp: "), "{said}");
        assert!(!said.contains('\n'), "{said}");
    }
}
