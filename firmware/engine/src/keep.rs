//! Never lost, never wrong: whether the rings that were found are taken, doubted or looked for anew.
//!
//! Equal circles on a lattice: a jump by most of their spacing looks like a small jump the other way, and the
//! rings that have a neighbour there agree on it. What gives it away is that the others are missing, and that
//! rings stand where there should be none. So a pose that misses many circles is in doubt: the whole picture
//! is swept for rings, and what these show stands. Once nothing was found for some frames, nothing is taken
//! for granted any more: only what the whole picture shows counts, or what contradicts nothing in it.

use gangway_device::Frame;
use gangway_pose::{Assigned, Pose, PoseError, Progress, Sighting, Solution, angles, project_circle};
use gangway_vision::Search;

use crate::Settings;
use crate::acquire::{Acquirer, NEIGHBOURHOOD, SIZE, Windows};
use crate::windows::Sight;

/// A pose is beyond doubt when this share of the circles in the picture went into it. Moved by a spacing, a
/// 7-CCC still has four of its rings on others, a 5-CCC two.
const TRUSTED: (u32, u32) = (7, 10);
/// Once a doubt is settled it is not raised again for so many frames, while nothing gets worse: somebody may
/// just stand in the gangway.
const PATIENCE: u32 = 10;
/// Fewer circles by more than this are worse.
const WORSE: u32 = 2;
/// Frames without a pose after which the last one is no prediction any more.
const COASTING_FRAMES: u32 = 3;
/// Fewest circles that may confirm the last pose after that.
const LEAST_CONFIRMING: u32 = 6;
/// A ring is explained by a circle that shows within this share of the way to its nearest neighbour's middle:
/// in the picture that was swept, and in a later one, where it may have moved on.
const EXPLAINED: [f64; 2] = [0.2, 0.8];
/// The smallest ring may have become smaller to this share.
const SMALLER: f64 = 0.9;
/// A pose beyond this many times the limits of the motion, from rest, is not plausible.
pub(crate) const BEYOND_LIMITS: f64 = 1.3;

/// What is known about the targets' place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Hold {
    /// Since the last frame.
    Kept,
    /// For so many frames nothing of it was seen.
    Missing(u32),
    /// Nothing; whether it was known once.
    Lost { once: bool },
}

/// What is to be done with what the windows showed.
pub(crate) enum Verdict {
    /// It stands.
    Keep,
    /// It is not taken.
    Refuse,
    /// The windows of this pose are to be looked into as well, or `instead` of what was.
    Try { found: Assigned, instead: bool },
}

/// What is to be judged: what the windows `searches` showed, if they were looked into.
pub(crate) struct Question<'q> {
    pub(crate) sight: Sight<'q>,
    pub(crate) searches: &'q [Search],
    /// How many of them were looked into.
    pub(crate) looked: u32,
    pub(crate) solution: &'q Result<Solution, PoseError>,
    /// How many circles should show in the picture.
    pub(crate) in_picture: u32,
    /// Windows of the other carbody's circles.
    pub(crate) others: &'q [Search],
    /// Whether the picture may be searched now; a doubt that cannot be settled is a refusal.
    pub(crate) may_search: bool,
    /// Which of two poses that explain the rings equally well can be.
    pub(crate) is_plausible: &'q dyn Fn(&Pose) -> bool,
}

/// Decides about each frame.
pub(crate) struct Keeper {
    acquirer: Acquirer,
    hold: Hold,
    /// The carbody does not move in the camera: where it was is where it is looked for, however long ago.
    fixed: bool,
    /// A slice of the search was spent in the last frame.
    searched: bool,
    /// The last frame's pose is beyond doubt.
    trusted: bool,
    /// While lost: the next frame is looked at where the last pose was.
    looks_back: bool,
    /// The place is only told, and neither most of all circles nor a whole sweep has borne it out: seeds may
    /// be another target's, with the others out of the picture by that.
    unproven: bool,
    /// Frame and number of circles when a doubt was settled.
    settled: Option<(u32, u32)>,
}

impl Keeper {
    /// Begins with a pose that is `known`, or with nothing.
    pub(crate) fn new(sight: &Sight<'_>, known: bool, fixed: bool) -> Self {
        let acquirer = Acquirer::new(sight);
        Self {
            unproven: known && acquirer.is_able(),
            acquirer,
            fixed,
            searched: false,
            trusted: false,
            hold: if known { Hold::Kept } else { Hold::Lost { once: false } },
            looks_back: false,
            settled: None,
        }
    }

    /// Whether targets can be found without a prediction.
    pub(crate) fn is_able(&self) -> bool {
        self.acquirer.is_able()
    }

