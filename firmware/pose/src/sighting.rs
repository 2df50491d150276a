//! A ring that was found without knowing which one it is.

/// A ring somewhere in the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sighting {
    /// Its centre, px.
    pub at: [f64; 2],
    /// Second central moments (uu, uv, vv) of its filled outer disc, px^2.
    pub shape: [f64; 3],
    /// Outer to inner diameter, as far as blur lets it be seen.
    pub ratio: f64,
}

impl Sighting {
    /// Diameter of the circle that has the area of the outer ellipse, px.
    pub fn diameter_px(&self) -> f64 {
        let [uu, uv, vv] = self.shape;
        4.0 * libm::sqrt(libm::sqrt((uu * vv - uv * uv).max(0.0)))
    }
}
