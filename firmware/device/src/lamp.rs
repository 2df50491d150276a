//! A lamp that lights an active target.

use embedded_hal::digital::OutputPin;

/// A lamp is any `embedded-hal` output pin, lit when the pin is high.
pub trait Lamp {
    /// The pin's own error.
    type Error: embedded_hal::digital::Error;

    /// Lights the lamp or puts it out.
    ///
    /// # Errors
    /// The pin cannot be driven; whether the lamp shines is then not known.
    fn set_lit(&mut self, lit: bool) -> Result<(), Self::Error>;
}

impl<P: OutputPin> Lamp for P {
    type Error = P::Error;

    fn set_lit(&mut self, lit: bool) -> Result<(), Self::Error> {
        self.set_state(lit.into())
    }
}
