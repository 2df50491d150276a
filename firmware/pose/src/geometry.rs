//! The things that the solvers speak of: circles in the carbody, their centres in the picture, the pose.

use nalgebra::{Matrix3, Vector3};

use crate::motion::rotation;

/// A circle of a target, in the frame of the carbody that carries the target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Circle {
    /// Centre, mm.
    pub point: Vector3<f64>,
    /// Unit normal of the target's plane (its w axis), towards the camera.
    pub normal: Vector3<f64>,
    /// Diameter of the ring's outer edge, or of the bright disc of a lit target, mm.
    pub outer_mm: f64,
    /// Diameter of the ring's inner edge, mm; 0 of a disc.
    pub inner_mm: f64,
    /// Index of the target that it belongs to.
    pub target: u8,
}

/// Where a circle's centre was seen, with its covariance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Centre {
    /// u right, v down, px; the centre of the top-left pixel is (0, 0).
    pub at: [f64; 2],
    /// Covariance (uu, uv, vv), px^2.
    pub covariance: [f64; 3],
}

/// One circle as the solver takes it: where it is on the carbody and where it was seen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observation {
    /// The circle's centre in its carbody, mm.
    pub point: Vector3<f64>,
    /// Its projection as measured (of the centre, not of the disc's centroid).
    pub centre: Centre,
}

/// `[R | t]`: carbody coordinates to camera coordinates, `X_c = R X + t` (thesis 3.8, 3.10).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// R, orthonormal, determinant +1.
    pub rotation: Matrix3<f64>,
    /// t, mm.
    pub translation: Vector3<f64>,
}

impl Pose {
    /// A carbody one metre before the camera, axis for axis: for where a pose must be and none is known.
    pub const FACING: Self = Self {
        rotation: Matrix3::new(0.0, -1.0, 0.0, 0.0, 0.0, -1.0, 1.0, 0.0, 0.0),
        translation: Vector3::new(0.0, 0.0, 1000.0),
    };

    /// The carbody that a camera at `position` (mm, in the carbody) sees, turned by roll, pitch (positive
    /// looks down) and yaw (positive to the left), degrees, from looking along the carbody's x.
    pub fn of_camera(position: [f64; 3], turned_deg: [f64; 3]) -> Self {
        let [roll, pitch, yaw] = turned_deg.map(f64::to_radians);
        let turned = Self::FACING.rotation * rotation(roll, pitch, yaw).transpose();
        Self { rotation: turned, translation: -(turned * Vector3::from(position)) }
    }

    /// A carbody point in camera coordinates, mm.
    pub fn transform(&self, point: &Vector3<f64>) -> Vector3<f64> {
        self.rotation * point + self.translation
    }

    /// R as a unit quaternion w, x, y, z with w >= 0.
    pub fn quaternion(&self) -> [f64; 4] {
        let r = &self.rotation;
        // The four squares (times four); the largest is the divisor that loses no digits.
        let squares = [
            1.0 + r.m11 + r.m22 + r.m33,
            1.0 + r.m11 - r.m22 - r.m33,
            1.0 - r.m11 + r.m22 - r.m33,
            1.0 - r.m11 - r.m22 + r.m33,
        ];
        let [yz, zx, xy] = [r.m32 - r.m23, r.m13 - r.m31, r.m21 - r.m12];
        let [s_yz, s_zx, s_xy] = [r.m32 + r.m23, r.m13 + r.m31, r.m21 + r.m12];
        let largest = squares.iter().fold(0.0_f64, |m, s| m.max(*s));
        let q = if largest == squares[0] {
            [squares[0], yz, zx, xy]
        } else if largest == squares[1] {
            [yz, squares[1], s_xy, s_zx]
        } else if largest == squares[2] {
            [zx, s_xy, squares[2], s_yz]
        } else {
            [xy, s_zx, s_yz, squares[3]]
        };
        let norm = libm::sqrt(q.iter().map(|c| c * c).sum());
        let sign = if q[0] < 0.0 { -1.0 } else { 1.0 };
        q.map(|c| sign * c / norm)
    }

    /// The pose of a quaternion w, x, y, z (of any length but zero) and a translation in mm.
    pub fn from_quaternion(quaternion: [f64; 4], translation: Vector3<f64>) -> Self {
        let norm = libm::sqrt(quaternion.iter().map(|c| c * c).sum());
        let [w, x, y, z] = quaternion.map(|c| c / norm);
        let rotation = Matrix3::new(
            1.0 - 2.0 * (y * y + z * z),
            2.0 * (x * y - w * z),
            2.0 * (x * z + w * y),
            2.0 * (x * y + w * z),
            1.0 - 2.0 * (x * x + z * z),
            2.0 * (y * z - w * x),
            2.0 * (x * z - w * y),
            2.0 * (y * z + w * x),
            1.0 - 2.0 * (x * x + y * y),
        );
        Self { rotation, translation }
    }

    /// Whether every number is finite and R is a rotation to within 1e-3.
    pub(crate) fn is_rigid(&self) -> bool {
        let gram = self.rotation.transpose() * self.rotation;
        let off = (gram - Matrix3::identity()).abs().max();
        // NaN fails both comparisons.
        off < 1e-3 && self.rotation.determinant() > 0.0 && self.translation.iter().all(|c| c.is_finite())
    }

    /// This pose turned by the small rotation vector `w` (camera axes, radians) and moved by `v` (mm):
    /// `R' = Exp(w) R`, `t' = t + v`.
    pub(crate) fn perturbed(&self, v: [f64; 3], w: [f64; 3]) -> Self {
        // The quaternion (1, w/2), scaled to length one, agrees with Exp(w) to second order and needs no
        // sine.
        let step = Self::from_quaternion([1.0, 0.5 * w[0], 0.5 * w[1], 0.5 * w[2]], Vector3::zeros());
        Self {
            rotation: step.rotation * self.rotation,
            translation: self.translation + Vector3::new(v[0], v[1], v[2]),
        }
    }

    /// This pose moved by `v` (mm) and turned by the rotation vector `w` (radians), along the camera's axes,
    /// as a solution's covariance counts them: the inverse of [`Pose::difference`] to second order.
    pub fn moved_by(&self, v: [f64; 3], w: [f64; 3]) -> Self {
        self.perturbed(v, w)
    }

    /// R brought back to exact orthonormality after many products: one step of Newton's method for the
    /// polar decomposition.
    pub(crate) fn orthonormalised(&self) -> Self {
        let r = &self.rotation;
        let gram = r.transpose() * r;
        Self { rotation: r * (Matrix3::identity() * 1.5 - gram * 0.5), translation: self.translation }
    }
}

/// `[v]x`, the matrix of the cross product.
pub(crate) fn skew(v: &Vector3<f64>) -> Matrix3<f64> {
    Matrix3::new(0.0, -v.z, v.y, v.z, 0.0, -v.x, -v.y, v.x, 0.0)
}

/// Rotation vector of R (radians), the inverse of Exp.
pub(crate) fn rotation_vector(rotation: &Matrix3<f64>) -> Vector3<f64> {
    let [w, x, y, z] = Pose { rotation: *rotation, translation: Vector3::zeros() }.quaternion();
    let sine = libm::sqrt(x * x + y * y + z * z);
    let scale = if sine < 1e-9 { 2.0 } else { 2.0 * libm::atan2(sine, w) / sine };
    Vector3::new(scale * x, scale * y, scale * z)
}
