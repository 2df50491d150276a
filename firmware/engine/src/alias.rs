//! Equal circles on a lattice: a jump by most of their spacing looks like a small jump the other way, and the rings
//! that have a neighbour there agree on it. What gives it away is that the others are missing; so when too many
//! are, the pose moved by a spacing is tried as well, and the one that finds more rings is taken.

use gangway_pose::{Circle, Pose};
use heapless::Vec;
use nalgebra::Vector3;

/// Most spacings that are tried: a 7-CCC has four diagonal and four straight ones to either side.
pub(crate) const MAX_SPACINGS: usize = 12;
/// A spacing away may stand another wrong pose, with more rings: from there it is tried once more.
pub(crate) const ROUNDS: usize = 2;
/// Spacings that differ by less than this share of their length are one: targets are turned against each other.
const SAME: f64 = 0.4;
/// A pose is beyond doubt when this share of the circles in the picture went into it. Moved by a spacing, a 7-CCC
/// still has four of its rings on others, a 5-CCC two.
const TRUSTED: (u32, u32) = (7, 10);
/// While it stays in doubt it is tried again after so many frames: somebody may just stand in the gangway.
const PATIENCE: u32 = 10;

/// Differences between circles of one target in the carbody, mm, the shortest first.
pub(crate) type Spacings = Vec<Vector3<f64>, MAX_SPACINGS>;

/// The spacings at which one ring can be taken for another.
pub(crate) fn spacings(circles: &[Circle]) -> Spacings {
    let mut spacings = Spacings::new();
    while !spacings.is_full() {
        let pairs = circles.iter().flat_map(|a| circles.iter().map(move |b| (a, b)));
        let new = pairs
            .filter(|(a, b)| a.target == b.target && a.point != b.point)
            .map(|(a, b)| b.point - a.point)
            .filter(|v| !spacings.iter().any(|known: &Vector3<f64>| (v - known).norm() < SAME * v.norm()));
        let Some(shortest) = new.min_by(|a, b| a.norm().total_cmp(&b.norm())) else { break };
        // There is room: the loop ends when there is none.
        let _ = spacings.push(shortest);
    }
    spacings
}

/// The pose of a carbody that is `spacing` further than in `pose`.
pub(crate) fn shifted(pose: &Pose, spacing: &Vector3<f64>) -> Pose {
    Pose { rotation: pose.rotation, translation: pose.translation + pose.rotation * spacing }
}

/// Remembers when a pose in doubt was last tried against its neighbours.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Doubt {
    tried: Option<u32>,
}

impl Doubt {
    /// Whether a pose in `frame` is to be tried: `used` of the circles that should be in the picture went into it.
    pub(crate) fn arises(&mut self, frame: u32, used: u32, in_picture: u32) -> bool {
        let waits = self.tried.is_some_and(|tried| frame.wrapping_sub(tried) < PATIENCE);
        if waits || is_trusted(used, in_picture) {
            return false;
        }
        self.tried = Some(frame);
        true
    }
}

/// Whether enough of the circles in the picture went into a pose.
pub(crate) fn is_trusted(used: u32, in_picture: u32) -> bool {
    used * TRUSTED.1 >= in_picture * TRUSTED.0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn die(target: u8) -> impl Iterator<Item = Circle> {
        [(-60.0, 62.0), (60.0, 62.0), (0.0, 0.0), (-60.0, -62.0), (60.0, -62.0)].into_iter().map(
            move |(y, z)| Circle {
                point: Vector3::new(0.0, y, z),
                normal: Vector3::new(-1.0, 0.0, 0.0),
                outer_mm: 42.0,
                inner_mm: 21.0,
                target,
            },
        )
    }

    #[test]
    fn a_die_has_four_diagonal_and_four_straight_spacings_and_the_long_diagonals() {
        let circles: Vec<Circle, 8> = die(0).collect();
        let lengths: Vec<f64, 12> = spacings(&circles).iter().map(|v| v.norm()).collect();
        let (diagonal, long) = (libm::hypot(60.0, 62.0), libm::hypot(120.0, 124.0));
        let expected = [[diagonal; 4], [120.0, 120.0, 124.0, 124.0], [long; 4]].concat();
        assert!(lengths.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-9), "{lengths:?}");
        assert_eq!(lengths.len(), 12);
    }

    #[test]
    fn a_second_target_of_the_same_kind_adds_nothing() {
        let one: Vec<Circle, 16> = die(0).collect();
        let two: Vec<Circle, 16> = die(0).chain(die(1)).collect();
        assert_eq!(spacings(&one), spacings(&two));
    }

    #[test]
    fn targets_turned_against_each_other_share_their_spacings() {
        let turned = die(1).map(|circle| {
            let (sin, cos) = (libm::sin(0.3), libm::cos(0.3));
            let (y, z) = (circle.point.y, circle.point.z);
            Circle { point: Vector3::new(-sin * y, cos * y, z), ..circle }
        });
        let both: Vec<Circle, 16> = die(0).chain(turned).collect();
        let straight = spacings(&both).iter().filter(|v| v.y.abs() < 1.0 && v.z.abs() > 100.0).count();
        assert_eq!((spacings(&both).len(), straight), (12, 2), "{:?}", spacings(&both));
    }

    #[test]
    fn doubt_is_tried_at_once_and_then_every_ten_frames() {
        let mut doubt = Doubt::default();
        let tried: Vec<u32, 32> = (0..25).filter(|frame| doubt.arises(*frame, 6, 19)).collect();
        assert_eq!(tried.as_slice(), [0, 10, 20]);
        assert!(!doubt.arises(35, 14, 19), "14 of 19 are enough");
    }
}
