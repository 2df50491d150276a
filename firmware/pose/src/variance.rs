//! How much more centres scatter than the noise of their pixels says: a variance that all of them share (a
//! variance component, Foerstner 1979), learnt from the residuals of the frames before. Compression,
//! calibration and printing move a ring whatever its own noise is, so where they prevail the circles weigh
//! alike.

use crate::geometry::Centre;

/// Frames whose mean it is, in the end.
const FRAMES: f64 = 50.0;
/// Circles of a frame below which its residuals say too little.
const LEAST_CIRCLES: usize = 8;
/// A frame counts as at most this many times the mean so far: a jerk is no compression.
const MOST: f64 = 4.0;
/// Share of the pixels' own noise below which there is nothing to learn but chance.
const CHANCE: f64 = 0.2;

/// A variance that every centre has beside that of its pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct VarianceComponent {
    /// Means over the frames so far, px^2 a coordinate: what the pixels explain, and what they do not.
    explained: f64,
    unexplained: f64,
    frames: f64,
}

impl VarianceComponent {
    /// The variance beside that of the pixels, px^2 a coordinate; 0 where chance alone explains the
    /// residuals.
    pub fn px2(&self) -> f64 {
        if self.unexplained > CHANCE * self.explained { self.unexplained } else { 0.0 }
    }

    /// A centre with this variance in its covariance.
    pub fn with(&self, Centre { at, covariance: [uu, uv, vv] }: Centre) -> Centre {
        let more = self.px2();
        Centre { at, covariance: [uu + more, uv, vv + more] }
    }

    /// Takes a frame's root mean square residual, px, and the covariances (uu, uv, vv) that the pixels gave
    /// the circles used.
    pub fn learn(&mut self, residual_px: f64, covariances: impl Iterator<Item = [f64; 3]>) {
        let (mut circles, mut trace) = (0_usize, 0.0);
        for [uu, _, vv] in covariances {
            circles += 1;
            trace += uu + vv;
        }
        if circles < LEAST_CIRCLES {
            return;
        }
        let count = circles as f64;
        // The pose takes six of two numbers a circle.
        let scatter = residual_px * residual_px / (2.0 - 6.0 / count);
        let explained = trace / (2.0 * count);
        let is_finite = scatter.is_finite() && explained.is_finite();
        if !is_finite {
            return;
        }
        let before = self.explained + self.unexplained;
        let scatter = if self.frames > 0.0 { scatter.min(MOST * before.max(explained)) } else { scatter };
        self.frames = (self.frames + 1.0).min(FRAMES);
        self.explained += (explained - self.explained) / self.frames;
        self.unexplained += (scatter - explained - self.unexplained) / self.frames;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const COVARIANCE: [f64; 3] = [1e-4, 0.0, 1e-4];

    /// Learns frames of 14 circles that scatter by so much a coordinate, px^2.
    fn learnt(frames: usize, scatter: f64) -> VarianceComponent {
        let mut component = VarianceComponent::default();
        let residual = (scatter * (2.0 - 6.0 / 14.0)).sqrt();
        for _ in 0..frames {
            component.learn(residual, [COVARIANCE; 14].into_iter());
        }
        component
    }

    #[test]
    fn what_the_pixels_explain_adds_nothing() {
        let component = learnt(100, 1.1e-4);
        assert_eq!(component.px2(), 0.0);
        let centre = Centre { at: [1.0, 2.0], covariance: COVARIANCE };
        assert_eq!(component.with(centre), centre);
    }

    #[test]
    fn what_they_do_not_is_learnt_at_once_and_shared_by_all() {
        for frames in [1, 10, 100] {
            assert!((learnt(frames, 1e-3).px2() - 9e-4).abs() < 1e-9);
        }
        let centre = Centre { at: [1.0, 2.0], covariance: [1e-4, 2e-5, 3e-4] };
        let [uu, uv, vv] = learnt(1, 1e-3).with(centre).covariance;
        assert!((uu - 1e-3).abs() < 1e-9 && uv == 2e-5 && (vv - 1.2e-3).abs() < 1e-9);
    }

    #[test]
    fn a_jerk_is_soon_forgotten_and_few_circles_say_nothing() {
        let mut component = learnt(100, 1e-3);
        component.learn(1.0, [COVARIANCE; 14].into_iter());
        // At most four times the scatter so far, in a mean of fifty.
        assert!(component.px2() < 1e-3);
        let before = component;
        component.learn(1.0, [COVARIANCE; 7].into_iter());
        component.learn(f64::NAN, [COVARIANCE; 14].into_iter());
        assert_eq!(component, before);
    }
}
