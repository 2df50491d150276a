//! What a group would mean: every target that has its pattern gives a pose, every pose says where the other
//! targets' groups must be, and the pose from all of them says which circle must show where.

use core::cmp::Reverse;

use heapless::Vec;

use crate::ambiguity::{is_same, mirrored};
use crate::assign::group::{Group, MAX_GROUPS, NONE};
use crate::assign::layout::{Layout, MAX_PLATES, Plate};
use crate::assign::{Assigned, MAX_RINGS, Unassigned, View};
use crate::homography::homography;
use crate::problem::Problem;
use crate::refine::{Fit, refine_within};
use crate::{Centre, Circle, MAX_CIRCLES, Observation, Pose, Settings, Sighting, project_circle};

/// Most hypotheses that are verified.
const MAX_RIVALS: usize = 10;
/// A second pose of a flat target is followed up when its residual is below this many times the first's.
const SECOND: f64 = 6.0;
/// Standard deviation of a ring's centre here, px.
const SIGMA_PX: f64 = 0.1;
/// Largest residual of a hypothesis, px.
const RESIDUAL_PX: f64 = 1.0;
/// A target's own pose is coarse: from it others may show so far off, as a share of their size ...
const REACH: f64 = 0.5;
/// ... if all their circles are off by the same, to a share of their diameter.
const TOGETHER: f64 = 0.6;
/// From the pose of all groups a ring may be so far off, as a share of its diameter.
const OFF: f64 = 0.25;
/// ... and, first and at last, in pixels.
const GATE_PX: [f64; 2] = [6.0, 1.5];
/// Largest ratio of the diameters of a ring and of the circle it is taken for.
const SIZE: f64 = 1.3;
/// A hypothesis stands on two targets of which so many circles are found, together so many ...
const ON_TARGET: u32 = 3;
const ON_TWO: u32 = 8;
/// ... or on this share of all circles that should be in the picture ...
const SHARE: (u32, u32) = (7, 10);
/// ... or, with a plausible pose, on so many, of which so many are not on the target with the most: a sheet
/// that looks like a target has nothing there.
const ON_FEW: u32 = 6;
const ASIDE: u32 = 2;
/// With this share of all circles in its groups a hypothesis is not bettered from other targets.
const SETTLED: (usize, usize) = (8, 10);
/// A hypothesis whose groups have less than this share of the circles that the best one has found is no
/// rival.
const WORTH: (u32, u32) = (1, 2);
/// A rival that finds this share of what the best one finds explains the rings about as well ...
const RIVAL: (u32, u32) = (3, 4);
/// ... unless its residual is so many times the best one's, and more than so many pixels.
const WORSE: (f64, f64) = (4.0, 0.4);

/// Evaluations after which a refinement ends: those that come to something take three to eight.
const EVALUATIONS: usize = 8;

// Work, in the unit of the slices that it is done in.
/// Of a refinement, of each of its evaluations, and of either for each circle.
const WORK_REFINE: i32 = 4_000;
const WORK_EVALUATION: i32 = 1_500;
const WORK_CIRCLE: [i32; 2] = [1_300, 170];
/// Of the homography of a flat pattern, and the same for each circle.
const WORK_OF_PLANE: [i32; 2] = [15_000, 2_000];
const WORK_PROJECT: i32 = 600;
const WORK_COMPARE: i32 = 12;

/// A pose and what speaks for it.
#[derive(Clone, Debug)]
pub(crate) struct Hypothesis {
    pose: Pose,
    /// Number of the group of every plate.
    groups: [u8; MAX_PLATES],
    /// The group that it began with.
    origin: usize,
    /// Circles of these groups.
    score: usize,
    /// Number of the ring of every circle, once verified.
    rings: [u8; MAX_CIRCLES],
    found: u32,
    expected: u32,
    /// Targets with enough circles found.
    targets: u32,
    /// Circles found that are not on the target with the most.
    aside: u32,
    residual_px: f64,
}

/// The hypotheses with the most circles.
#[derive(Default)]
pub(crate) struct Rivals {
    all: Vec<Hypothesis, MAX_RIVALS>,
}