    /// Whether the last pose says where to look in this frame.
    pub(crate) fn follows(&self) -> bool {
        match self.hold {
            Hold::Lost { once } => self.looks_back || (self.fixed && once),
            _ => true,
        }
    }

    /// The rings of the last sweep, if the last pose is only looked back at: where they show none, no window
    /// is worth it.
    pub(crate) fn glimpses(&self) -> Option<&[Sighting]> {
        (self.looks_back && !self.fixed).then(|| self.acquirer.sightings())
    }

    /// Whether the last frame had a pose.
    pub(crate) fn is_kept(&self) -> bool {
        self.hold == Hold::Kept
    }

    /// Whether the last frame's pose is beyond doubt, or no doubt was followed up in it.
    pub(crate) fn is_calm(&self) -> bool {
        self.hold == Hold::Kept && (self.trusted || !self.searched)
    }

    /// Whether nothing is known of the targets' place.
    pub(crate) fn is_lost(&self) -> bool {
        matches!(self.hold, Hold::Lost { .. })
    }

    /// Whether a slice of the search was spent in the last frame.
    pub(crate) fn has_searched(&self) -> bool {
        self.searched
    }

    /// Judges what the windows showed; goes on with the search where that is not enough.
    pub(crate) fn judge(&mut self, frame: &Frame<'_>, question: &Question<'_>) -> Verdict {
        self.searched = false;
        let lost = matches!(self.hold, Hold::Lost { .. });
        if let Ok(own) = question.solution {
            let used = own.used.count_ones();
            self.unproven &= !is_trusted(used, question.sight.circles.len() as u32);
            let stands = (is_trusted(used, question.in_picture) && !self.unproven)
                || (!lost && self.waits(frame.number(), used))
                || (lost && self.confirms(own, question));
            if stands {
                return Verdict::Keep;
            }
        }
        self.looks_back = false;
        if !question.may_search {
            return Verdict::Refuse;
        }
        self.searched = true;
        self.expect(question.searches);
        match question.solution {
            Ok(own) if !lost => self.doubt(frame, question, own),
            _ => self.search(frame, question),
        }
    }

    /// Whether the place where the targets were last, once they are lost, is theirs: enough rings are there,
    /// and what the last sweep showed does not contradict it.
    fn confirms(&mut self, own: &Solution, question: &Question<'_>) -> bool {
        let Question { sight, searches, .. } = question;
        let rings = self.acquirer.sightings();
        own.used.count_ones() >= LEAST_CONFIRMING
            && !contradicts(rings, &own.pose, sight, searches, EXPLAINED[1])
    }

    /// A pose that misses much: it stands unless rings beside it contradict it, which is looked for at once,
    /// or the whole picture shows a better one, which takes some frames.
    fn doubt(&mut self, frame: &Frame<'_>, question: &Question<'_>, own: &Solution) -> Verdict {
        let Question { sight, searches, others, .. } = *question;
        let around = self.acquirer.look_around(frame, searches, others);
        let stands =
            around.is_some_and(|rings| !contradicts(rings, &own.pose, &sight, searches, EXPLAINED[0]));
        // Contradicted by what may well be the targets themselves, a jump away.
        let is_whole = around.is_some();
        if is_whole
            && !stands
            && let Some(found) = self.acquirer.assign_around(&sight, question.is_plausible)
        {
            return Verdict::Try { found, instead: true };
        }
        let progress = self.acquirer.slice(frame, &sight, Windows::InDoubt, others, question.is_plausible);
        let was_unproven = self.unproven;
        self.unproven &= progress == Progress::Going;
        if progress != Progress::Going {
            self.settled = Some((frame.number(), own.used.count_ones()));
        }
        match progress {
            Progress::Assigned(found) if stands && agree(&found.pose, &own.pose, &sight, searches) => {
                Verdict::Keep
            }
            Progress::Assigned(found) => Verdict::Try { found, instead: was_unproven || !stands },
            _ if stands && !self.unproven => Verdict::Keep,
            _ => Verdict::Refuse,
        }
    }

    /// One slice of the search for what was lost.
    fn search(&mut self, frame: &Frame<'_>, question: &Question<'_>) -> Verdict {
        let Question { sight, others, is_plausible, looked, .. } = *question;
        let windows = if looked > 0 { Windows::Empty(looked) } else { Windows::None };
        match self.acquirer.slice(frame, &sight, windows, others, is_plausible) {
            Progress::Assigned(found) => Verdict::Try { found, instead: true },
            progress => {
                let sought = progress != Progress::Going && self.hold == Hold::Lost { once: true };
                self.looks_back = sought && !self.fixed;
                Verdict::Refuse
            }
        }
    }

