//! Cameras of libcamera: the device itself is built with the feature `libcamera`; what needs no libcamera is
//! also tested without it.

mod controls;
#[cfg(feature = "libcamera")]
mod device;
mod samples;

#[cfg(feature = "libcamera")]
pub(crate) use device::{Libcamera, LibcameraStream};
