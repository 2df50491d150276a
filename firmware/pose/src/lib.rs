//! From circle centres to the pose of a carbody, with covariance.
#![no_std]
#![forbid(unsafe_code)]

mod geometry;
mod lens;
mod settings;

pub use geometry::{Centre, Circle, Pose};
pub use lens::{Lens, LensError};
pub use settings::{Method, Settings};

/// Most circles that one setup may have, over all its targets.
pub const MAX_CIRCLES: usize = 64;
mod first;
pub use first::*;
