//! From frames to circle centres with covariance.
#![no_std]
#![forbid(unsafe_code)]

mod refusal;
mod settings;

pub use refusal::Refusal;
pub use settings::Settings;

/// Largest side of a search window, px.
pub const MAX_SIDE: usize = 192;
