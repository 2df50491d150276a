//! Finds the targets without a prediction, in slices of bounded cost: rings first, anywhere in the picture,
//! then which circles they are.

use gangway_device::Frame;
use gangway_pose::{Assigned, Assigner, Pose, Progress, Sighting, View};
use gangway_vision::{Acquisition, MAX_SIGHTINGS, Part, Search};
use heapless::Vec;

use crate::LampMode;
use crate::windows::Sight;

/// Instructions that tracking one ring of 16 to 19 px takes: the work of a slice is counted in the time of
/// such ones.
pub(crate) const WORK_A_RING: u32 = 45_000;
/// Fewest rings whose tracking a slice is measured by: with slices as small as fewer need it would take long
/// to be found.
const LEAST_RINGS: usize = 20;

// Shares of the tracking of all rings, in tenths, so that no frame comes to more than three times that.
/// Of sweeping the picture in a frame that nothing is known in: one of 1920 x 1080 is swept in one or two.
const SWEEPING: i32 = 23;
/// Of the end of a sweep, assigning what was seen, and the windows of a pose that was found, in one frame.
const IN_ALL: i32 = 26;
/// Of a window's tracking: the windows of a pose that was found cost somewhat more than predicted ones.
const FOUND_WINDOW: i32 = 11;
/// Of finding no pose in what the windows showed.
const NO_POSE: i32 = 4;
/// Beside windows that show something, but are in doubt: of the look around them and the search together ...
const IN_DOUBT: i32 = 8;
/// ... and of the search in any case, so that it goes on.
const AT_LEAST: i32 = 1;
/// Of taking the rings around a pose that they contradict for the circles: a jump must not cost the frame.
const ASSIGNING_AROUND: i32 = 12;

/// Where nothing is known of the rings' size: a sweep for those of so many pixels or more, which finds most
/// of 16 px too and takes half as long, and one for all, in turn.
const UNKNOWN_PX: [f64; 2] = [20.0, 9.0];

/// A ring within so much of a diameter of a circle of the other carbody is that one.
const TAKEN: f64 = 0.6;
/// Rings of a size within this factor of a circle's could be it.
pub(crate) const SIZE: f64 = 1.4;
/// Rings within so many times half the way from a circle to its nearest neighbour are of its target.
pub(crate) const NEIGHBOURHOOD: f64 = 3.0;

/// What a frame's windows came to, before the search.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Windows {
    /// None were looked into.
    None,
    /// So many were, and gave no pose.
    Empty(u32),
    /// They gave a pose that misses much.
    InDoubt,
}

/// The search with its working memory.
pub(crate) struct Acquirer {
    acquisition: Acquisition,
    /// A tenth of the tracking of all rings, by which slices are measured.
    tenth: i32,
    /// The rings around the windows of this picture.
    around: Vec<Sighting, MAX_SIGHTINGS>,
    /// Work that this frame has left for the search, if it was begun with the look around, and all that it
    /// took.
    left: Option<i32>,
    spent: i32,
    /// The rings of the last sweep that are not known to be of the other carbody.
    sightings: Vec<Sighting, MAX_SIGHTINGS>,
    assigner: Assigner,
    /// The size of the rings is known.
    is_expected: bool,
    sweeps: usize,
    /// The picture is swept; the rings are being assigned.
    assigning: bool,
    /// Lamps alternate: what was found is told in two frames on end, for one of them is dark.
    twice: bool,
    /// What the last frame was told and the next one is to be.
    again: Option<Progress>,
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
        let twice = has_discs && sight.settings.lamps == LampMode::Alternate;
        let acquisition = if has_discs { acquisition.with_discs() } else { acquisition };
        Self {
            acquisition: if twice { acquisition.twice() } else { acquisition },
            tenth: WORK_A_RING as i32 * sight.settings.circles.len().max(LEAST_RINGS) as i32 / 10,
            around: Vec::new(),
            left: None,
            spent: 0,
            sightings: Vec::new(),
            assigner: Assigner::new(sight.circles),
            is_expected: false,
            sweeps: 0,
            assigning: false,
            twice,
            again: None,
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
        self.again = None;
    }

    /// Says how large the smallest ring shows, px.
    pub(crate) fn expect(&mut self, diameter_px: f64) {
        self.acquisition.expect(diameter_px);
        self.is_expected = true;
    }

