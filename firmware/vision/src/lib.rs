//! From frames to circle centres with covariance.
#![no_std]
#![forbid(unsafe_code)]
#![allow(
    clippy::needless_range_loop,
    reason = "loops over the columns of a block read best with the index of the pixel"
)]

#[cfg(any(test, feature = "avx2"))]
extern crate std;

mod acquire;
mod bits;
mod candidate;
mod centre;
mod chords;
mod components;
mod consensus;
mod dark;
mod edge;
mod lanes;
mod light;
mod loader;
mod model;
mod patch;
mod profile;
mod refusal;
mod search;
mod settings;
#[cfg(test)]
mod synthetic;
mod threshold;
mod tracker;
mod window;

pub use acquire::{Acquisition, MAX_SIGHTINGS, Part};
pub use light::Illumination;
pub use loader::level;
pub use refusal::Refusal;
pub use search::{Ring, Search};
pub use settings::Settings;
pub use tracker::Tracker;

/// Largest side of a search window, px.
pub const MAX_SIDE: usize = 192;

/// Length of a step, px: of what can be in a picture no square is too large.
fn length(x: f64, y: f64) -> f64 {
    libm::sqrt(x * x + y * y)
}
