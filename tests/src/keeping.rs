//! What keeping and finding come to on one scene: poses where enough rings are free to see, wrong rings, the
//! time to be found again, errors beside their standard deviations, and the cost of a frame.

use gangway_scene::Scene;
use gangway_wire::{Pose, PoseFlags, Record};

use crate::{Keeping, Loop, Ride, used_rings};

/// Fewest rings free to see that must give a pose.
pub const ENOUGH: usize = 6;
/// Longest time to be found again, frames: half a second.
pub const FOUND_WITHIN: usize = 25;
/// A ring further off than this is another one, px: a quarter of the smallest ring.
const WRONG_PX: f64 = 5.0;
/// Half the largest ring of these scenes, with its blur, px.
const HALF_PX: f64 = 16.0;
/// The tracker's least contrast, 8 grey levels, with room for noise.
const CONTRAST: u8 = 14;
/// What is as bright as this is clipped: a ring that sun or lamp clips in part may be refused.
const CLIPPED: u8 = 250;

/// A frame that shows best what goes wrong in a scene, if anything does, or what is in the rings' way.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Worst {
    /// Seed of the scene.
    pub seed: u64,
    /// Number of the frame.
    pub frame: usize,
    /// Wrong rings, or windows without a ring; then whether a pose is missing, then the largest error in
    /// standard deviations.
    rank: (usize, bool, f64),
}

/// What a frame cost.
#[derive(Clone, Copy, Debug)]
pub struct Cost {
    /// Least processor time of some plays, us.
    pub us: f64,
    /// Counted work.
    pub work: u32,
    /// It has a pose, and so has the last one before it with enough rings free: nothing was searched for.
    pub tracks: bool,
}

/// What came of one scene. Frames with enough rings free have a pose or are `first`, `again` or `lost`.
#[derive(Clone, Debug, Default)]
pub struct Outcome {
    /// Frames in all.
    pub frames: usize,
    /// Frames with enough rings free ...
    pub enough: usize,
    /// ... and of these the ones with a pose.
    pub poses: usize,
    /// Frames with enough rings free before the first pose of all, in which nothing was known yet: all, and
    /// the most of a seed.
    pub first: [usize; 2],
    /// Frames with enough rings free again and no pose yet: all, and the most on end.
    pub again: [usize; 2],
    /// Frames with enough rings free and no pose, the last such frame having had one: all, and the most on
    /// end.
    pub lost: [usize; 2],
    /// Frames whose motion is marked: the camera may have moved, or reference targets are hidden.
    pub marked: usize,
    /// Wrong rings in poses.
    pub wrong: usize,
    /// Most frames on end with a pose in which one and the same ring was missing that was free and not
    /// clipped.
    pub ring_longest: usize,
    /// Largest error of an unmarked displacement, mm, with its standard deviation.
    pub off_mm: [f64; 2],
    /// Largest error of an unmarked rotation, degrees, with its standard deviation.
    pub off_deg: [f64; 2],
    /// Largest error in its own standard deviations.
    pub most_sigmas: f64,
    /// What each frame cost.
    pub costs: Vec<Cost>,
    /// The frame to look at ...
    pub worst: Worst,
    /// ... and the one with the most windows without a ring, of those with enough rings free if it has any.
    pub emptiest: Worst,
}

impl Outcome {
    /// Takes in another seed.
    pub fn add(&mut self, other: Self) {
        self.frames += other.frames;
        self.enough += other.enough;
        self.poses += other.poses;
        self.marked += other.marked;
        self.wrong += other.wrong;
        let counts =
            [(&mut self.first, other.first), (&mut self.again, other.again), (&mut self.lost, other.lost)];
        for ([all, most], [new, new_most]) in counts {
            *all += new;
            *most = new_most.max(*most);
        }
        self.ring_longest = self.ring_longest.max(other.ring_longest);
        for (most, new) in [(&mut self.off_mm, other.off_mm), (&mut self.off_deg, other.off_deg)] {
            if new[0] > most[0] {
                *most = new;
            }
        }
        self.most_sigmas = self.most_sigmas.max(other.most_sigmas);
        self.costs.extend(other.costs);
        if other.worst.rank > self.worst.rank {
            self.worst = other.worst;
        }
        if other.emptiest.rank > self.emptiest.rank {
            self.emptiest = other.emptiest;
        }
    }

