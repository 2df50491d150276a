//! What a camera device has to be able to do, so that recovery is one for all kinds of devices.

use std::time::Duration;

use gangway_device::{Exposure, Layout};

use super::Stamp;

/// A device that can be opened again and again.
pub trait Source {
    /// What it is while it delivers.
    type Stream: Stream;

    /// Opens the device, sets it up and checks what it made of that.
    ///
    /// # Errors
    /// One sentence that says what is wrong with which device.
    fn open(&mut self) -> Result<Self::Stream, OpenError>;
}

/// A device that delivers pictures.
pub trait Stream {
    /// Gives the last picture back and waits for the next one, at most `patience`.
    ///
    /// # Errors
    /// The stream cannot be used any more: it has to be dropped and opened again.
    fn wait(&mut self, patience: Duration) -> Result<Stamp, StreamError>;

    /// The bytes of the picture that was waited for last.
    fn picture(&self) -> &[u8];

    /// Size and layout of every picture.
    fn shape(&self) -> Shape;

    /// Tells the device another exposure; gives what it took, `None` where it takes none.
    fn set_exposure(&mut self, wanted: Exposure) -> Option<Exposure> {
        let _ = wanted;
        None
    }
}

/// How pictures lie in their bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shape {
    /// Width and height, samples.
    pub size: (u16, u16),
    /// From the start of one row to the next, bytes.
    pub stride: usize,
    /// How samples lie in a row.
    pub layout: Layout,
}

/// Why a stream is over.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum StreamError {
    /// No picture came in time.
    #[error("no picture came in time")]
    Stalled,
    /// The device is gone or failing, with what the system said.
    #[error("the camera is lost: {0}")]
    Lost(String),
}

/// Whether it is worth trying again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OpenErrorKind {
    /// The device is not there, or not ready: it may come.
    Absent,
    /// The device is there, but cannot do what the setup asks.
    Unfit,
}

/// Why a device cannot be opened, in one sentence.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{sentence}")]
pub struct OpenError {
    /// Whether it is worth trying again.
    pub kind: OpenErrorKind,
    /// What is wrong with which device, and what to do.
    pub sentence: String,
}

impl OpenError {
    /// It may come.
    pub fn absent(sentence: String) -> Self {
        Self { kind: OpenErrorKind::Absent, sentence }
    }

    /// It cannot do what the setup asks.
    pub fn unfit(sentence: String) -> Self {
        Self { kind: OpenErrorKind::Unfit, sentence }
    }
}
