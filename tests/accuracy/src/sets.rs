//! The sets of circles that the proofs are about: the thesis' test rig (5.4) with its four 7-CCC, one of them
//! set back, and what is in one plane, seen by its 1080p camera of f = 18 mm.

use gangway_pose::{Lens, Pose, moved, rotation};
use nalgebra::{Matrix3, Vector3};

use crate::random::Random;

/// How the circles of a set lie.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// One target in four set back by 0.9 m.
    General,
    /// The same targets a hundredth of that deep: the case between plane and space.
    NearlyPlanar,
    /// All in one plane.
    Planar,
}

impl Kind {
    /// All kinds.
    pub const ALL: [Self; 3] = [Self::General, Self::NearlyPlanar, Self::Planar];

    /// As it stands in a table.
    pub fn name(self) -> &'static str {
        match self {
            Self::General => "general",
            Self::NearlyPlanar => "nearly planar",
            Self::Planar => "planar",
        }
    }
}

/// Circles on a carbody before a camera.
pub struct Set {
    /// The camera.
    pub lens: Lens,
    /// Centres of the circles in the carbody, mm.
    pub points: Vec<Vector3<f64>>,
    /// Target of each circle.
    pub targets: Vec<usize>,
    /// The pose at rest.
    pub rest: Pose,
}

/// u and v of a 7-CCC on A3, mm.
pub const SEVEN: [[f64; 2]; 7] =
    [[-85.0, 88.0], [85.0, 88.0], [0.0, 0.0], [-85.0, -88.0], [85.0, -88.0], [-170.0, 0.0], [170.0, 0.0]];

/// Carbody axes x forward, y left, z up as a camera that looks along x sees them, turned a little.
pub fn looking_forward(roll: f64, pitch: f64, yaw: f64) -> Matrix3<f64> {
    Matrix3::new(0.0, -1.0, 0.0, 0.0, 0.0, -1.0, 1.0, 0.0, 0.0) * rotation(roll, pitch, yaw)
}

/// 18 mm on a sensor 23.5 mm and 1920 px wide.
pub fn lens() -> Lens {
    Lens {
        focal: [1471.3, 1470.1],
        skew: 0.0,
        principal: [953.2, 546.8],
        distortion: [-0.071, 0.043, 0.0004, -0.0003, 0.0],
    }
}

impl Set {
    /// The first `circles` (4 to 28) of the rig, taken from its targets in turn.
    pub fn rig(kind: Kind, circles: usize) -> Self {
        let depth = match kind {
            Kind::General => 900.0,
            Kind::NearlyPlanar => 9.0,
            Kind::Planar => 0.0,
        };
        let origins = [
            Vector3::new(0.0, 620.0, 330.0),
            Vector3::new(0.0, -620.0, 330.0),
            Vector3::new(depth, 90.0, -250.0),
            Vector3::new(0.0, 0.0, 420.0),
        ];
        let in_turn = (0..SEVEN.len()).flat_map(|circle| (0..4).map(move |target| (target, circle)));
        let (targets, points) = in_turn
            .take(circles)
            .map(|(target, circle)| {
                // A target begins with another of its circles than the one before it.
                let [u, v] = SEVEN[(circle + 2 * target) % SEVEN.len()];
                (target, origins[target] + Vector3::new(0.0, -u, v))
            })
            .unzip();
        let rest = Pose {
            rotation: looking_forward(0.015, -0.036, 0.023),
            translation: Vector3::new(-126.5, -19.0, 4601.7),
        };
        Self { lens: lens(), points, targets, rest }
    }

    /// The thesis' test ride (5.5): one 5-CCC set back and two 7-CCC, at 1.65 m.
    pub fn ride() -> Self {
        let targets = [
            (Vector3::new(420.0, 0.0, 560.0), 5),
            (Vector3::new(0.0, 700.0, 60.0), 7),
            (Vector3::new(160.0, -700.0, 20.0), 7),
        ];
        let points = targets.iter().enumerate().flat_map(|(target, (origin, circles))| {
            let on_target = SEVEN.iter().take(*circles);
            on_target.map(move |[u, v]| (target, origin + Vector3::new(0.0, -0.7 * u, 0.7 * v)))
        });
        let (targets, points) = points.unzip();
        let rest = Pose {
            rotation: looking_forward(-0.017, 0.053, -0.035),
            translation: Vector3::new(61.0, 286.1, 1638.1),
        };
        Self { lens: lens(), points, targets, rest }
    }

    /// A pose anywhere in the usual range of a ride.
    pub fn any_pose(&self, random: &mut Random) -> Pose {
        let mm = [50.0, 300.0, 200.0].map(|most| random.within(most));
        let deg = [3.0, 3.0, 10.0].map(|most| random.within(most));
        moved(&self.rest, mm, deg)
    }

    /// Where a pose shows the circles, px.
    pub fn centres(&self, pose: &Pose) -> Vec<[f64; 2]> {
        let centre = |point| self.lens.project(&pose.transform(point)).expect("it is before the camera");
        self.points.iter().map(centre).collect()
    }
}

/// A pose a frame of fast motion away from another, as what a frame loop starts from.
pub fn a_frame_before(pose: &Pose, random: &mut Random) -> Pose {
    moved(pose, [0; 3].map(|_| random.within(12.0)), [0; 3].map(|_| random.within(0.25)))
}
