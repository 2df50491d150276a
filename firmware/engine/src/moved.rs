//! Whether the camera may have moved on its carbody, where no reference targets tell. One camera and one
//! carbody before it cannot tell whose motion it is; but a step that no train can make from one frame to the
//! next is hardly the train's, and a train that stands should stand where it stood at rest.

use gangway_pose::{Pose, RestPose, Solution};
use gangway_wire::{MoveEvidence, What};
use nalgebra::{Matrix6, Vector6};

use crate::Limits;
use crate::mount::is_significant;

/// A step counts if it is beyond the limit by this many standard deviations of its noise.
const SIGMAS: f64 = 5.0;

/// A turn beyond this share of its limit is no train's everyday: the poses from it on are doubtful ...
const JOLT: f64 = 0.4;
/// ... for so long, ns. A shaking camera repeats it within that time.
const DOUBTFUL_NS: u64 = 500_000_000;

/// A pose with its frame's number and time.
#[derive(Clone, Copy)]
struct Past {
    frame: u32,
    time_ns: u64,
    pose: Pose,
    covariance: Matrix6<f64>,
}

/// The last poses, and whether the camera is suspected.
#[derive(Default)]
pub(crate) struct Suspicion {
    past: [Option<Past>; 2],
    moved: bool,
    /// When a frame of doubtful motion came last, ns.
    jolted_ns: Option<u64>,
}

impl Suspicion {
    /// Whether the pose of this time may have the camera's own motion in it.
    pub(crate) fn has_moved(&self, time_ns: u64) -> bool {
        self.moved || self.jolted_ns.is_some_and(|then| time_ns.saturating_sub(then) < DOUBTFUL_NS)
    }

    /// There is a new rest pose: what was before it is of no account.
    pub(crate) fn forget(&mut self) {
        *self = Self::default();
    }

    /// There is no pose, or none to be relied on: no step can be told across the gap.
    pub(crate) fn interrupt(&mut self) {
        self.past = [None; 2];
    }