    /// Processor time of the median frame of those that track, if there are any, and of the slowest frame of
    /// all, us.
    pub fn cost_us(&self) -> (Option<f64>, f64) {
        self.median_and_most(|cost| cost.us)
    }

    /// Greatest counted work of a frame over that of the median frame of those that track: the same in every
    /// run.
    pub fn most_work(&self) -> Option<f64> {
        let (median, most) = self.median_and_most(|cost| f64::from(cost.work));
        median.map(|median| most / median)
    }

    fn median_and_most(&self, of: impl Fn(&Cost) -> f64) -> (Option<f64>, f64) {
        let mut tracking: Vec<f64> = self.costs.iter().filter(|cost| cost.tracks).map(&of).collect();
        tracking.sort_by(f64::total_cmp);
        (tracking.get(tracking.len() / 2).copied(), self.costs.iter().map(of).fold(0.0, f64::max))
    }

    /// Most frames on end with enough rings free and no pose, after the first one.
    pub fn longest(&self) -> usize {
        self.again[1].max(self.lost[1])
    }

    /// Takes note of a frame with enough rings free, or without.
    fn note(&mut self, is_enough: bool, has_pose: bool, without: &mut Without) {
        if !is_enough {
            // Nothing in its windows, and rightly so.
            without.is_blocked |= !has_pose;
            without.frames = 0;
            return;
        }
        self.enough += 1;
        if has_pose {
            self.poses += 1;
            *without = Without::default();
            return;
        }
        without.frames += 1;
        let into = match without.is_blocked {
            _ if self.poses == 0 => &mut self.first,
            true => &mut self.again,
            false => &mut self.lost,
        };
        *into = [into[0] + 1, into[1].max(without.frames)];
    }

    /// Compares a motion with the truth.
    fn judge(&mut self, pose: &Pose, ride: &Ride, frame: usize) -> f64 {
        let Some(motion) = &pose.motion else { return 0.0 };
        if pose.flags.contains(PoseFlags::CAMERA_MOVED) || pose.flags.contains(PoseFlags::UNREFERENCED) {
            self.marked += 1;
            return 0.0;
        }
        let truth = &ride.truth[frame];
        let mut most = 0.0_f64;
        for axis in 0..6 {
            let (measured, truth, into) = if axis < 3 {
                (motion.displacement_mm[axis], truth.displacement_mm[axis], &mut self.off_mm)
            } else {
                (motion.rotation_deg[axis - 3], truth.rotation_deg[axis - 3], &mut self.off_deg)
            };
            let (off, sigma) = ((f64::from(measured) - truth).abs(), f64::from(motion.sigma[axis]));
            if off > into[0] {
                *into = [off, sigma];
            }
            most = most.max(off / sigma);
        }
        self.most_sigmas = self.most_sigmas.max(most);
        most
    }
}

/// Frames on end without a pose.
#[derive(Default)]
struct Without {
    /// With enough rings free.
    frames: usize,
    /// Too few were free in one of them.
    is_blocked: bool,
}

/// How often a ride is played: the least cost of each frame is what it takes, the rest is what else the
/// machine does.
const PLAYS: usize = 7;

