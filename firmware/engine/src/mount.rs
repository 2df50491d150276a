//! The camera on its own carbody, as the reference targets there show it: where it stands, whether it was
//! knocked out of that place, how much it shakes. Nothing of that is in the measured motion; here it becomes
//! events.

use gangway_pose::{Pose, Solution};
use gangway_wire::{MoveEvidence, What};
use nalgebra::{Matrix6, Vector3, Vector6};

/// Frames whose mean is the camera's place, at start and after a knock.
const PLACE_FRAMES: u32 = 10;
/// A camera that left its place by more than one of these was knocked, mm and degrees ...
const KNOCK: [f64; 2] = [0.3, 0.05];
/// ... if that is beyond noise: chi squared of six numbers, exceeded by chance once in 10^10 frames.
const SIGNIFICANT: f64 = 60.0;
/// Frames that must agree, to this share of the way from the place, on where a knocked camera stands: a
/// shaking one does not stay.
const AGREEING: usize = 3;
const AGREEMENT: f64 = 1.0 / 3.0;
/// Shaking is told from here on, mm and degrees root mean square ...
const SHAKE: [f64; 2] = [0.1, 0.02];
/// ... again when it has changed by this factor.
const SHAKE_STEP: f64 = 2.0;
/// Half a second of frames is the mean that tells a knock from a shake, a whole one that of the shake.
const SHORTEST_BLOCK: u32 = 8;

type Move = Vector6<f64>;

/// Sums over a block of frames.
#[derive(Clone, Copy)]
struct Block {
    count: u32,
    sum: Move,
    squares: Matrix6<f64>,
    noise: Matrix6<f64>,
}

impl Block {
    fn empty() -> Self {
        Self { count: 0, sum: Move::zeros(), squares: Matrix6::zeros(), noise: Matrix6::zeros() }
    }

    fn add(&mut self, by: &Move, noise: &Matrix6<f64>) {
        self.count += 1;
        self.sum += by;
        self.squares += by * by.transpose();
        self.noise += noise;
    }

    fn share(&self) -> f64 {
        1.0 / f64::from(self.count.max(1))
    }

    fn mean(&self) -> Move {
        self.sum * self.share()
    }

    /// Covariance of the frames about their mean.
    fn scatter(&self) -> Matrix6<f64> {
        let mean = self.mean();
        self.squares * self.share() - mean * mean.transpose()
    }
}

/// What is known of the camera's place.
pub(crate) struct Mount {
    /// Frames of a block.
    block_frames: u32,
    /// CB_01 in the camera when it was seen first in this place; the moves are counted from here.
    origin: Option<Pose>,
    /// The mean of its first frames, and the covariance of that.
    place: Option<(Move, Matrix6<f64>)>,
    block: Block,
    /// Scatter of the last full block.
    scatter: Matrix6<f64>,
    recent: [Move; AGREEING],
    seen: u32,
    /// What was told of its shaking, in parts of `SHAKE`.
    told: f64,
}

impl Mount {
    pub(crate) fn new(rate_hz: f64) -> Self {
        Self {
            block_frames: (libm::ceil(0.5 * rate_hz) as u32).max(SHORTEST_BLOCK),
            origin: None,
            place: None,
            block: Block::empty(),
            scatter: Matrix6::zeros(),
            recent: [Move::zeros(); AGREEING],
            seen: 0,
            told: 0.0,
        }
    }

    /// Takes CB_01 as this frame shows it; gives what is to be told: a knock, and a change of the shaking.
    pub(crate) fn update(&mut self, own: &Solution) -> [Option<What<'static>>; 2] {
        let origin = *self.origin.get_or_insert(own.pose);
        let by = Move::from(own.pose.difference(&origin));
        self.recent.rotate_right(1);
        self.recent[0] = by;
        self.seen = self.seen.saturating_add(1);
        self.block.add(&by, &own.covariance);
        let Some((place, uncertain)) = self.place else {
            if self.seen >= PLACE_FRAMES {
                let noise = (self.block.noise + self.block.scatter() * f64::from(self.block.count))
                    * self.block.share();
                self.place = Some((self.block.mean(), noise * self.block.share()));
            }
            return [None, None];
        };
        let covariance = own.covariance + uncertain;
        let mut knocked = None;
        let off = by - place;
        if self.has_settled(&off, &origin) && is_significant(&off, &covariance) {
            knocked = Some(off);
        }
        let mut shaking = None;
        if self.block.count >= self.block_frames {
            let mean = self.block.mean() - place;
            self.scatter = self.block.scatter();
            let noise = self.block.noise * self.block.share();
            let rms = sizes_of(&(self.scatter - noise), &origin);
            let level = in_parts(rms, SHAKE);
            // A share of an oscillation is left in the mean of a block.
            let rest = 0.5 * in_parts(rms, KNOCK);
            let uncertain = uncertain + (self.scatter + noise) * self.block.share();
            if in_parts(sizes(&mean, &origin), KNOCK) > 1.0_f64.max(rest) && is_significant(&mean, &uncertain)
            {
                knocked = knocked.or(Some(mean));
            } else {
                shaking = self.tell_shaking(level, rms);
            }
            self.block = Block::empty();
        }
        let knocked = knocked.map(|off| {
            let [shift_mm, turn_deg] = sizes(&off, &origin).map(|size| size as f32);
            self.settle_anew(own);
            What::CameraMoved { evidence: MoveEvidence::References, shift_mm, turn_deg }
        });
        [knocked, shaking]
    }

