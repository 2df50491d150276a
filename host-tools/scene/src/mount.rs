//! How the camera leaves its place on its own carbody: knocked out of it at a time, or shaking about it. The
//! motion of the carbodies, which is the truth, knows nothing of that.

use crate::motion::{Motions, Term};
use crate::optics::{Pose, add, apply, multiply, rotation, scale, transpose};

/// What the camera does on its mount: x, y, z (mm) and roll, pitch, yaw (degrees) along the carbody's axes.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Mount {
    /// Contributions with the index of their degree of freedom.
    pub(crate) terms: Vec<(usize, Term)>,
}

impl Mount {
    /// Whether the camera ever moves.
    pub(crate) fn is_firm(&self) -> bool {
        self.terms.is_empty()
    }

    fn at(&self, t: f64) -> Motions {
        let mut sum = [0.0; 6];
        for (degree, term) in &self.terms {
            sum[*degree] += term.at(t);
        }
        sum
    }

    /// A pose as the camera sees it at a time, from the pose that it would see in its place; `rest` is that
    /// of its own carbody (or of one aligned with it).
    ///
    /// A point X of the carbody, from the camera's place, is seen at `B (X - shift)` turned back: `B T^T (X -
    /// shift)` with the camera turned by T about its own middle.
    pub(crate) fn seen(&self, pose: &Pose, rest: &Pose, t: f64) -> Pose {
        if self.is_firm() {
            return *pose;
        }
        let [x, y, z, roll, pitch, yaw] = self.at(t);
        let by_turn = multiply(&rest.rotation, &transpose(&rotation(roll, pitch, yaw)));
        let turned = multiply(&by_turn, &transpose(&rest.rotation));
        let shift = apply(&by_turn, &[x, y, z]);
        Pose {
            rotation: multiply(&turned, &pose.rotation),
            translation: add(&apply(&turned, &pose.translation), &scale(&shift, -1.0)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn step(degree: usize, size: f64) -> (usize, Term) {
        (degree, Term::Step { size, at: 1.0, rise: 0.0 })
    }

    #[test]
    fn a_camera_turned_to_the_left_sees_everything_further_right() {
        let rest = Pose::of_camera(&[-1000.0, 0.0, 0.0], 0.0, 0.0, 0.0);
        let mount = Mount { terms: vec![step(5, 1.0)] };
        let ahead = mount.seen(&rest, &rest, 2.0).transform(&[0.0; 3]);
        let angle = (ahead[0] / ahead[2]).atan().to_degrees();
        assert!((angle - 1.0).abs() < 1e-12, "{angle}");
        assert_eq!(mount.seen(&rest, &rest, 0.5), rest);
    }

    #[test]
    fn a_knocked_camera_stands_where_it_was_shifted_to_and_is_turned_about_its_middle() {
        let rest = Pose::of_camera(&[-1000.0, 40.0, 300.0], 2.0, 3.0, -1.0);
        let mount =
            Mount { terms: vec![step(0, 2.0), step(1, -3.0), step(2, 4.0), step(3, 0.3), step(4, 0.2)] };
        let seen = mount.seen(&rest, &rest, 2.0).transform(&[-998.0, 37.0, 304.0]);
        assert!(seen.iter().all(|c| c.abs() < 1e-9), "{seen:?}");
    }
}
