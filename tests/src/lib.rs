//! What the whole-flow tests share: a short simulated ride, a board that plays it, and the programs.

mod board;
pub mod guest;
mod programs;

pub use board::{Ended, Loop, Ride};
pub use programs::{bench, emulated_bench, gangway, sentence};