    /// CB_01 where it was seen before, for a frame that does not show it; how far the camera shakes is in its
    /// covariance.
    pub(crate) fn remembered(&self) -> Option<Solution> {
        let origin = self.origin?;
        let (place, uncertain) = self.place.unwrap_or((self.block.mean(), Matrix6::zeros()));
        let [vx, vy, vz, wx, wy, wz] = place.into();
        let alone = if self.block.count > 1 { self.block.scatter() } else { Matrix6::zeros() };
        let scatter = if self.scatter.trace() > alone.trace() { self.scatter } else { alone };
        Some(Solution {
            pose: origin.moved_by([vx, vy, vz], [wx, wy, wz]),
            covariance: uncertain + scatter + Matrix6::identity() * 1e-12,
            residual_px: 0.0,
            used: 0,
            alternative: None,
        })
    }

    /// Begins with a new place.
    fn settle_anew(&mut self, own: &Solution) {
        let (block_frames, told, scatter) = (self.block_frames, self.told, self.scatter);
        *self = Self::new(0.0);
        (self.block_frames, self.told, self.scatter) = (block_frames, told, scatter);
        self.origin = Some(own.pose);
        self.seen = 1;
        self.block.add(&Move::zeros(), &own.covariance);
    }

    /// Whether the last frames agree on a place that is not this one.
    fn has_settled(&self, off: &Move, origin: &Pose) -> bool {
        let way = in_parts(sizes(off, origin), KNOCK);
        let agrees =
            |other: &Move| in_parts(sizes(&(self.recent[0] - other), origin), KNOCK) < AGREEMENT * way;
        way > 1.0 && self.seen as usize >= AGREEING && self.recent.iter().skip(1).all(agrees)
    }

    fn tell_shaking(&mut self, level: f64, [shift_mm, turn_deg]: [f64; 2]) -> Option<What<'static>> {
        let is_news = if self.told == 0.0 {
            level > 1.0
        } else {
            level > SHAKE_STEP * self.told || level * SHAKE_STEP < self.told
        };
        if !is_news {
            return None;
        }
        let over = level <= 1.0;
        self.told = if over { 0.0 } else { level };
        let [shift_mm, turn_deg] = if over { [0.0; 2] } else { [shift_mm as f32, turn_deg as f32] };
        Some(What::CameraShaking { shift_mm, turn_deg })
    }
}

/// How far a move takes the camera itself on its carbody, mm, and how far it turns it, degrees: the camera
/// stands at `-Q^T s`, which a move (v, w) takes by `-Q^T (v + s x w)`.
fn sizes(by: &Move, origin: &Pose) -> [f64; 2] {
    let (v, w) = halves(by);
    [(v + origin.translation.cross(&w)).norm(), w.norm().to_degrees()]
}

/// The same for moves with this covariance, root mean square.
fn sizes_of(covariance: &Matrix6<f64>, origin: &Pose) -> [f64; 2] {
    let s = origin.translation;
    // Rows of v + s x w.
    let camera = [
        Move::new(1.0, 0.0, 0.0, 0.0, -s.z, s.y),
        Move::new(0.0, 1.0, 0.0, s.z, 0.0, -s.x),
        Move::new(0.0, 0.0, 1.0, -s.y, s.x, 0.0),
    ];
    let shift: f64 = camera.iter().map(|row| row.dot(&(covariance * row))).sum();
    let turn: f64 = (3..6).map(|i| covariance[(i, i)]).sum();
    [libm::sqrt(shift.max(0.0)), libm::sqrt(turn.max(0.0)).to_degrees()]
}

fn halves(by: &Move) -> (Vector3<f64>, Vector3<f64>) {
    (Vector3::new(by[0], by[1], by[2]), Vector3::new(by[3], by[4], by[5]))
}