impl Rivals {
    pub(crate) fn clear(&mut self) {
        self.all.clear();
    }

    /// The most circles first.
    pub(crate) fn sort(&mut self) {
        self.all.sort_unstable_by_key(|hypothesis| Reverse(hypothesis.score));
    }

    /// Whether there is a hypothesis so good that poses from `group` can only repeat it: it does not begin
    /// with another reading of the target that this group is.
    pub(crate) fn are_settled_without(&self, layout: &Layout, groups: &[Group], group: usize) -> bool {
        let best = self.all.iter().max_by_key(|hypothesis| hypothesis.score);
        best.is_some_and(|best| {
            let origin = groups.get(best.origin).zip(groups.get(group));
            best.score * SETTLED.1 >= layout.circles() * SETTLED.0
                && origin.is_some_and(|(origin, group)| !origin.meets(group))
        })
    }

    /// The hypothesis with this number, unless it and all behind it have too few circles to rival those
    /// verified.
    pub(crate) fn worth_verifying(&mut self, number: usize) -> Option<&mut Hypothesis> {
        let most = self.all.iter().map(|verified| verified.found).max().unwrap_or(0);
        self.all.get_mut(number).filter(|next| next.score as u32 * WORTH.1 >= most * WORTH.0)
    }

    /// Whether a hypothesis takes the same rings for the same targets as one before it that was verified, and
    /// fits well: it could but come to the same pose, from another of these targets.
    pub(crate) fn is_repeated(&self, number: usize) -> bool {
        let (before, from) = self.all.split_at(number.min(self.all.len()));
        let fits = |known: &Hypothesis| known.found > 0 && known.residual_px < WORSE.1;
        from.first().is_some_and(|next| before.iter().any(|known| fits(known) && known.groups == next.groups))
    }

    fn keep(&mut self, new: Hypothesis) {
        if self.all.iter().any(|known| known.groups == new.groups && is_near(&known.pose, &new.pose)) {
            return;
        }
        if let Err(new) = self.all.push(new)
            && let Some(least) = self.all.iter_mut().min_by_key(|known| known.score)
            && least.score < new.score
        {
            *least = new;
        }
    }

    /// The one that stands.
    pub(crate) fn decide(&self, view: &View<'_>) -> Result<Assigned, Unassigned> {
        let best = self
            .all
            .iter()
            .filter(|h| h.found > 0)
            .max_by(|a, b| a.found.cmp(&b.found).then(b.residual_px.total_cmp(&a.residual_px)));
        let best = best.ok_or(Unassigned::NoPattern)?;
        let rivals = |h: &&Hypothesis| {
            let many = h.found * RIVAL.1 >= best.found * RIVAL.0;
            let well = h.residual_px <= WORSE.1.max(WORSE.0 * best.residual_px);
            many && well && !h.agrees_with(best)
        };
        let chosen = if self.all.iter().any(|h| rivals(&h)) {
            let of_all = self.all.iter().filter(rivals).chain(core::iter::once(best));
            let mut plausible = of_all.filter(|h| (view.is_plausible)(&h.pose));
            let only = plausible.next().ok_or(Unassigned::Ambiguous)?;
            if plausible.any(|other| !other.agrees_with(only)) {
                return Err(Unassigned::Ambiguous);
            }
            only
        } else {
            best
        };
        let stands = chosen.targets >= 2 && chosen.found >= ON_TWO
            || chosen.found * SHARE.1 >= chosen.expected * SHARE.0
            || chosen.found >= ON_FEW && chosen.aside >= ASIDE && (view.is_plausible)(&chosen.pose);
        let Hypothesis { pose, found, expected, .. } = *chosen;
        if stands { Ok(Assigned { pose, found, expected }) } else { Err(Unassigned::TooFew) }
    }
}

impl Hypothesis {
    /// Whether the two take most rings for the same circles.
    fn agrees_with(&self, other: &Self) -> bool {
        let same = self.rings.iter().zip(&other.rings).filter(|(a, b)| a == b && **a != NONE).count() as u32;
        2 * same > self.found.min(other.found)
    }

