//! What the tracker is asked for and what it answers, one of each a circle (thesis 3.2.3).

use gangway_pose::Centre;

/// White around a ring that its window must show, diameters.
const WHITE: f64 = 0.25;
/// A window grows by no more than so many diameters.
const MOST_GROWTH: f64 = 1.5;

/// Where to look for a ring and what it should look like.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Search {
    /// Predicted centre, px.
    pub at: [f64; 2],
    /// Second central moments (uu, uv, vv) of the predicted filled outer disc, px^2. A disc of diameter `d`
    /// that is seen from the front has (d^2/16, 0, d^2/16).
    pub shape: [f64; 3],
    /// Outer to inner diameter, 1.3 to 4; infinite for a bright disc on dark, which has no inner edge.
    pub ratio: f64,
    /// How far from `at` the ring may be before it could be a neighbour, px: usually half the distance to the
    /// next circle.
    pub reach_px: f64,
    /// Index of the target that the circle belongs to: rings of a target move together.
    pub target: u8,
    /// Whether the prediction comes from a measured pose (true) or is a guess. Only confident searches vote
    /// on how far their target has moved.
    pub confident: bool,
    /// How far from `at` the ring is to be expected, px: where that is more than the window has room for, it
    /// grows.
    pub uncertain_px: f64,
    /// Centroid of the projected outer disc minus projected centre, px (thesis 3.2.4), as far as the caller
    /// knows it from the pose; the answer is without it. Zero where unknown.
    pub bias: [f64; 2],
}

impl Search {
    /// A search for a ring of `diameter_px` seen from the front, 2:1, without neighbours within two
    /// diameters.
    pub fn round(at: [f64; 2], diameter_px: f64) -> Self {
        let moment = diameter_px * diameter_px / 16.0;
        Self {
            at,
            shape: [moment, 0.0, moment],
            ratio: 2.0,
            reach_px: diameter_px,
            target: 0,
            confident: true,
            uncertain_px: 0.0,
            bias: [0.0; 2],
        }
    }

    /// The same for a bright disc on dark.
    pub fn disc(at: [f64; 2], diameter_px: f64) -> Self {
        Self { ratio: f64::INFINITY, ..Self::round(at, diameter_px) }
    }

    /// Whether it is a bright disc on dark, not a ring.
    pub fn is_disc(&self) -> bool {
        self.ratio == f64::INFINITY
    }

    /// Diameter of the circle that has the area of the predicted outer ellipse, px.
    pub fn diameter_px(&self) -> f64 {
        let [uu, uv, vv] = self.shape;
        4.0 * libm::sqrt(libm::sqrt((uu * vv - uv * uv).max(0.0)))
    }

    /// Side of its window, px: so many diameters, and as many pixels more either way as the ring may be off
    /// beyond what they have room for.
    pub fn side_px(&self, diameters: f64) -> f64 {
        let diameter = self.diameter_px();
        let room = (0.5 * (diameters - 1.0) - WHITE) * diameter;
        let growth = (2.0 * (self.uncertain_px - room)).max(0.0).min(MOST_GROWTH * diameter);
        libm::ceil(diameters * diameter + growth)
    }
}

/// A ring, or a bright disc, as it was measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ring {
    /// The circle's centre and its covariance from the pixels' own noise.
    pub centre: Centre,
    /// Diameter of the circle that has the area of the outer ellipse, px.
    pub diameter_px: f64,
    /// Level of the white around and inside the ring, or of the bright disc, share of full scale.
    pub white: f32,
    /// Level of the ring's black, or of the dark around the disc, share of full scale.
    pub black: f32,
    /// Standard deviation of the picture's noise at the ring, share of full scale.
    pub noise: f32,
    /// Width of the edges as the standard deviation of their blur, pixel area included, px.
    pub blur_px: f32,
}
