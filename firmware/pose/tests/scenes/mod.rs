//! The two geometries that the tests share: the thesis' test rig (5.4) and test ride (5.5), at rest.

use gangway_pose::{Centre, Lens, Observation, Pose, moved, rotation};
use nalgebra::{Matrix3, Vector3};

/// A camera, circles and the rest pose.
pub(crate) struct Scene {
    pub(crate) lens: Lens,
    pub(crate) points: Vec<Vector3<f64>>,
    pub(crate) rest: Pose,
}

/// 5-CCC of a target on the carbody's end wall: u to the left seen from inside, v up.
fn five(origin: [f64; 3], half_width: f64, half_height: f64) -> Vec<Vector3<f64>> {
    let o = Vector3::from(origin);
    [(-1.0, 1.0), (1.0, 1.0), (0.0, 0.0), (-1.0, -1.0), (1.0, -1.0)]
        .map(|(u, v)| o + Vector3::new(0.0, -u * half_width, v * half_height))
        .to_vec()
}

/// 7-CCC: the die and one more circle on either side.
fn seven(origin: [f64; 3], half_width: f64, half_height: f64) -> Vec<Vector3<f64>> {
    let mut points = five(origin, half_width, half_height);
    let o = Vector3::from(origin);
    points.extend([-2.0, 2.0].map(|u| o + Vector3::new(0.0, -u * half_width, 0.0)));
    points
}

fn lens() -> Lens {
    Lens {
        focal: [1471.3, 1470.1],
        skew: 0.0,
        principal: [953.2, 546.8],
        distortion: [-0.071, 0.043, 0.0004, -0.0003, 0.0],
    }
}

/// Carbody axes x forward, y left, z up as a camera that looks along x sees them, turned a little.
fn looking_forward(roll: f64, pitch: f64, yaw: f64) -> Matrix3<f64> {
    Matrix3::new(0.0, -1.0, 0.0, 0.0, 0.0, -1.0, 1.0, 0.0, 0.0) * rotation(roll, pitch, yaw)
}

/// Four A3 7-CCC at 4.6 m, one of them set back by 0.9 m.
pub(crate) fn rig() -> Scene {
    let mut points = seven([0.0, 0.0, 420.0], 85.0, 88.0);
    points.extend(seven([0.0, 620.0, 330.0], 85.0, 88.0));
    points.extend(seven([0.0, -620.0, 330.0], 85.0, 88.0));
    points.extend(seven([900.0, 90.0, -250.0], 85.0, 88.0));
    Scene {
        lens: lens(),
        points,
        rest: Pose {
            rotation: looking_forward(0.015, -0.036, 0.023),
            translation: Vector3::new(-126.5, -19.0, 4601.7),
        },
    }
}

/// The rig with the target at the back brought forward into the plane of the others: 28 circles in one plane.
#[allow(dead_code, reason = "not every test needs it")]
pub(crate) fn flat() -> Scene {
    let mut scene = rig();
    scene.points.iter_mut().for_each(|point| point.x = 0.0);
    scene
}

/// One 5-CCC and two 7-CCC at 1.65 m.
pub(crate) fn ride() -> Scene {
    let mut points = five([420.0, 0.0, 560.0], 60.0, 62.0);
    points.extend(seven([0.0, 700.0, 60.0], 60.0, 62.0));
    points.extend(seven([160.0, -700.0, 20.0], 60.0, 62.0));
    Scene {
        lens: lens(),
        points,
        rest: Pose {
            rotation: looking_forward(-0.017, 0.053, -0.035),
            translation: Vector3::new(61.0, 286.1, 1638.1),
        },
    }
}

impl Scene {
    /// The pose of a displacement (mm) and a rotation (degrees) from rest.
    pub(crate) fn pose(&self, displacement_mm: [f64; 3], rotation_deg: [f64; 3]) -> Pose {
        moved(&self.rest, displacement_mm, rotation_deg)
    }

    /// Exact centres of chosen circles at a pose, each with a covariance of `sigma_px` squared.
    pub(crate) fn observe(&self, chosen: &[usize], pose: &Pose, sigma_px: f64) -> Vec<Observation> {
        chosen
            .iter()
            .map(|i| {
                let point = self.points[*i];
                let at = self.lens.project(&pose.transform(&point)).expect("the circle is before the camera");
                Observation {
                    point,
                    centre: Centre { at, covariance: [sigma_px * sigma_px, 0.0, sigma_px * sigma_px] },
                }
            })
            .collect()
    }
}