    /// Refines the pose on all its groups' rings, then finds every other circle's ring, and counts.
    pub(crate) fn verify(
        &mut self,
        layout: &Layout,
        view: &View<'_>,
        rings: &[Sighting],
        groups: &[Group],
        work: &mut i32,
    ) {
        let mut seen = Seen::default();
        for (plate, group) in layout.plates.iter().zip(&self.groups) {
            let Some(group) = groups.get(usize::from(*group)) else { continue };
            for (circle, ring) in group.pairs() {
                seen.add(view, plate.first + circle, rings, ring);
            }
        }
        let Some(of_groups) = seen.refine(view, &self.pose, work) else { return };
        let (pose, _) = of_groups;
        let (mut all, mut expected) = (Seen::default(), 0);
        for (number, circle) in view.circles.iter().enumerate() {
            *work = work.saturating_sub(WORK_PROJECT + WORK_COMPARE * rings.len() as i32);
            if let Some((at, diameter)) = shown(circle, &pose, view) {
                expected += 1;
                if let Some(ring) = nearest(rings, at, diameter) {
                    all.add(view, number, rings, ring);
                }
            }
        }
        all.drop_beyond(view, &pose, GATE_PX[0]);
        // Mostly every ring is in a group: then this is the fit of the groups.
        let is_known = all.pairs == seen.pairs;
        let fit = if is_known { Some(of_groups) } else { all.refine(view, &pose, work) };
        let Some((mut pose, mut residual_px)) = fit else { return };
        if all.drop_beyond(view, &pose, GATE_PX[1]) {
            let Some(last) = all.refine(view, &pose, work) else { return };
            (pose, residual_px) = last;
        }
        if residual_px > RESIDUAL_PX {
            return;
        }
        (self.pose, self.residual_px, self.expected) = (pose, residual_px, expected);
        self.found = all.pairs.len() as u32;
        let mut on_target = [0u32; 256];
        for (circle, ring) in &all.pairs {
            if let (Some(into), Some(of)) = (self.rings.get_mut(*circle), view.circles.get(*circle)) {
                *into = *ring as u8;
                on_target[usize::from(of.target)] += 1;
            }
        }
        self.targets = on_target.iter().filter(|count| **count >= ON_TARGET).count() as u32;
        self.aside = self.found - on_target.iter().max().unwrap_or(&0);
    }
}

/// Circles with their rings, and as the solver takes them.
#[derive(Default)]
struct Seen {
    pairs: Vec<(usize, usize), MAX_CIRCLES>,
    observations: Vec<Observation, MAX_CIRCLES>,
}

impl Seen {
    fn add(&mut self, view: &View<'_>, circle: usize, rings: &[Sighting], ring: usize) {
        let (Some(of), Some(seen)) = (view.circles.get(circle), rings.get(ring)) else { return };
        // A circle comes once: there is room for all.
        if self.pairs.push((circle, ring)).is_ok() {
            let _ = self.observations.push(Observation { point: of.point, centre: centre(seen) });
        }
    }

    /// Leaves out what lies further than `px` from where it must show, and says whether anything did.
    fn drop_beyond(&mut self, view: &View<'_>, pose: &Pose, px: f64) -> bool {
        let all = core::mem::take(self);
        let before = all.pairs.len();
        for (pair, observation) in all.pairs.into_iter().zip(all.observations) {
            let Ok(at) = view.lens.project(&pose.transform(&observation.point)) else { continue };
            let [u, v] = observation.centre.at;
            if libm::hypot(u - at[0], v - at[1]) < px {
                // As many as there were, at most.
                let _ = self.pairs.push(pair);
                let _ = self.observations.push(observation);
            }
        }
        self.pairs.len() < before
    }

    /// The pose of all of them next to this one, and its residual, px.
    fn refine(&self, view: &View<'_>, pose: &Pose, work: &mut i32) -> Option<(Pose, f64)> {
        let settings = Settings::default();
        let problem = Problem::new(&self.observations, view.lens, &settings).ok()?;
        let fit = refined(&problem, pose, work)?;
        Some((fit.pose, residual_px(&problem, &fit)))
    }
}

