//! The tracker of thesis 3.2.3 and 3.2.5 over all circles of a frame.

use gangway_device::Frame;

use crate::{Refusal, Ring, Search, Settings};

/// The tracker with its working memory; made once and kept.
pub struct Tracker {
    settings: Settings,
}

impl Tracker {
    /// A tracker with these settings.
    pub const fn new(settings: Settings) -> Self {
        Self { settings }
    }

    /// The settings it was made with.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Looks for every ring of `searches`; `rings[i]` answers `searches[i]`. Searches beyond the length of
    /// `rings` are left out.
    pub fn track(&mut self, frame: &Frame, searches: &[Search], rings: &mut [Result<Ring, Refusal>]) {
        for (search, ring) in searches.iter().zip(rings.iter_mut()) {
            *ring = self.look(frame, search);
        }
    }

    /// Looks for one ring in its window, once.
    pub fn look(&mut self, _frame: &Frame, _search: &Search) -> Result<Ring, Refusal> {
        Err(Refusal::NotFound)
    }
}
