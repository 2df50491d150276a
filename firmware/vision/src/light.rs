//! The slope of the light over a target. Every ring tells it for itself; the rings of a target together tell
//! it better as far as they agree (the positive-part estimator of James and Stein), and their centres follow.

use gangway_pose::MAX_CIRCLES;

use crate::{Refusal, Ring, Search};

/// The slope of the light at a ring, and what it does to the ring's centre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Light {
    /// Slope of the white along u and v, share of the white a px.
    pub(crate) slope: [f64; 2],
    /// Its variance in either direction.
    pub(crate) variance: f64,
    /// The matrix (uu, uv, vv) by which the centre follows a slope that was thought too small by 1 (share a
    /// px), px.
    pub(crate) pull: [f64; 3],
    /// What the slope's variance adds to the centre's covariance, px^2.
    pub(crate) by_slope: [f64; 3],
}

impl Light {
    pub(crate) const NONE: Self = Self { slope: [0.0; 2], variance: 0.0, pull: [0.0; 3], by_slope: [0.0; 3] };
}

/// Fewest rings of a target that are worth a mean.
const FEWEST: usize = 4;

/// Moves the slopes of each target's rings towards their mean, and the centres with them.
pub(crate) fn share(searches: &[Search], rings: &mut [Result<Ring, Refusal>], lights: &[Light; MAX_CIRCLES]) {
    let mut done = [false; MAX_CIRCLES];
    for i in 0..searches.len().min(MAX_CIRCLES) {
        let Some(target) = searches.get(i).map(|search| search.target) else { return };
        if done[i] {
            continue;
        }
        let of_target = |k: usize, rings: &[Result<Ring, Refusal>]| {
            searches.get(k).is_some_and(|search| search.target == target)
                && rings.get(k).is_some_and(Result::is_ok)
                && lights[k].variance > 0.0
        };
        let (mut weights, mut sum, mut count) = (0.0, [0.0; 2], 0);
        for k in i..MAX_CIRCLES {
            done[k] |= searches.get(k).is_some_and(|search| search.target == target);
            if of_target(k, rings) {
                let weight = 1.0 / lights[k].variance;
                weights += weight;
                sum = [0, 1].map(|axis| sum[axis] + weight * lights[k].slope[axis]);
                count += 1;
            }
        }
        if count < FEWEST {
            continue;
        }
        let mean = sum.map(|sum| sum / weights);
        let mut scatter = 0.0;
        for k in (i..MAX_CIRCLES).filter(|k| of_target(*k, rings)) {
            let off = [0, 1].map(|axis| lights[k].slope[axis] - mean[axis]);
            scatter += (off[0] * off[0] + off[1] * off[1]) / lights[k].variance;
        }
        // Two numbers a ring, two spent on the mean; the estimator takes two more.
        let share = ((2 * count - 4) as f64 / scatter).min(1.0);
        let gain = share * (1.0 - 1.0 / count as f64);
        for k in i..MAX_CIRCLES {
            if !of_target(k, rings) {
                continue;
            }
            let light = &lights[k];
            let Some(Ok(ring)) = rings.get_mut(k) else { continue };
            let [u, v] = [0, 1].map(|axis| share * (mean[axis] - light.slope[axis]));
            let [uu, uv, vv] = light.pull;
            let at = ring.centre.at;
            ring.centre.at = [at[0] - (uu * u + uv * v), at[1] - (uv * u + vv * v)];
            for (entry, by_slope) in ring.centre.covariance.iter_mut().zip(light.by_slope) {
                *entry -= gain * by_slope;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gangway_pose::Centre;
    use std::vec::Vec;

    /// Rings at the origin whose slopes along u are these, with a variance of 1.
    fn shared(slopes: &[f64]) -> Vec<Ring> {
        let searches: Vec<Search> = slopes.iter().map(|_| Search::round([0.0; 2], 20.0)).collect();
        let ring = Ring {
            centre: Centre { at: [0.0; 2], covariance: [5.0, 0.0, 5.0] },
            diameter_px: 20.0,
            white: 0.8,
            black: 0.1,
            noise: 0.01,
            blur_px: 0.7,
        };
        let mut rings: Vec<Result<Ring, Refusal>> = slopes.iter().map(|_| Ok(ring)).collect();
        let mut lights = [Light::NONE; MAX_CIRCLES];
        for (light, slope) in lights.iter_mut().zip(slopes) {
            *light = Light {
                slope: [*slope, 0.0],
                variance: 1.0,
                pull: [2.0, 0.0, 2.0],
                by_slope: [4.0, 0.0, 4.0],
            };
        }
        share(&searches, &mut rings, &lights);
        rings.into_iter().map(Result::unwrap).collect()
    }

    #[test]
    fn slopes_that_agree_within_their_noise_become_one_and_centres_follow() {
        let rings = shared(&[0.5, -0.5, 0.5, -0.5, 0.0]);
        // The centre goes by `pull` against what its slope is moved by: to the mean, 0.
        assert_eq!(rings[0].centre.at, [1.0, 0.0]);
        assert_eq!(rings[1].centre.at, [-1.0, 0.0]);
        // Four fifths of the slope's part of the variance are gone.
        assert!((rings[0].centre.covariance[0] - (5.0 - 0.8 * 4.0)).abs() < 1e-12);
    }

    #[test]
    fn slopes_that_differ_by_more_than_noise_stay_and_so_do_those_of_few_rings() {
        let far = shared(&[30.0, -30.0, 30.0, -30.0]);
        assert!(far[0].centre.at[0].abs() < 0.1 && far[0].centre.covariance[0] > 4.99);
        let few = shared(&[0.5, -0.5, 0.5]);
        assert_eq!(few[0].centre.at, [0.0, 0.0]);
    }
}