/// The poses that a group gives, one for each target that it could be, and what of the other groups fits to
/// each.
pub(crate) fn from_group(
    layout: &Layout,
    view: &View<'_>,
    rings: &[Sighting],
    groups: &[Group],
    number: usize,
    rivals: &mut Rivals,
    work: &mut i32,
) {
    let Some(group) = groups.get(number) else { return };
    let Some(kind) = layout.plates.get(group.kind) else { return };
    let observations: Vec<Observation, MAX_CIRCLES> = group
        .pairs()
        .filter_map(|(c, r)| Some(Observation { point: kind.flat(c)?, centre: centre(rings.get(r)?) }))
        .collect();
    *work = work.saturating_sub(WORK_OF_PLANE[0] + WORK_OF_PLANE[1] * observations.len() as i32);
    let Some((first, second)) = poses_of_plane(&observations, view, work) else { return };
    for flat in core::iter::once(first).chain(second) {
        for (place, plate) in layout.plates.iter().enumerate().filter(|(_, plate)| plate.kind == group.kind) {
            let rotation = flat.rotation * plate.axes.transpose();
            let pose = Pose { rotation, translation: flat.translation - rotation * plate.origin };
            let mut hypothesis = Hypothesis {
                pose,
                groups: [NONE; MAX_PLATES],
                origin: number,
                score: group.count,
                rings: [NONE; MAX_CIRCLES],
                found: 0,
                expected: 0,
                targets: 0,
                aside: 0,
                residual_px: f64::INFINITY,
            };
            hypothesis.groups[place] = number as u8;
            for (other, plate) in layout.plates.iter().enumerate().filter(|(other, _)| *other != place) {
                if let Some(fits) = fitting(plate, &hypothesis, view, rings, groups, work) {
                    hypothesis.groups[other] = fits as u8;
                    hypothesis.score += groups.get(fits).map_or(0, |group| group.count);
                }
            }
            rivals.keep(hypothesis);
        }
    }
}

/// The group that a plate shows as, by a pose that is coarse.
fn fitting(
    plate: &Plate,
    hypothesis: &Hypothesis,
    view: &View<'_>,
    rings: &[Sighting],
    groups: &[Group],
    work: &mut i32,
) -> Option<usize> {
    let circles = view.circles.get(plate.first..plate.first + plate.pattern.len())?;
    let mut at = Vec::<[f64; 2], MAX_RINGS>::new();
    for circle in circles {
        let point = hypothesis.pose.transform(&circle.point);
        // A target partly out of sight is found circle by circle later.
        let _ = at.push(view.lens.project(&point).ok()?);
    }
    *work = work.saturating_sub(WORK_PROJECT / 4 * circles.len() as i32);
    let mut best = None;
    let first = at.first()?;
    let size = at.iter().map(|a| libm::hypot(a[0] - first[0], a[1] - first[1])).fold(0.0, f64::max);
    let mut least = REACH * size;
    for (number, group) in groups.iter().enumerate().filter(|(_, group)| group.kind == plate.kind) {
        *work = work.saturating_sub(WORK_COMPARE * 12);
        let shares = |other: &u8| groups.get(usize::from(*other)).is_some_and(|other| other.meets(group));
        if hypothesis.groups.iter().any(shares) {
            continue;
        }
        let offs = group.pairs().filter_map(|(c, r)| {
            let (at, ring) = (at.get(c)?, rings.get(r)?);
            Some(([ring.at[0] - at[0], ring.at[1] - at[1]], ring.diameter_px()))
        });
        let share = 1.0 / group.count as f64;
        let mean = offs.clone().fold([0.0; 2], |sum, (off, _)| [0, 1].map(|i| sum[i] + share * off[i]));
        let shift = libm::hypot(mean[0], mean[1]);
        // The whole target may be nearer or further than by this pose: that stretches the offsets a little.
        let together = |(off, diameter): ([f64; 2], f64)| {
            libm::hypot(off[0] - mean[0], off[1] - mean[1]) < TOGETHER * diameter
        };
        if shift < least && offs.clone().all(together) {
            (best, least) = (Some(number), shift);
        }
    }
    best
}

