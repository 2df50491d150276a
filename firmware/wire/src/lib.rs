//! Records, framing and version of what the box sends and takes.
#![no_std]
#![forbid(unsafe_code)]
