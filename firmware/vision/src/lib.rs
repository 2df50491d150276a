//! From frames to circle centres with covariance.
#![no_std]
#![forbid(unsafe_code)]

mod refusal;
mod search;
mod settings;
mod tracker;

pub use refusal::Refusal;
pub use search::{Ring, Search};
pub use settings::Settings;
pub use tracker::Tracker;

/// Largest side of a search window, px.
pub const MAX_SIDE: usize = 192;