/// Where a circle shows in the picture as a whole, facing the camera, and how large.
fn shown(circle: &Circle, pose: &Pose, view: &View<'_>) -> Option<([f64; 2], f64)> {
    let point = pose.transform(&circle.point);
    if (pose.rotation * circle.normal).dot(&point) >= 0.0 {
        return None;
    }
    let projected = project_circle(circle, pose, view.lens).ok()?;
    let [uu, uv, vv] = projected.shape;
    let diameter = 4.0 * libm::sqrt(libm::sqrt((uu * vv - uv * uv).max(0.0)));
    let half = 0.5 * projected.diameter_px;
    let fits = |at: f64, size: u16| at >= half && at <= f64::from(size) - 1.0 - half;
    let inside = fits(projected.centre[0], view.picture.0) && fits(projected.centre[1], view.picture.1);
    inside.then_some((projected.centre, diameter))
}

fn nearest(rings: &[Sighting], at: [f64; 2], diameter: f64) -> Option<usize> {
    let (mut best, mut least) = (None, OFF * diameter * OFF * diameter);
    for (number, ring) in rings.iter().enumerate() {
        let (u, v) = (ring.at[0] - at[0], ring.at[1] - at[1]);
        if u * u + v * v < least {
            (best, least) = (Some(number), u * u + v * v);
        }
    }
    best.filter(|number| {
        rings.get(*number).is_some_and(|ring| {
            let share = ring.diameter_px() / diameter;
            share < SIZE && share * SIZE > 1.0
        })
    })
}

/// The pose of a flat pattern that fits it, and the one with its tilt mirrored, if that fits about as well.
fn poses_of_plane(
    observations: &[Observation],
    view: &View<'_>,
    work: &mut i32,
) -> Option<(Pose, Option<Pose>)> {
    let settings = Settings::default();
    let problem = Problem::new(observations, view.lens, &settings).ok()?;
    let start = homography(&problem, &problem.rays().ok()?).ok()?;
    let first = refined(&problem, &start, work)?;
    let second = refined(&problem, &mirrored(&problem.basis, &first.pose), work);
    let second = second.filter(|second| !is_same(&second.pose, &first.pose));
    let (first, second) = match second {
        Some(second) if second.chi2 < first.chi2 => (second, Some(first)),
        second => (first, second),
    };
    let second = second.filter(|second| second.chi2 < SECOND * SECOND * first.chi2);
    (residual_px(&problem, &first) <= RESIDUAL_PX).then(|| (first.pose, second.map(|second| second.pose)))
}

/// The pose of a problem's circles next to this one.
fn refined(problem: &Problem, start: &Pose, work: &mut i32) -> Option<Fit> {
    let fit = refine_within(problem, problem.all(), start, EVALUATIONS).ok();
    let (circles, evaluations) = (problem.rows.len() as i32, fit.map_or(1, |fit| fit.evaluations) as i32);
    let of_circles = circles * (WORK_CIRCLE[0] + evaluations * WORK_CIRCLE[1]);
    *work = work.saturating_sub(WORK_REFINE + evaluations * WORK_EVALUATION + of_circles);
    fit
}

/// Root mean square distance between the rings and where they should be, px.
fn residual_px(problem: &Problem, fit: &Fit) -> f64 {
    let px2: f64 = problem.rows.iter().map(|row| problem.error(row, &fit.pose).px2).sum();
    libm::sqrt(px2 / problem.rows.len() as f64)
}

fn centre(ring: &Sighting) -> Centre {
    Centre { at: ring.at, covariance: [SIGMA_PX * SIGMA_PX, 0.0, SIGMA_PX * SIGMA_PX] }
}

/// Whether two poses put the carbody in about the same place.
fn is_near(a: &Pose, b: &Pose) -> bool {
    let turn = (a.rotation - b.rotation).norm();
    let shift = (a.translation - b.translation).norm();
    turn < 0.05 && shift < 0.05 * a.translation.norm()
}

// Their numbers are bytes.
const _: () = assert!(MAX_RINGS < NONE as usize);
const _: () = assert!(MAX_GROUPS < NONE as usize);
