//! A line to the host: bytes out, bytes in, never waiting.

/// What kind of trouble a link reports.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LinkErrorKind {
    /// Nobody is connected at the moment; the link goes on trying by itself.
    NotConnected,
    /// The place the bytes go to is full (a disk).
    Full,
    /// Anything else; the link goes on trying by itself.
    Other,
}

/// An error that says what kind it is.
pub trait LinkError {
    /// The kind of this error.
    fn kind(&self) -> LinkErrorKind;
}

/// A line to the host.
pub trait Link {
    /// The board's own error.
    type Error: LinkError;

    /// Hands over as many of `bytes` as the line takes now and says how many; 0 when it is busy.
    ///
    /// `bytes` starts and ends with whole framed records. A link that loses its connection within a record
    /// drops the rest of that record.
    ///
    /// # Errors
    /// [`LinkErrorKind::NotConnected`] while nobody listens, and for good where the line failed.
    fn send(&mut self, bytes: &[u8]) -> Result<usize, Self::Error>;

    /// Takes what the host has sent, at most `into.len()` bytes; 0 when there is nothing.
    ///
    /// # Errors
    /// As [`Link::send`].
    fn receive(&mut self, into: &mut [u8]) -> Result<usize, Self::Error>;

    /// Pushes out what the link still holds, at the end of a session; `true` when all of it is on the line.
    /// To be called until it is true. Nothing can be sent afterwards.
    ///
    /// # Errors
    /// What is left cannot be brought out any more.
    fn finish(&mut self) -> Result<bool, Self::Error> {
        Ok(true)
    }

    /// Connections made so far. A change means that somebody new listens, who needs `Hello` and what follows
    /// it. A line that knows no connections stays at 0.
    fn connections(&self) -> u32;
}
