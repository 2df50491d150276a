//! The firmware on recorded frames.
