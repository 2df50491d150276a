//! From circle centres to the pose of a carbody, with covariance.
//!
//! [`solve`] is the front door: observations in, [`Solution`] out. Inside, from first pose to motion: `lens`
//! (pixel to ray), `linear` with `homography`, `dlt` and `epnp` (first pose), `refine` (Levenberg-Marquardt),
//! `robust` and `search` with `p3p` (what does not fit), `ambiguity` with `history` (second pose of a plane),
//! `shutter`, `exposure` and `track` (motion while a frame is exposed), `relative` (one carbody against the
//! other), `rest` and `motion` (against the rest pose). Nothing here panics on any input, allocates, or depends
//! on the machine: the same input gives the same bits everywhere.
#![no_std]
#![forbid(unsafe_code)]
#![allow(
    clippy::needless_range_loop,
    reason = "sums over a matrix read best with the indices of the formula"
)]

#[cfg(test)]
extern crate std;

mod ambiguity;
mod assign;
mod circle;
mod dlt;
mod doubt;
mod eigen;
mod epnp;
mod error;
mod exposure;
mod geometry;
mod history;
mod homography;
mod lens;
mod linear;
mod motion;
mod normal;
mod number;
mod p3p;
mod problem;
mod refine;
mod relative;
mod rest;
mod robust;
mod scatter;
mod search;
mod settings;
mod shutter;
mod sighting;
mod solve;
mod track;
mod valley;
mod variance;

pub use ambiguity::{Alternative, DECISIVE};
pub use assign::{Assigned, Assigner, Progress, Unassigned, View};
pub use circle::{Projected, project_circle};
pub use error::PoseError;
pub use exposure::at_mid_exposure;
pub use geometry::{Centre, Circle, Observation, Pose};
pub use history::{PlaneHistory, untangle};
pub use lens::{Lens, LensError};
pub use motion::{Motion, RestPose, angles, moved, relative_motion, rotation};
pub use relative::relative_pose;
pub use rest::{MAX_REST_POSES, rest_mean};
pub use settings::{Method, Settings};
pub use shutter::{Shutter, solve_in_motion};
pub use sighting::Sighting;
pub use solve::{Solution, solve};
pub use track::Track;
pub use variance::VarianceComponent;

/// Most circles that one setup may have, over all its targets.
pub const MAX_CIRCLES: usize = 64;