/// The larger of two sizes, in parts of what counts.
fn in_parts([mm, deg]: [f64; 2], parts: [f64; 2]) -> f64 {
    (mm / parts[0]).max(deg / parts[1])
}

/// Whether a move is beyond what noise with this covariance makes.
pub(crate) fn is_significant(by: &Move, covariance: &Matrix6<f64>) -> bool {
    covariance.cholesky().is_some_and(|c| by.dot(&c.solve(by)) > SIGNIFICANT)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(position: [f64; 3], turned: [f64; 3]) -> Solution {
        // 0.05 mm and 0.003 degrees.
        let mut covariance = Matrix6::identity() * 0.0025;
        (3..6).for_each(|i| covariance[(i, i)] = 2.7e-9);
        let pose = Pose::of_camera([-900.0 + position[0], position[1], 250.0 + position[2]], turned);
        Solution { pose, covariance, residual_px: 0.02, used: 0b1111, alternative: None }
    }

    /// The events of frames in which the camera is where `place` says, with the numbers of the frames.
    fn told(frames: u32, place: impl Fn(u32) -> ([f64; 3], [f64; 3])) -> std::vec::Vec<(u32, What<'static>)> {
        let mut mount = Mount::new(50.0);
        let events = (0..frames).flat_map(|frame| {
            let (position, turned) = place(frame);
            let events = mount.update(&seen(position, turned));
            events.into_iter().flatten().map(move |what| (frame, what))
        });
        events.collect()
    }

    #[test]
    fn a_knock_is_told_once_three_frames_after_it_with_its_size() {
        let knock =
            |frame| if frame < 40 { ([0.0; 3], [0.0; 3]) } else { ([0.0, 1.2, -1.6], [0.0, 0.0, 0.3]) };
        let events = told(120, knock);
        let [(frame, What::CameraMoved { evidence, shift_mm, turn_deg })] = events[..] else {
            panic!("one event: {events:?}")
        };
        assert_eq!((frame, evidence), (42, MoveEvidence::References));
        assert!((shift_mm - 2.0).abs() < 1e-3 && (turn_deg - 0.3).abs() < 1e-4, "{shift_mm} {turn_deg}");
    }

    #[test]
    fn a_shake_is_told_as_such_and_that_it_is_over() {
        let shake = |frame: u32| {
            let sine = libm::sin(core::f64::consts::TAU * 15.0 * 0.02 * f64::from(frame));
            let on = if (30..130).contains(&frame) { sine } else { 0.0 };
            ([0.0, on, 0.0], [0.0, 0.0, 0.1 * on])
        };
        let events = told(250, shake);
        assert!(events.iter().all(|(_, what)| matches!(what, What::CameraShaking { .. })), "{events:?}");
        let What::CameraShaking { shift_mm, turn_deg } = events[0].1 else { return };
        // A sine of 1 mm; the first block may have begun before it.
        assert!(shift_mm > 0.3 && shift_mm < 0.75 && turn_deg > 0.03 && turn_deg < 0.075);
        let over = What::CameraShaking { shift_mm: 0.0, turn_deg: 0.0 };
        assert_eq!(events.last().map(|(_, what)| *what), Some(over));
    }

    #[test]
    fn a_knock_of_a_shaking_camera_is_told_as_well() {
        let place = |frame: u32| {
            let sine = libm::sin(core::f64::consts::TAU * 15.0 * 0.02 * f64::from(frame));
            let knock = if frame < 100 { 0.0 } else { 2.0 };
            ([0.0, sine, knock], [0.0, if frame < 100 { 0.0 } else { 0.3 }, 0.1 * sine])
        };
        let moved = told(250, place);
        let moved = moved.iter().filter(|(_, what)| matches!(what, What::CameraMoved { .. })).count();
        assert!((1..=2).contains(&moved), "{moved}");
    }

    #[test]
    fn a_place_that_is_not_seen_is_remembered_with_what_the_camera_shakes_about_it() {
        let mut mount = Mount::new(50.0);
        assert!(mount.remembered().is_none());
        for frame in 0..60u32 {
            let sine = libm::sin(core::f64::consts::TAU * 15.0 * 0.02 * f64::from(frame));
            mount.update(&seen([0.0, sine, 0.0], [0.0; 3]));
        }
        let remembered = mount.remembered().expect("it was seen");
        let [shift, _] = sizes_of(&remembered.covariance, &remembered.pose);
        assert!(shift > 0.6 && shift < 0.8, "{shift} mm of a sine of 1 mm");
        let off = remembered.pose.translation - seen([0.0; 3], [0.0; 3]).pose.translation;
        assert!(off.norm() < 0.1, "{off}");
    }
}
