//! The light on the scene: its level over time, its course over the picture, and what the lens loses in the
//! corners.

/// A level that falls for a while, as in a tunnel.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Fall {
    /// Seconds at which it begins to fall, and how long that takes.
    pub(crate) falls: [f64; 2],
    /// Seconds at which it begins to come back, and how long that takes.
    pub(crate) returns: [f64; 2],
    /// What is left of the light between.
    pub(crate) level: f64,
}

impl Fall {
    fn at(&self, t: f64) -> f64 {
        let passed = |[start, takes]: [f64; 2]| {
            if takes > 0.0 { ((t - start) / takes).clamp(0.0, 1.0) } else { f64::from(u8::from(t >= start)) }
        };
        1.0 - (1.0 - self.level) * (passed(self.falls) - passed(self.returns))
    }
}

/// Light of a whole scene; 1 makes a reflectance of 1 the full scale of the sensor.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Light {
    /// Level.
    pub(crate) level: f64,
    /// Points (seconds, factor), linear between and constant outside; may be empty.
    pub(crate) curve: Vec<[f64; 2]>,
    /// Falls.
    pub(crate) falls: Vec<Fall>,
    /// Flicker of what lights the scene: depth as a share of the mean, frequency in Hz, phase in radians.
    pub(crate) flicker: [f64; 3],
    /// Change from the left to the right edge and from the top to the bottom edge, share of the middle's.
    pub(crate) gradient: [f64; 2],
    /// Loss in the corners, share; grows with the square of the distance from the middle.
    pub(crate) vignetting: f64,
}

impl Light {
    /// Level in the middle of the picture at a time, seconds.
    pub(crate) fn at(&self, t: f64) -> f64 {
        self.falls.iter().fold(self.level * self.curve_at(t), |level, fall| level * fall.at(t))
    }

    /// Mean level there over an exposure, seconds: the flicker is averaged, the rest is that of the middle.
    pub(crate) fn over(&self, from: f64, to: f64) -> f64 {
        let [depth, hz, phase] = self.flicker;
        let angle = |t: f64| std::f64::consts::TAU * hz * t + phase;
        let (middle, half) = (0.5 * (from + to), 0.5 * (angle(to) - angle(from)));
        let left = if half > 1e-9 { half.sin() / half } else { 1.0 };
        self.at(middle) * (1.0 + depth * left * angle(middle).sin())
    }

    fn curve_at(&self, t: f64) -> f64 {
        let after = self.curve.partition_point(|point| point[0] <= t);
        match (after.checked_sub(1).and_then(|i| self.curve.get(i)), self.curve.get(after)) {
            (Some(a), Some(b)) => a[1] + (t - a[0]) / (b[0] - a[0]) * (b[1] - a[1]),
            (Some(only), None) | (None, Some(only)) => only[1],
            (None, None) => 1.0,
        }
    }

    /// Factor at a pixel of a picture of this size.
    pub(crate) fn across(&self, [u, v]: [f64; 2], [width, height]: [f64; 2]) -> f64 {
        let (x, y) = ((u + 0.5) / width - 0.5, (v + 0.5) / height - 0.5);
        // Distance from the middle in units of the middle's distance from a corner, squared.
        let corner =
            ((x * width).powi(2) + (y * height).powi(2)) / (0.25 * (width * width + height * height));
        let gradient = 1.0 + self.gradient[0] * x + self.gradient[1] * y;
        (gradient * (1.0 - self.vignetting * corner)).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn light() -> Light {
        Light {
            level: 0.8,
            curve: Vec::new(),
            falls: Vec::new(),
            flicker: [0.0; 3],
            gradient: [0.0; 2],
            vignetting: 0.0,
        }
    }

    #[test]
    fn a_fall_takes_its_time_and_comes_back() {
        let fall = Fall { falls: [1.0, 0.2], returns: [2.0, 0.4], level: 0.3 };
        let light = Light { falls: vec![fall], ..light() };
        assert!((light.at(0.9) - 0.8).abs() < 1e-12);
        assert!((light.at(1.1) - 0.8 * 0.65).abs() < 1e-12);
        assert!((light.at(1.5) - 0.8 * 0.3).abs() < 1e-12);
        assert!((light.at(2.2) - 0.8 * 0.65).abs() < 1e-12);
        assert!((light.at(9.0) - 0.8).abs() < 1e-12);
    }

    #[test]
    fn flicker_is_averaged_over_the_exposure() {
        let light = Light { flicker: [0.5, 100.0, 0.0], ..light() };
        // A quarter of a period in: the crest.
        assert!((light.over(0.0025, 0.0025) - 0.8 * 1.5).abs() < 1e-12);
        // A whole period.
        assert!((light.over(0.1, 0.11) - 0.8).abs() < 1e-9);
        // The half period with the crest: 2 / pi of the depth.
        assert!((light.over(0.0, 0.005) - 0.8 * (1.0 + 0.5 * 2.0 / std::f64::consts::PI)).abs() < 1e-9);
    }

    #[test]
    fn a_curve_is_linear_between_its_points_and_constant_outside() {
        let light = Light { curve: vec![[1.0, 1.0], [2.0, 0.5]], ..light() };
        assert_eq!(light.at(0.0), 0.8);
        assert!((light.at(1.5) - 0.6).abs() < 1e-12);
        assert_eq!(light.at(5.0), 0.4);
    }

    #[test]
    fn the_corners_lose_the_vignetting_and_the_edges_the_gradient() {
        let size = [100.0, 60.0];
        let light = Light { vignetting: 0.2, ..light() };
        assert!((light.across([49.5, 29.5], size) - 1.0).abs() < 1e-12);
        assert!((light.across([-0.5, -0.5], size) - 0.8).abs() < 1e-12);
        let light = Light { gradient: [0.4, -0.2], vignetting: 0.0, ..light };
        assert!((light.across([99.5, 29.5], size) - 1.2).abs() < 1e-12);
        assert!((light.across([49.5, 59.5], size) - 0.9).abs() < 1e-12);
    }
}
