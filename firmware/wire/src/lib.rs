//! Records, framing and version: everything that box and host share.
#![no_std]
#![forbid(unsafe_code)]

mod record;

pub use record::*;

/// Longest framed record, bytes, delimiter included.
pub const MAX_FRAME: usize = 640;