    /// One slice of the search, in this picture, beside `windows`. What shows where the other carbody's
    /// circles are is left out: `others` are their windows.
    pub(crate) fn slice(
        &mut self,
        frame: &Frame<'_>,
        sight: &Sight<'_>,
        windows: Windows,
        others: &[Search],
        is_plausible: &dyn Fn(&Pose) -> bool,
    ) -> Progress {
        if let Some(found) = self.again.take() {
            return found;
        }
        let windows_of = |count: usize| WORK_A_RING as i32 * count as i32;
        let found = FOUND_WINDOW * windows_of(sight.circles.len()) / 10;
        let with_windows = IN_ALL * self.tenth - found - windows_of(others.len());
        let [whole, assigning] = match windows {
            Windows::None => [SWEEPING * self.tenth, with_windows],
            Windows::Empty(count) => {
                let gone = NO_POSE * self.tenth + windows_of(count as usize);
                [SWEEPING * self.tenth - gone, with_windows - gone]
            }
            Windows::InDoubt => {
                let left = self.left.take().unwrap_or(IN_DOUBT * self.tenth);
                [left.max(AT_LEAST * self.tenth); 2]
            }
        };
        let mut work = whole;
        let mut progress = self.go_on(frame, sight, others, is_plausible, (&mut work, whole - assigning));
        // The next sweep begins with what is left: what is hidden may show any time. Not where lamps
        // alternate: what this picture does not show the next one may, if it is swept whole.
        let goes_on = windows != Windows::InDoubt && !self.twice && work > 0;
        if goes_on && matches!(progress, Progress::Refused(_)) {
            let next = self.go_on(frame, sight, others, is_plausible, (&mut work, whole - assigning));
            progress = if next == Progress::Going { progress } else { next };
        }
        self.spent += whole - work;
        self.again = (self.twice && matches!(progress, Progress::Assigned(_))).then_some(progress);
        progress
    }

    /// Sweeps on, then assigns what was seen, for which `held` of the work is not there.
    fn go_on(
        &mut self,
        frame: &Frame<'_>,
        sight: &Sight<'_>,
        others: &[Search],
        is_plausible: &dyn Fn(&Pose) -> bool,
        (work, held): (&mut i32, i32),
    ) -> Progress {
        if !self.assigning {
            let begins = !self.acquisition.is_going();
            if begins && !self.is_expected {
                self.acquisition.expect(UNKNOWN_PX[self.sweeps % UNKNOWN_PX.len()]);
            }
            self.sweeps = self.sweeps.wrapping_add(usize::from(begins));
            if !self.acquisition.advance(frame, work) {
                return Progress::Going;
            }
            self.sightings.clear();
            let free = self.acquisition.sightings().iter().filter(|ring| !is_taken(ring, others));
            // As many as there were, at most.
            self.sightings.extend(free.copied());
            self.assigner.begin(&self.sightings);
            self.assigning = true;
        }
        *work -= held;
        let progress = self.assigner.advance(&view(sight, is_plausible), work);
        *work += held;
        self.assigning = progress == Progress::Going;
        progress
    }

    /// The pose that the rings of the last [`Acquirer::look_around`] show, if they show one: where the
    /// targets jumped to. A sweep that is going on goes on; an assignment begins anew.
    pub(crate) fn assign_around(
        &mut self,
        sight: &Sight<'_>,
        is_plausible: &dyn Fn(&Pose) -> bool,
    ) -> Option<Assigned> {
        let whole = ASSIGNING_AROUND * self.tenth;
        let mut work = whole;
        if self.assigning {
            self.restart();
        }
        self.assigner.begin(&self.around);
        let progress = self.assigner.advance(&view(sight, is_plausible), &mut work);
        self.spent += whole - work;
        if let Progress::Assigned(found) = progress { Some(found) } else { None }
    }

    /// Looks for all rings around these windows, in this picture: those that are not of the other carbody.
    /// `None` if that would be too much for one frame.
    pub(crate) fn look_around(
        &mut self,
        frame: &Frame<'_>,
        searches: &[Search],
        others: &[Search],
    ) -> Option<&[Sighting]> {
        self.around.clear();
        let whole = IN_DOUBT * self.tenth;
        let mut work = whole;
        let mut is_whole = true;
        for target in searches.chunk_by(|a, b| a.target == b.target) {
            let Some(part) = part_around(target, (frame.width(), frame.height())) else { continue };
            is_whole &= self.acquisition.look_in(frame, &part, &mut self.around, &mut work);
        }
        self.around.retain(|ring| !is_taken(ring, others));
        self.spent += whole - work;
        self.left = Some(work);
        is_whole.then_some(&self.around)
    }

    /// Work since this was asked last.
    pub(crate) fn take_spent(&mut self) -> u32 {
        core::mem::take(&mut self.spent).max(0) as u32
    }

    /// The rings of the last sweep.
    pub(crate) fn sightings(&self) -> &[Sighting] {
        &self.sightings
    }
}

/// What an assignment is made through.
fn view<'v>(sight: &Sight<'v>, is_plausible: &'v dyn Fn(&Pose) -> bool) -> View<'v> {
    View { circles: sight.circles, lens: &sight.settings.lens, picture: sight.settings.picture, is_plausible }
}

/// The part of a picture in which rings would be taken for circles of this target or for what contradicts
/// them.
fn part_around(target: &[Search], (width, height): (u16, u16)) -> Option<Part> {
    let mut bounds = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
    for search in target {
        // Circles that show nowhere are no numbers, and leave the bounds as they are.
        let margin = NEIGHBOURHOOD * search.reach_px + search.diameter_px();
        for (bounds, at) in bounds.iter_mut().zip(search.at) {
            *bounds = [bounds[0].min(at - margin), bounds[1].max(at + margin)];
        }
    }
    // The casts saturate.
    let [columns, rows] = bounds.map(|[low, high]| low as u16..libm::ceil(high) as u16);
    let part =
        Part { columns: columns.start..columns.end.min(width), rows: rows.start..rows.end.min(height) };
    (!part.columns.is_empty() && !part.rows.is_empty()).then_some(part)
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
