//! From frames to circle centres with covariance.
#![no_std]
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate std;

mod bits;
mod candidate;
mod centre;
mod components;
mod consensus;
mod lanes;
mod loader;
mod model;
mod patch;
mod refusal;
mod search;
mod settings;
#[cfg(test)]
mod synthetic;
mod threshold;
mod tracker;

pub use refusal::Refusal;
pub use search::{Ring, Search};
pub use settings::Settings;
pub use tracker::Tracker;

/// Largest side of a search window, px.
pub const MAX_SIDE: usize = 192;