    /// Work of the search since this was asked last.
    pub(crate) fn take_spent(&mut self) -> u32 {
        self.acquirer.take_spent()
    }

    /// Takes note of how the frame ended: with so many circles in a pose, or at least with some where they
    /// were `followed`.
    pub(crate) fn note(&mut self, used: Option<u32>, followed: bool, in_picture: u32) {
        self.trusted = used.is_some_and(|used| is_trusted(used, in_picture));
        if used.is_some() {
            self.hold = Hold::Kept;
            self.looks_back = false;
            if self.trusted {
                self.settled = None;
                self.acquirer.restart();
            }
            return;
        }
        self.settled = None;
        self.hold = match self.hold {
            Hold::Kept => Hold::Missing(1),
            Hold::Missing(_) if followed => Hold::Missing(1),
            Hold::Missing(frames) if frames < COASTING_FRAMES => Hold::Missing(frames + 1),
            Hold::Missing(_) => {
                self.unproven = false;
                Hold::Lost { once: true }
            }
            lost => lost,
        };
    }

    /// Whether a doubt was settled lately and nothing is worse since.
    fn waits(&self, frame: u32, used: u32) -> bool {
        self.settled
            .is_some_and(|(settled, then)| frame.wrapping_sub(settled) < PATIENCE && used + WORSE >= then)
    }

    /// Tells the search how large the rings were that were seen last.
    fn expect(&mut self, searches: &[Search]) {
        let diameters = searches.iter().map(Search::diameter_px).filter(|diameter| *diameter > 0.0);
        let smallest = diameters.fold(f64::INFINITY, f64::min);
        if smallest.is_finite() {
            self.acquirer.expect(SMALLER * smallest);
        }
    }
}

/// Whether enough of the circles in the picture went into a pose.
pub(crate) fn is_trusted(used: u32, in_picture: u32) -> bool {
    used > 0 && used * TRUSTED.1 >= in_picture * TRUSTED.0
}

/// Whether a pose is one that the train can have, by the limits of its motion from `reference`.
pub(crate) fn is_within(pose: &Pose, reference: &Pose, settings: &Settings) -> bool {
    let back = reference.rotation.transpose();
    let moved = back * (pose.translation - reference.translation);
    let turned = angles(&(back * pose.rotation)).map(f64::to_degrees);
    let limits = &settings.limits;
    (0..3).all(|i| {
        moved[i] >= BEYOND_LIMITS * limits.min_mm[i]
            && moved[i] <= BEYOND_LIMITS * limits.max_mm[i]
            && libm::fabs(turned[i]) <= BEYOND_LIMITS * limits.max_deg[i]
    })
}

/// Whether two poses show every circle nearer to itself than to its neighbour.
fn agree(one: &Pose, other: &Pose, sight: &Sight<'_>, searches: &[Search]) -> bool {
    sight.circles.iter().zip(searches).all(|(circle, search)| {
        let at = |pose: &Pose| sight.settings.lens.project(&pose.transform(&circle.point));
        let (Ok(a), Ok(b)) = (at(one), at(other)) else { return true };
        libm::hypot(a[0] - b[0], a[1] - b[1]) < search.reach_px
    })
}

