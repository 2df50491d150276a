//! One planar target near the frontal view: is the right one of its two poses kept through a ride, and is
//! every frame marked in which it is not?

use gangway_pose::{
    PlaneHistory, Pose, RestPose, Settings, Solution, moved, relative_motion, rest_mean, solve, untangle,
};
use nalgebra::{Vector3, Vector6};
use rayon::prelude::*;

use crate::random::Random;
use crate::sets::{SEVEN, Set, lens, looking_forward};
use crate::statistics::{ONE_IN_10_000, error, squared};
use crate::table::Table;

/// Frames a second.
const RATE_HZ: f64 = 50.0;
/// Frames of the rest interval.
const REST: usize = 10;

/// What a ride came to, frames.
#[derive(Clone, Copy, Debug, Default)]
pub struct Outcome {
    /// Of the ride behind the rest interval.
    pub frames: u32,
    /// Marked as ambiguous by one picture alone.
    pub marked_alone: u32,
    /// Marked as ambiguous with the history.
    pub marked: u32,
    /// The other pose is the right one: by one picture alone, started from the pose of the frame before.
    pub flips_alone: u32,
    /// Of these not marked.
    pub unmarked_alone: u32,
    /// The other pose is the right one, with the history.
    pub flips: u32,
    /// Of these not marked.
    pub unmarked: u32,
    /// Motions beyond their stated uncertainty (one in 10,000) and not marked, neither the frame nor its rest
    /// pose.
    pub beyond: u32,
    /// Rest poses turned over and not marked: 0 or 1.
    pub rest_unmarked: u32,
    /// Rest poses marked: 0 or 1.
    pub rest_marked: u32,
}

/// One A3 7-CCC at 4.5 m.
pub fn seven() -> Set {
    let points: Vec<Vector3<f64>> = SEVEN.iter().map(|[u, v]| Vector3::new(0.0, -u, *v)).collect();
    let rest =
        Pose { rotation: looking_forward(0.0, 0.0, 0.0), translation: Vector3::new(20.0, -15.0, 4500.0) };
    Set { lens: lens(), targets: vec![0; points.len()], points, rest }
}

/// Rides for `frames`: at rest first, `tilt_deg` from the frontal view, then swaying with up to 4 degrees to
/// either side and 2 up and down.
pub fn run(sigma_px: f64, tilt_deg: f64, seed: u64, frames: usize) -> Outcome {
    let set = seven();
    let mut random = Random::new(seed);
    let settings = Settings::default();
    let phase: Vec<f64> = (0..5).map(|_| random.within(180.0)).collect();
    let direction = random.within(180.0).to_radians();
    let standing = [0.0, tilt_deg * direction.sin(), tilt_deg * direction.cos()];
    let rest_truth = moved(&set.rest, [0.0; 3], standing);
    let motion = |frame: usize| {
        let t = (frame.saturating_sub(REST)) as f64 / RATE_HZ;
        // The motion begins gently.
        let fade = (t / 0.5).min(1.0);
        let sine = |size: f64, hz: f64, phase: f64| {
            fade * size * ((360.0 * hz * t + phase).to_radians().sin() - phase.to_radians().sin())
        };
        (
            [0.0, sine(150.0, 0.4, phase[0]), sine(30.0, 1.3, phase[1])],
            [sine(1.0, 0.7, phase[2]), sine(1.0, 0.9, phase[3]), sine(2.0, 0.3, phase[4])],
        )
    };
    let mut outcome = Outcome::default();
    let mut with = Follower::default();
    let mut alone = Follower::default();
    let mut history = PlaneHistory::default();
    let mut resting: Vec<Solution> = Vec::new();
    let mut rest: Option<(RestPose, bool)> = None;
    for frame in 0..frames + REST {
        let (mm, deg) = motion(frame);
        let truth = moved(&rest_truth, mm, deg);
        let observations = random.observe(&set.points, &set.centres(&truth), sigma_px, 1.5);
        let solve = |prior: Option<Pose>| {
            solve(&observations, &set.lens, &settings, prior.as_ref()).expect("seven circles give a pose")
        };
        let expected = with.expected();
        let mut solution = solve(expected);
        let picture = solve(alone.expected());
        alone.follow(picture.pose);
        let marked = history.choose(&mut solution, &expected.unwrap_or(picture.pose));
        with.follow(solution.pose);
        if frame < REST {
            resting.push(solution);
            if resting.len() == REST {
                let marked = untangle(&mut resting);
                let mean = rest_mean(&resting).expect("ten poses have a mean");
                let as_solution = |pose| Solution { pose, ..resting[0] };
                let turned = is_flipped(&as_solution(mean.pose), &rest_truth, &mean.covariance);
                outcome.rest_marked = u32::from(marked);
                outcome.rest_unmarked = u32::from(turned && !marked);
                rest = Some((mean, marked));
            }
            continue;
        }
        outcome.frames += 1;
        let alone_marked = picture.alternative.is_some_and(|other| other.evidence < gangway_pose::DECISIVE);
        let alone_flipped = is_flipped(&picture, &truth, &picture.covariance);
        let flipped = is_flipped(&solution, &truth, &solution.covariance);
        outcome.marked_alone += u32::from(alone_marked);
        outcome.flips_alone += u32::from(alone_flipped);
        outcome.unmarked_alone += u32::from(alone_flipped && !alone_marked);
        outcome.marked += u32::from(marked);
        outcome.flips += u32::from(flipped);
        outcome.unmarked += u32::from(flipped && !marked);
        if let Some((rest, false)) = &rest
            && !marked
        {
            let measured = relative_motion(rest, &solution);
            let (d, r) = (measured.displacement_mm, measured.rotation_deg);
            let off = Vector6::from_fn(|i, _| if i < 3 { d[i] - mm[i] } else { r[i - 3] - deg[i - 3] });
            outcome.beyond += u32::from(squared(&off, &measured.covariance) > ONE_IN_10_000);
        }
    }
    outcome
}

