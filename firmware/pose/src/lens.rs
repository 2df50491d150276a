//! The camera model of thesis 3.3.1 and 4.2.3: K and the five distortion coefficients.

/// K and distortion, in the order and direction of OpenCV and the Caltech toolbox: the polynomial takes the
/// ideal normalised point to the distorted one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lens {
    /// Focal lengths, px.
    pub focal: [f64; 2],
    /// Skew, px.
    pub skew: f64,
    /// Principal point, px.
    pub principal: [f64; 2],
    /// k1, k2, p1, p2, k3.
    pub distortion: [f64; 5],
}

/// Why a point has no place in the picture, or a pixel no ray.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LensError {
    /// The point lies in or behind the plane of the camera.
    Behind,
    /// The distortion polynomial is not invertible there.
    NotInvertible,
    /// A coordinate is not a finite number.
    NotFinite,
}
