//! A camera device behind the `Camera` contract: opened, watched, and opened again when it fails.
//!
//! ```text
//! Source (V4l2, a fake in tests) -> Stream -> Recovering -> Frame
//!  find, format, controls          wait       number, time, stall, loss, backoff
//! ```

mod controls;
mod find;
mod format;
mod numbering;
mod recovering;
mod source;
mod stamp;
mod v4l2;

pub use format::PixelFormat;
pub use recovering::Recovering;
pub use source::{OpenError, OpenErrorKind, Shape, Source, Stream, StreamError};
pub use stamp::{Shutter, Stamp, TimeSource, sensor_time};
pub use v4l2::{V4l2, V4l2Stream};
