//! Finds the targets without a prediction, in slices of bounded cost: rings first, anywhere in the picture, then which
//! circles they are.

use gangway_device::Frame;
use gangway_pose::{Assigner, Pose, Progress, Sighting, View};
use gangway_vision::{Acquisition, MAX_SIGHTINGS, Search};
use heapless::Vec;

use crate::windows::Sight;

/// Work of a frame that nothing is known in: about twice the time that tracking 28 rings of 16 to 19 px takes. A picture of
/// 1920 x 1080 takes two or three such slices, by the size of its rings, and one more to be assigned.
const WORK_A_FRAME: u32 = 2_900_000;
/// Of that goes into windows that were looked into and showed too little, or that are still to be looked into.
const WORK_OF_WINDOWS: u32 = 1_500_000;
/// Work beside windows that show something, but are in doubt: rings beside them contradict them only in one and the same
/// picture, so that all of it is swept at once, if its rings are 16 px or more.
const WORK_IN_DOUBT: u32 = 5_500_000;

/// Where nothing is known of the rings' size: a sweep for those of so many pixels or more, which finds most of 16 px too and
/// takes half as long, and one for all, in turn.
const UNKNOWN_PX: [f64; 2] = [20.0, 9.0];

/// A ring within so much of a diameter of a circle of the other carbody is that one.
const TAKEN: f64 = 0.6;
/// Rings of a size within this factor of a circle's could be it.
pub(crate) const SIZE: f64 = 1.4;

/// What a frame's windows came to, before the search.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Windows {
    /// None were looked into.
    None,
    /// They gave no pose.
    Empty,
    /// They gave a pose that misses much.
    InDoubt,
}

/// The search with its working memory.
pub(crate) struct Acquirer {
    acquisition: Acquisition,
    /// The rings of the last sweep that are not known to be of the other carbody.
    sightings: Vec<Sighting, MAX_SIGHTINGS>,
    assigner: Assigner,
    /// The size of the rings is known.
    is_expected: bool,
    sweeps: usize,
    /// The picture is swept; the rings are being assigned.
    assigning: bool,
    /// The last sweep was of one picture, the last that was searched.
    fresh: bool,
    /// What was found, to be told in the next frame: its windows would have been too much for the last one.
    answer: Option<Progress>,
}

impl Acquirer {
    pub(crate) fn new(sight: &Sight<'_>) -> Self {
        let all = || sight.circles.iter().map(|circle| circle.outer_mm / circle.inner_mm);
        // Discs have no inner edge.
        let rings = all().filter(|ratio| ratio.is_finite());
        let ratios =
            rings.fold([f64::INFINITY, 0.0_f64], |[low, high], ratio| [low.min(ratio), high.max(ratio)]);
        let acquisition = Acquisition::new(&sight.settings.vision, ratios);
        let has_discs = all().any(|ratio| !ratio.is_finite());
        Self {
            acquisition: if has_discs { acquisition.with_discs() } else { acquisition },
            sightings: Vec::new(),
            assigner: Assigner::new(sight.circles),
            is_expected: false,
            sweeps: 0,
            assigning: false,
            fresh: false,
            answer: None,
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
        self.answer = None;
    }

    /// Says how large the smallest ring shows, px.
    pub(crate) fn expect(&mut self, diameter_px: f64) {
        self.acquisition.expect(diameter_px);
        self.is_expected = true;
    }

    /// One slice of the search, in this picture, beside `windows`. What shows where the other carbody's circles are is
    /// left out: `others` are their windows.
    pub(crate) fn slice(
        &mut self,
        frame: &Frame<'_>,
        sight: &Sight<'_>,
        windows: Windows,
        others: &[Search],
        is_plausible: &dyn Fn(&Pose) -> bool,
    ) -> Progress {
        self.fresh = false;
        if let Some(answer) = self.answer.take() {
            return answer;
        }
        let whole = match windows {
            Windows::None => WORK_A_FRAME,
            Windows::Empty => WORK_A_FRAME - WORK_OF_WINDOWS,
            Windows::InDoubt => WORK_IN_DOUBT,
        };
        let mut work = whole;
        if !self.assigning {
            let begins = !self.acquisition.is_going();
            if begins && !self.is_expected {
                self.acquisition.expect(UNKNOWN_PX[self.sweeps % UNKNOWN_PX.len()]);
            }
            self.sweeps = self.sweeps.wrapping_add(usize::from(begins));
            if !self.acquisition.advance(frame, &mut work) {
                return Progress::Going;
            }
            self.fresh = begins;
            self.sightings.clear();
            let free = self.acquisition.sightings().iter().filter(|ring| !is_taken(ring, others));
            // As many as there were, at most.
            self.sightings.extend(free.copied());
            self.assigner.begin(&self.sightings);
            self.assigning = true;
        }
        let view = View {
            circles: sight.circles,
            lens: &sight.settings.lens,
            picture: sight.settings.picture,
            is_plausible,
        };
        let progress = self.assigner.advance(&view, &mut work);
        self.assigning = progress == Progress::Going;
        // What is found is looked into at once if that is not too much for one frame.
        if matches!(progress, Progress::Assigned(_)) && work < WORK_OF_WINDOWS {
            self.answer = Some(progress);
            return Progress::Going;
        }
        progress
    }

    /// The rings of the last sweep.
    pub(crate) fn sightings(&self) -> &[Sighting] {
        &self.sightings
    }

    /// Whether they were all seen in the picture of the last slice.
    pub(crate) fn is_fresh(&self) -> bool {
        self.fresh
    }
}

/// Whether a ring shows where one of these windows looks for one of its size.
fn is_taken(ring: &Sighting, others: &[Search]) -> bool {
    others.iter().any(|search| is_near(ring, search, TAKEN))
}

/// Whether a ring of about the right size shows within so many diameters of where a window looks for one.
pub(crate) fn is_near(ring: &Sighting, search: &Search, diameters: f64) -> bool {
    let (size, diameter) = (ring.diameter_px(), search.diameter_px());
    let off = libm::hypot(ring.at[0] - search.at[0], ring.at[1] - search.at[1]);
    // What is no number is no place.
    off < diameters * diameter && size < SIZE * diameter && diameter < SIZE * size
}