/// Plays one seed of a scene.
pub fn play(keeping: &Keeping, seed: u64) -> Outcome {
    let scene = keeping.scene(seed);
    let mut ride = Ride::of(&scene);
    ride.settings.lamps = keeping.lamps;
    let mut frame_loop: Loop<'_> = ride.start();
    let mut outcome = Outcome { frames: ride.frames.len(), ..Outcome::default() };
    let mut without = Without::default();
    let mut was_kept = false;
    let mut missed = vec![0; ride.settings.circles.len()];
    let costs =
        (1..PLAYS).map(|_| costs(&ride)).reduce(|a, b| a.iter().zip(&b).map(|(a, b)| a.min(*b)).collect());
    for frame in 0..ride.frames.len() {
        let centres: Vec<Option<[f64; 2]>> = scene.centres(frame as u32).into_iter().flatten().collect();
        let sights = sights(&scene, &ride, frame, &centres);
        let (mut pose, mut wrong) = (None, 0);
        let mut used = vec![false; centres.len()];
        let start = thread_us();
        frame_loop.step_without_reading(frame, frame as u32);
        let cost = thread_us() - start;
        let work = frame_loop.engine.take_work();
        frame_loop.read(|_, _, record| match record {
            Record::Pose(measured) => pose = Some(*measured),
            Record::Markers(markers) => {
                for (circle, off) in used_rings(markers, &centres) {
                    used[circle] = true;
                    wrong += usize::from(off > WRONG_PX);
                }
            }
            _ => {}
        });
        outcome.wrong += wrong;
        let has_pose = pose.is_some_and(|pose| pose.markers > 0);
        let sigmas = pose.map_or(0.0, |pose| outcome.judge(&pose, &ride, frame));
        for ((missed, sight), used) in missed.iter_mut().zip(&sights).zip(&used) {
            *missed = if has_pose && *sight == Sight::Free && !used { *missed + 1 } else { 0 };
            outcome.ring_longest = outcome.ring_longest.max(*missed);
        }
        let is_enough = sights.iter().filter(|sight| **sight != Sight::Hidden).count() >= ENOUGH;
        outcome.note(is_enough, has_pose, &mut without);
        let us = costs.as_ref().map_or(cost, |costs| cost.min(costs[frame]));
        outcome.costs.push(Cost { us, work, tracks: has_pose && was_kept });
        was_kept = if is_enough { has_pose } else { was_kept };
        let missing = is_enough && !has_pose;
        // Before they are found first there is nothing to look at.
        let rank = (wrong, missing && outcome.poses > 0, sigmas);
        if rank >= outcome.worst.rank {
            outcome.worst = Worst { seed, frame, rank };
        }
        let empty = frame_loop.engine.looks().filter(|look| look.seen.is_err()).count();
        // With enough rings free it says more than any without.
        let rank = (if is_enough { 100 * empty } else { empty }, missing, sigmas);
        if outcome.poses > 0 && rank > outcome.emptiest.rank {
            outcome.emptiest = Worst { seed, frame, rank };
        }
    }
    outcome
}

/// What each frame of a ride costs, us.
fn costs(ride: &Ride) -> Vec<f64> {
    let mut frame_loop = ride.start();
    let step = |frame: usize| {
        let start = thread_us();
        frame_loop.step_without_reading(frame, frame as u32);
        let cost = thread_us() - start;
        frame_loop.read(|_, _, _| {});
        cost
    };
    (0..ride.frames.len()).map(step).collect()
}

/// Processor time of this thread, us: what others do on the machine is not in it.
fn thread_us() -> f64 {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    time.tv_sec as f64 * 1e6 + time.tv_nsec as f64 * 1e-3
}

/// How a ring shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Sight {
    /// Something covers it, or no light shows it.
    Hidden,
    /// Nothing covers it, but it is clipped.
    Clipped,
    /// Nothing is in its way.
    Free,
}

/// How the rings of the other carbody show; those of the own one count as hidden.
fn sights(scene: &Scene, ride: &Ride, frame: usize, centres: &[Option<[f64; 2]>]) -> Vec<Sight> {
    let (width, height) = (usize::from(ride.settings.picture.0), usize::from(ride.settings.picture.1));
    let sight = |at: &[f64; 2]| {
        let [u, v] = *at;
        let inside = u >= HALF_PX
            && v >= HALF_PX
            && u + HALF_PX < width as f64 - 1.0
            && v + HALF_PX < height as f64 - 1.0;
        if !inside || scene.is_covered(frame as u32, *at, HALF_PX) {
            return Sight::Hidden;
        }
        let (mut least, mut most) = (u8::MAX, 0);
        for y in (v - HALF_PX) as usize..=(v + HALF_PX) as usize {
            for x in (u - HALF_PX) as usize..=(u + HALF_PX) as usize {
                let sample = ride.frames[frame][y * width + x];
                (least, most) = (least.min(sample), most.max(sample));
            }
        }
        match most - least > CONTRAST {
            false => Sight::Hidden,
            true if most >= CLIPPED => Sight::Clipped,
            true => Sight::Free,
        }
    };
    let is_other = |circle: usize| ride.settings.own >> circle & 1 == 0;
    let circles = centres.iter().enumerate();
    let other = |(circle, at): (usize, &Option<[f64; 2]>)| at.filter(|_| is_other(circle));
    circles.map(|circle| other(circle).map_or(Sight::Hidden, |at| sight(&at))).collect()
}
