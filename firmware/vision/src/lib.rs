//! Frames to circle centres with covariance.
#![no_std]
#![forbid(unsafe_code)]
