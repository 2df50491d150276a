//! The things that the solvers speak of: circles in the carbody, their centres in the picture, the pose.

use nalgebra::{Matrix3, Vector3};

/// A circle of a target, in the frame of the carbody that carries the target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Circle {
    /// Centre, mm.
    pub point: Vector3<f64>,
    /// Unit normal of the target's plane (its w axis), towards the camera.
    pub normal: Vector3<f64>,
    /// Diameter of the ring's outer edge, mm.
    pub outer_mm: f64,
    /// Diameter of the ring's inner edge, mm.
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

/// `[R | t]`: carbody coordinates to camera coordinates, `X_c = R X + t` (thesis 3.8, 3.10).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// R, orthonormal, determinant +1.
    pub rotation: Matrix3<f64>,
    /// t, mm.
    pub translation: Vector3<f64>,
}

impl Pose {
    /// A carbody point in camera coordinates, mm.
    pub fn transform(&self, point: &Vector3<f64>) -> Vector3<f64> {
        self.rotation * point + self.translation
    }
}
