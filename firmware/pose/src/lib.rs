//! From circle centres to the pose of a carbody, with covariance.
#![no_std]
#![forbid(unsafe_code)]
