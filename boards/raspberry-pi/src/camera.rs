//! The camera that the setup names: a V4L2 device, or one of libcamera where that is built in.

use std::time::Duration;

use gangway_device::Exposure;
use gangway_engine::Settings;
use gangway_linux::Notices;
use gangway_linux::camera::{OpenError, Shape, Source, Stamp, Stream, StreamError, V4l2, V4l2Stream};
use gangway_setup::Parts;

#[cfg(feature = "libcamera")]
use crate::libcamera::{Libcamera, LibcameraStream};

/// What a camera of libcamera begins with in the setup.
const LIBCAMERA: &str = "libcamera:";

/// Either kind of camera.
pub(crate) enum Device {
    V4l2(V4l2),
    #[cfg(feature = "libcamera")]
    Libcamera(Libcamera),
}

impl Device {
    /// The camera of this setup; remarks go to `notices`.
    pub(crate) fn new(parts: &Parts, settings: &Settings, notices: &Notices) -> anyhow::Result<Self> {
        let (capture, camera) = (parts.capture.clone(), parts.camera);
        let (size, rate_hz, notices) = (settings.picture, settings.rate_hz, notices.clone());
        match capture.device.strip_prefix(LIBCAMERA) {
            None => Ok(Self::V4l2(V4l2::new(capture, camera, size, rate_hz, notices))),
            #[cfg(feature = "libcamera")]
            Some(name) => {
                let name = name.to_owned();
                Ok(Self::Libcamera(Libcamera { name, capture, camera, size, rate_hz, notices }))
            }
            #[cfg(not(feature = "libcamera"))]
            Some(_) => anyhow::bail!(
                "capture.device is {}, but this program is without libcamera; build it with --features libcamera",
                capture.device
            ),
        }
    }
}

impl Source for Device {
    type Stream = Delivering;

    fn open(&mut self) -> Result<Delivering, OpenError> {
        match self {
            Self::V4l2(device) => device.open().map(Delivering::V4l2),
            #[cfg(feature = "libcamera")]
            Self::Libcamera(device) => device.open().map(Delivering::Libcamera),
        }
    }
}

/// Either kind of camera while it delivers.
pub(crate) enum Delivering {
    V4l2(V4l2Stream),
    #[cfg(feature = "libcamera")]
    Libcamera(LibcameraStream),
}

impl Delivering {
    /// Size, format and exposure as the camera has taken them, for a person.
    pub(crate) fn describe(&self) -> String {
        match self {
            Self::V4l2(stream) => stream.describe(),
            #[cfg(feature = "libcamera")]
            Self::Libcamera(stream) => stream.describe(),
        }
    }

    /// Controls as the camera has taken them, for a person.
    pub(crate) fn describe_controls(&self) -> String {
        match self {
            Self::V4l2(stream) => stream.describe_controls(),
            #[cfg(feature = "libcamera")]
            Self::Libcamera(stream) => stream.describe_controls(),
        }
    }
}

impl Stream for Delivering {
    fn wait(&mut self, patience: Duration) -> Result<Stamp, StreamError> {
        match self {
            Self::V4l2(stream) => stream.wait(patience),
            #[cfg(feature = "libcamera")]
            Self::Libcamera(stream) => stream.wait(patience),
        }
    }

    fn picture(&self) -> &[u8] {
        match self {
            Self::V4l2(stream) => stream.picture(),
            #[cfg(feature = "libcamera")]
            Self::Libcamera(stream) => stream.picture(),
        }
    }

    fn set_exposure(&mut self, wanted: Exposure) -> Option<Exposure> {
        match self {
            Self::V4l2(stream) => stream.set_exposure(wanted),
            #[cfg(feature = "libcamera")]
            Self::Libcamera(stream) => stream.set_exposure(wanted),
        }
    }

    fn shape(&self) -> Shape {
        match self {
            Self::V4l2(stream) => stream.shape(),
            #[cfg(feature = "libcamera")]
            Self::Libcamera(stream) => stream.shape(),
        }
    }
}