/// Whether rings stand beside a pose's circles where it has none: too many for chance. What is `within` this
/// share of half the way to a circle's neighbour is that circle.
fn contradicts(
    sightings: &[Sighting],
    pose: &Pose,
    sight: &Sight<'_>,
    searches: &[Search],
    within: f64,
) -> bool {
    let (mut explained, mut unexplained) = (0, 0);
    let shown = || {
        sight.circles.iter().zip(searches).filter_map(|(circle, search)| {
            let projected = project_circle(circle, pose, &sight.settings.lens).ok()?;
            Some((projected.centre, projected.diameter_px, search.reach_px))
        })
    };
    for ring in sightings {
        let size = ring.diameter_px();
        // In halves of the way to a neighbour.
        let nearest = shown()
            .filter(|(_, diameter, _)| size < SIZE * diameter && *diameter < SIZE * size)
            .map(|(at, _, reach)| libm::hypot(ring.at[0] - at[0], ring.at[1] - at[1]) / reach)
            .fold(f64::INFINITY, f64::min);
        if nearest < within {
            explained += 1;
        } else if nearest < NEIGHBOURHOOD {
            unexplained += 1;
        }
    }
    unexplained > 1 && 2 * unexplained > explained
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Limits, RestSettings, windows};
    use gangway_pose::{Circle, Lens, MAX_CIRCLES};
    use heapless::Vec;
    use nalgebra::Vector3;

    /// A die of five before a camera without distortion.
    fn settings() -> Settings {
        let places = [(-60.0, 62.0), (60.0, 62.0), (0.0, 0.0), (-60.0, -62.0), (60.0, -62.0)];
        let circle = |(y, z)| Circle {
            point: Vector3::new(0.0, y, z),
            normal: Vector3::new(-1.0, 0.0, 0.0),
            outer_mm: 42.0,
            inner_mm: 21.0,
            target: 0,
        };
        Settings {
            name: Default::default(),
            picture: (1920, 1080),
            rate_hz: 50.0,
            lens: Lens { focal: [1400.0; 2], skew: 0.0, principal: [960.0, 540.0], distortion: [0.0; 5] },
            circles: places.into_iter().map(circle).collect(),
            own: 0,
            seeds: [None; 5].into_iter().collect(),
            reference: None,
            shutter: gangway_pose::Shutter::INSTANT,
            vision: Default::default(),
            solver: Default::default(),
            rest: RestSettings::default(),
            limits: Limits::default(),
            exposure: None,
            lamps: Default::default(),
            text: Default::default(),
            digest: [0; 16],
        }
    }

    fn whole(settings: &Settings) -> Sight<'_> {
        Sight { settings, circles: &settings.circles, seeds: &settings.seeds }
    }

    fn searches(settings: &Settings, pose: &Pose) -> Vec<Search, MAX_CIRCLES> {
        let mut searches = Vec::new();
        windows::searches(&whole(settings), pose, false, &mut searches);
        searches
    }

    /// What a sweep shows of all circles.
    fn sightings(searches: &[Search]) -> Vec<Sighting, MAX_CIRCLES> {
        searches.iter().map(|search| Sighting { at: search.at, shape: search.shape, ratio: 2.0 }).collect()
    }

    fn moved(pose: &Pose, by: [f64; 3]) -> Pose {
        Pose { translation: pose.translation + pose.rotation * Vector3::from(by), ..*pose }
    }

    #[test]
    fn a_pose_one_spacing_off_is_contradicted_by_the_rings_that_it_leaves_over() {
        let settings = settings();
        let truth = Pose::of_camera([-1500.0, 0.0, 0.0], [0.0; 3]);
        let shown = sightings(&searches(&settings, &truth));
        for (by, expected) in [([0.0; 3], false), ([0.0, 60.0, 62.0], true), ([0.0, 120.0, 0.0], true)] {
            let pose = moved(&truth, by);
            let windows = searches(&settings, &pose);
            assert_eq!(
                contradicts(&shown, &pose, &whole(&settings), &windows, EXPLAINED[0]),
                expected,
                "{by:?}"
            );
        }
    }

    #[test]
    fn rings_of_another_size_and_far_away_contradict_nothing() {
        let settings = settings();
        let truth = Pose::of_camera([-1500.0, 0.0, 0.0], [0.0; 3]);
        let windows = searches(&settings, &truth);
        let mut shown = sightings(&windows);
        for i in 0..6 {
            let far = Sighting { at: [100.0 + 40.0 * f64::from(i), 100.0], ..shown[0] };
            let large = Sighting { at: [960.0, 700.0], shape: shown[0].shape.map(|m| 4.0 * m), ratio: 2.0 };
            shown.extend([far, large]);
        }
        assert!(!contradicts(&shown, &truth, &whole(&settings), &windows, EXPLAINED[0]));
    }

    #[test]
    fn a_pose_upside_down_is_beyond_the_limits_of_the_motion() {
        let settings = settings();
        let rest = Pose::of_camera([-1500.0, 0.0, 0.0], [0.0; 3]);
        assert!(is_within(&moved(&rest, [10.0, 400.0, -100.0]), &rest, &settings));
        assert!(!is_within(&moved(&rest, [10.0, 1400.0, -100.0]), &rest, &settings));
        assert!(!is_within(&Pose::of_camera([-1500.0, 0.0, 0.0], [180.0, 0.0, 0.0]), &rest, &settings));
    }

    #[test]
    fn after_three_frames_without_a_pose_the_last_one_is_no_prediction_any_more() {
        let settings = settings();
        let mut keeper = Keeper::new(&whole(&settings), true, false);
        for _ in 0..COASTING_FRAMES {
            assert!(keeper.follows());
            keeper.note(None, false, 5);
        }
        assert!(keeper.follows());
        keeper.note(None, false, 5);
        assert!(!keeper.follows());
        keeper.note(Some(5), false, 5);
        assert!(keeper.follows());
    }
}
