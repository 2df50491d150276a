//! Where frames come from.

use crate::Frame;

/// What kind of trouble a camera reports; generic code decides by this, not by the board's own type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CameraErrorKind {
    /// A recording is over; there will be no more frames.
    Ended,
    /// No frame came in the time that three periods take.
    Stalled,
    /// The device is gone or failing; the board is trying to open it again.
    Lost,
    /// The device was opened again; frames follow.
    Reopened,
    /// A frame came but is unusable: short, torn or of another size.
    Corrupt,
    /// Still no frame, and nothing new to tell: what happened was said before.
    Waiting,
}

/// An error that says what kind it is.
pub trait CameraError {
    /// The kind of this error.
    fn kind(&self) -> CameraErrorKind;
}

impl CameraError for CameraErrorKind {
    fn kind(&self) -> CameraErrorKind {
        *self
    }
}

/// How long a camera exposes each row, and how much it amplifies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exposure {
    /// Time, s.
    pub time_s: f64,
    /// Factor over no amplification, 1 or more.
    pub gain: f64,
}

/// A source of frames.
pub trait Camera {
    /// The board's own error.
    type Error: CameraError;

    /// Waits for the next frame, at most three frame periods.
    ///
    /// The frame borrows the camera's buffer, which is given back when the borrow ends.
    ///
    /// # Errors
    /// Why there is none now; what that means for the next call says [`CameraErrorKind`].
    fn next_frame(&mut self) -> Result<Frame<'_>, Self::Error>;

    /// Tells the camera another exposure, for frames that come some frames later. Gives what it took, to its
    /// own steps and bounds; `None` where it cannot be told, as a recording.
    fn set_exposure(&mut self, wanted: Exposure) -> Option<Exposure> {
        let _ = wanted;
        None
    }
}
