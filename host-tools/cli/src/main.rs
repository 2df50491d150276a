//! The one program a test engineer meets.
fn main() {}
