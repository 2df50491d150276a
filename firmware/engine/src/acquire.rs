//! Finds the targets without a prediction, in slices of bounded cost: rings first, anywhere in the picture, then which
//! circles they are.

use gangway_device::Frame;
use gangway_pose::{Assigner, Pose, Progress, Sighting, View};
use gangway_vision::Acquisition;

use crate::Settings;

/// Work of one slice, instructions, about: with a frame's tracking beside it less than three times that alone (28 rings
/// of 16 to 19 px take two million). A whole picture of 1920 x 1080 is swept in one slice, if its rings are 16 px or
/// more.
const WORK_A_FRAME: u32 = 3_000_000;

/// Work of the very first slice: before it nothing is tracked, and rest often begins with the first picture.
const WORK_AT_START: u32 = 12_000_000;

/// The search with its working memory.
pub(crate) struct Acquirer {
    acquisition: Acquisition,
    assigner: Assigner,
    /// The picture is swept; the rings are being assigned.
    assigning: bool,
    /// The last sweep was of one picture, the last that was searched.
    fresh: bool,
    started: bool,
}

impl Acquirer {
    pub(crate) fn new(settings: &Settings) -> Self {
        let all = || settings.circles.iter().map(|circle| circle.outer_mm / circle.inner_mm);
        // Discs have no inner edge.
        let rings = all().filter(|ratio| ratio.is_finite());
        let ratios =
            rings.fold([f64::INFINITY, 0.0_f64], |[low, high], ratio| [low.min(ratio), high.max(ratio)]);
        let acquisition = Acquisition::new(&settings.vision, ratios);
        let has_discs = all().any(|ratio| !ratio.is_finite());
        Self {
            acquisition: if has_discs { acquisition.with_discs() } else { acquisition },
            assigner: Assigner::new(&settings.circles),
            assigning: false,
            fresh: false,
            started: false,
        }
    }

    /// Whether any target can be known by its circles.
    pub(crate) fn is_able(&self) -> bool {
        self.assigner.is_able()
    }

    /// Begins anew with the next slice.
    pub(crate) fn restart(&mut self) {
        self.acquisition.restart();
        self.assigning = false;
    }

    /// Says how large the smallest ring shows, px.
    pub(crate) fn expect(&mut self, diameter_px: f64) {
        self.acquisition.expect(diameter_px);
    }

    /// One slice of the search, in this picture.
    pub(crate) fn slice(
        &mut self,
        frame: &Frame<'_>,
        settings: &Settings,
        is_plausible: &dyn Fn(&Pose) -> bool,
    ) -> Progress {
        let mut work = if core::mem::replace(&mut self.started, true) { WORK_A_FRAME } else { WORK_AT_START };
        self.fresh = false;
        if !self.assigning {
            let begins = !self.acquisition.is_going();
            if !self.acquisition.advance(frame, &mut work) {
                return Progress::Going;
            }
            self.fresh = begins;
            self.assigner.begin(self.acquisition.sightings());
            self.assigning = true;
        }
        let view = View {
            circles: &settings.circles,
            lens: &settings.lens,
            picture: settings.picture,
            is_plausible,
        };
        let progress = self.assigner.advance(&view, &mut work);
        self.assigning = progress == Progress::Going;
        progress
    }

    /// The rings of the last sweep.
    pub(crate) fn sightings(&self) -> &[Sighting] {
        self.acquisition.sightings()
    }

    /// Whether they were all seen in the picture of the last slice.
    pub(crate) fn is_fresh(&self) -> bool {
        self.fresh
    }
}
