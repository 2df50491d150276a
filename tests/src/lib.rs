//! What the whole-flow tests share: a short simulated ride, a board that plays it, and the programs.

mod board;
pub mod drawing;
pub mod guest;
mod judge;
pub mod keeping;
mod programs;
mod scenes;

pub use board::{Ended, Loop, Ride, engine, try_engine};
pub use judge::{sigmas_off, used_rings};
pub use programs::{bench, emulated_bench, gangway, sentence};
pub use scenes::Keeping;
