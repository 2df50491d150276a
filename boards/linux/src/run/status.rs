//! The box's state, for whoever shows it.

use std::sync::atomic::{AtomicU8, Ordering};

/// What the status lamp says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum State {
    /// No rest pose yet, or no targets in sight.
    Waiting = 0,
    /// Frames give motions.
    Measuring = 1,
    /// No camera.
    Fault = 2,
}

/// The box's state, for whoever shows it.
#[derive(Debug, Default)]
pub struct Status(AtomicU8);

impl Status {
    /// The state at the moment.
    pub fn get(&self) -> State {
        match self.0.load(Ordering::Relaxed) {
            1 => State::Measuring,
            2 => State::Fault,
            _ => State::Waiting,
        }
    }

    pub(super) fn set(&self, state: State) {
        self.0.store(state as u8, Ordering::Relaxed);
    }
}
