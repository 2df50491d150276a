//! Lamps that are not there: they remember what was asked of them.

use std::convert::Infallible;

use embedded_hal::digital::{ErrorType, OutputPin};

/// A pin without a lamp.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FakeLamp {
    is_lit: bool,
    changes: u64,
}

impl FakeLamp {
    /// Whether it would shine now.
    pub fn is_lit(&self) -> bool {
        self.is_lit
    }

    /// How often it went on or off.
    pub fn changes(&self) -> u64 {
        self.changes
    }

    fn set(&mut self, is_lit: bool) {
        self.changes += u64::from(self.is_lit != is_lit);
        self.is_lit = is_lit;
    }
}

impl ErrorType for FakeLamp {
    type Error = Infallible;
}

impl OutputPin for FakeLamp {
    fn set_low(&mut self) -> Result<(), Infallible> {
        self.set(false);
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        self.set(true);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use gangway_device::Lamp;

    use super::*;

    #[test]
    fn a_lamp_remembers_what_was_asked_of_it() {
        let mut lamp = FakeLamp::default();
        for lit in [true, true, false, true] {
            lamp.set_lit(lit).unwrap();
        }
        assert!(lamp.is_lit());
        assert_eq!(lamp.changes(), 3);
    }
}
