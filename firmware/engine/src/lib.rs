//! The frame loop: one step a frame.
#![no_std]
#![forbid(unsafe_code)]
