//! The firmware on recorded frames.
fn main() {}