    /// Takes the pose of the next frame, with the middle of the circles in the carbody; tells a step that no
    /// train can make. After a step the two next frames, whose speed still has it in it, are not judged. A
    /// lesser one that few trains make puts the poses after it into doubt.
    pub(crate) fn follow(
        &mut self,
        (frame, time_ns): (u32, u64),
        solution: &Solution,
        middle: &nalgebra::Vector3<f64>,
        limits: &Limits,
    ) -> Option<What<'static>> {
        let now = Past { frame, time_ns, pose: solution.pose, covariance: solution.covariance };
        let [last, before] = self.past;
        self.past = [Some(now), last];
        let (last, before) = (last?, before?);
        let follow = frame.wrapping_sub(last.frame) == 1 && last.frame.wrapping_sub(before.frame) == 1;
        let (step_ns, step_before_ns) =
            (time_ns.checked_sub(last.time_ns)?, last.time_ns.checked_sub(before.time_ns)?);
        if !follow || step_ns == 0 || step_before_ns == 0 {
            return None;
        }
        let second = Vector6::from(now.pose.difference(&last.pose))
            - Vector6::from(last.pose.difference(&before.pose)) * (step_ns as f64 / step_before_ns as f64);
        let turn = second.fixed_rows::<3>(3).norm();
        // The place of the circles, which does not depend on where the carbody's frame begins.
        let at = |past: &Past| past.pose.transform(middle);
        let shift = ((at(&now) - at(&last))
            - (at(&last) - at(&before)) * (step_ns as f64 / step_before_ns as f64))
            .norm();
        let noise = now.covariance + last.covariance * 4.0 + before.covariance;
        let lever = (at(&now) - now.pose.translation).norm();
        let [of_shift, of_turn] = [0, 3].map(|k| (0..3).map(|i| noise[(k + i, k + i)]).sum::<f64>());
        let of_shift = libm::sqrt(of_shift + lever * lever * of_turn);
        let square_s = step_ns as f64 * step_before_ns as f64 * 1e-18;
        let limit = [limits.shock_mm_s2 * square_s, limits.shock_deg_s2.to_radians() * square_s];
        let of_turn = SIGMAS * libm::sqrt(of_turn);
        if turn > JOLT * limit[1] + of_turn {
            self.jolted_ns = Some(time_ns);
        }
        let is_shock = shift > limit[0] + SIGMAS * of_shift || turn > limit[1] + of_turn;
        if !is_shock {
            return None;
        }
        self.moved = true;
        self.interrupt();
        let (shift_mm, turn_deg) = (shift as f32, turn.to_degrees() as f32);
        Some(What::CameraMoved { evidence: MoveEvidence::Shock, shift_mm, turn_deg })
    }

    /// The train stands with this pose: is it where it stood at rest? Tells a place that is not when that is
    /// news; the right place ends the suspicion.
    pub(crate) fn stands(
        &mut self,
        solution: &Solution,
        rest: &RestPose,
        limits: &Limits,
    ) -> Option<What<'static>> {
        let off = Vector6::from(solution.pose.difference(&rest.pose));
        let (shift, turn) = (off.fixed_rows::<3>(0).norm(), off.fixed_rows::<3>(3).norm().to_degrees());
        let elsewhere = shift > limits.standing_mm || turn > limits.standing_deg;
        let elsewhere = elsewhere && is_significant(&off, &(solution.covariance + rest.covariance));
        let was = core::mem::replace(&mut self.moved, elsewhere);
        let (shift_mm, turn_deg) = (shift as f32, turn as f32);
        (elsewhere && !was).then_some(What::CameraMoved {
            evidence: MoveEvidence::Standing,
            shift_mm,
            turn_deg,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gangway_pose::moved;
    use nalgebra::Vector3;

    fn at(displacement: [f64; 3], turned: [f64; 3]) -> Solution {
        let rest = Pose::of_camera([-1500.0, 0.0, 300.0], [0.0; 3]);
        let mut covariance = Matrix6::identity() * 1e-4;
        (3..6).for_each(|i| covariance[(i, i)] = 1e-9);
        let pose = moved(&rest, displacement, turned);
        Solution { pose, covariance, residual_px: 0.02, used: 0b1111, alternative: None }
    }

    fn shocks(frames: u32, place: impl Fn(f64) -> ([f64; 3], [f64; 3])) -> usize {
        let mut suspicion = Suspicion::default();
        let told = (0..frames).filter(|frame| {
            let (displacement, turned) = place(0.02 * f64::from(*frame));
            let time_ns = u64::from(*frame) * 20_000_000;
            let middle = Vector3::new(100.0, 0.0, 300.0);
            let solution = at(displacement, turned);
            suspicion.follow((*frame, time_ns), &solution, &middle, &Limits::default()).is_some()
        });
        let count = told.count();
        assert_eq!(suspicion.moved, count > 0);
        count
    }

    #[test]
    fn no_motion_of_a_train_is_a_shock_but_a_camera_turned_between_two_frames_is_one() {
        let sway = |t: f64| {
            let sine = |hz: f64| libm::sin(core::f64::consts::TAU * hz * t);
            (
                [0.0, 55.0 * sine(0.7) + 1.5 * sine(7.0), 20.0 * sine(1.9)],
                [0.5 * sine(1.3), 0.0, 2.2 * sine(0.7)],
            )
        };
        assert_eq!(shocks(300, sway), 0);
        let knocked = |t: f64| {
            let (mut displacement, mut turned) = sway(t);
            if t > 2.51 {
                displacement[1] += 7.0;
                turned[2] += 0.3;
            }
            (displacement, turned)
        };
        assert_eq!(shocks(300, knocked), 1);
    }

    #[test]
    fn a_turn_that_few_trains_make_is_doubtful_at_once_and_for_half_a_second_and_raises_no_event() {
        let mut suspicion = Suspicion::default();
        let mut doubtful = |frame: u32| {
            let (time_ns, turn) = (u64::from(frame) * 20_000_000, if frame < 20 { 0.0 } else { 0.14 });
            let middle = Vector3::new(100.0, 0.0, 300.0);
            let solution = at([0.0; 3], [0.0, 0.0, turn]);
            let shock = suspicion.follow((frame, time_ns), &solution, &middle, &Limits::default());
            assert!(shock.is_none(), "0.14 degrees could be a train");
            suspicion.has_moved(time_ns)
        };
        let told: std::vec::Vec<bool> = (0..100).map(&mut doubtful).collect();
        // The speed ends a frame after it began.
        assert!((0..100).all(|frame| told[frame] == (20..46).contains(&frame)), "{told:?}");
    }

    #[test]
    fn a_knock_of_2_mm_that_turns_nothing_looks_like_a_train() {
        assert_eq!(shocks(100, |t| ([0.0, if t > 1.0 { 2.0 } else { 0.0 }, 0.0], [0.0; 3])), 0);
    }

    #[test]
    fn a_train_that_stands_elsewhere_is_told_once_and_cleared_where_it_stood_at_rest() {
        let rest = at([0.0; 3], [0.0; 3]);
        let rest = RestPose::new(rest.pose, rest.covariance);
        let mut suspicion = Suspicion::default();
        let mut stands = |place: &Solution| {
            let told = suspicion.stands(place, &rest, &Limits::default()).is_some();
            (told, suspicion.has_moved(0))
        };
        assert_eq!(stands(&at([0.0, 4.0, 0.0], [0.0; 3])), (false, false), "what suspensions leave");
        assert_eq!(stands(&at([0.0, 7.0, 0.0], [0.0, 0.0, 0.3])), (true, true));
        assert_eq!(stands(&at([0.0, 7.0, 0.0], [0.0, 0.0, 0.3])), (false, true));
        assert_eq!(stands(&at([0.0, 0.2, 0.0], [0.0; 3])), (false, false));
    }
}