/// Whether a pose is beyond its uncertainty and its mirror image is nearer to the truth.
fn is_flipped(solution: &Solution, truth: &Pose, covariance: &nalgebra::Matrix6<f64>) -> bool {
    let Some(other) = solution.alternative else { return false };
    let turn = |pose| error(pose, truth).fixed_rows::<3>(3).norm();
    squared(&error(&solution.pose, truth), covariance) > ONE_IN_10_000
        && turn(&other.pose) < turn(&solution.pose)
}

/// The pose that the last two carry on to.
#[derive(Default)]
struct Follower(Option<(Pose, Option<Pose>)>);

impl Follower {
    fn expected(&self) -> Option<Pose> {
        let (last, before) = self.0?;
        Some(before.map_or(last, |before| Pose {
            rotation: last.rotation * before.rotation.transpose() * last.rotation,
            translation: last.translation * 2.0 - before.translation,
        }))
    }

    fn follow(&mut self, pose: Pose) {
        self.0 = Some((pose, self.0.map(|(last, _)| last)));
    }
}

/// The table.
pub fn table(seeds: u64) -> Table {
    let mut table = Table::new(
        "One A3 7-CCC at 4.5 m, f = 18 mm, 1080p, 2000 frames at 50 Hz a seed, swaying about the frontal view; at rest\n\
         tilted as said. Flips: beyond the uncertainty, and the other pose is nearer. Alone: every picture by itself, from\n\
         the pose of the frame before; kept: with the history. Percent of frames, and counts of all seeds.",
        &[
            "tilt deg",
            "sigma px",
            "frames",
            "alone: marked %",
            "flips %",
            "unmarked",
            "kept: marked %",
            "flips %",
            "unmarked",
            "motions beyond",
            "rest marked",
            "rest wrong",
        ],
    );
    for tilt in [0.3, 1.0, 3.0] {
        for sigma_px in [0.005, 0.02, 0.05, 0.1, 0.3] {
            let outcomes: Vec<Outcome> =
                (0..seeds).into_par_iter().map(|seed| run(sigma_px, tilt, seed, 2000)).collect();
            let sum = |part: fn(&Outcome) -> u32| outcomes.iter().map(part).sum::<u32>();
            let frames = sum(|o| o.frames);
            let percent = |count: u32| format!("{:.2}", 100.0 * f64::from(count) / f64::from(frames));
            table.row(vec![
                tilt.to_string(),
                sigma_px.to_string(),
                frames.to_string(),
                percent(sum(|o| o.marked_alone)),
                percent(sum(|o| o.flips_alone)),
                sum(|o| o.unmarked_alone).to_string(),
                percent(sum(|o| o.marked)),
                percent(sum(|o| o.flips)),
                sum(|o| o.unmarked).to_string(),
                sum(|o| o.beyond).to_string(),
                sum(|o| o.rest_marked).to_string(),
                sum(|o| o.rest_unmarked).to_string(),
            ]);
        }
    }
    table
}
