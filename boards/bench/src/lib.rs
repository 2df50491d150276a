//! The firmware on recorded frames.

pub mod source;
