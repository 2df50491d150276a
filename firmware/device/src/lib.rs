//! Contracts across the hardware line.
//!
//! A board implements these traits; the firmware knows nothing else of it. Each seam is one trait wide,
//! so that a recording, a fault injector or a fake stands beside the real device as just another board:
//!
//! | seam | who implements it | who calls it |
//! |---|---|---|
//! | [`Camera`] | board | engine, once a frame |
//! | [`Lamp`] | any `embedded-hal` output pin | engine |
//! | [`Clock`] | board | engine |
//! | [`Vitals`] | board | engine, once a second |
//! | [`Link`] | board | the board's own link thread, never the frame loop |
#![no_std]
#![forbid(unsafe_code)]

mod camera;
mod clock;
mod frame;
mod lamp;
mod link;

pub use camera::{Camera, CameraError, CameraErrorKind, Exposure};
pub use clock::{Clock, Reading, Vitals};
pub use frame::{Frame, FrameError, Layout};
pub use lamp::Lamp;
pub use link::{Link, LinkError, LinkErrorKind};
