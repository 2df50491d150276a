//! The slope of the light over a target. Every ring tells it for itself; the rings of a target together tell
//! it better as far as they agree (the positive-part estimator of James and Stein), frame after frame better
//! still as far as it stays (Kalman's filter), and their centres follow.
//!
//! The frames before matter most: what one frame's mean is off moves all rings of a target alike, which no
//! pose averages out.

use gangway_pose::MAX_CIRCLES;
use heapless::Vec;

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

/// Frames whose mean [`Target::news`] is in the end: what chance makes of it is then below a fifth.
const FRAMES: f64 = 32.0;

/// News of more than this are of another light: noise makes them in one frame of seven hundred at the most
/// (four rings that scatter more than they say), and all but never where rings scatter as they say.
const ANOTHER: f64 = 16.0;
/// News are followed at once as far as they are above this: noise makes as many in one to fifteen frames of a
/// thousand.
const CLEAR: f64 = 6.0;

/// The light over the targets of a carbody, as the frames so far tell it. Who tracks a carbody keeps it.
#[derive(Clone, Debug, Default)]
pub struct Illumination {
    targets: Vec<Target, MAX_CIRCLES>,
}

/// The light over one target.
#[derive(Clone, Copy, Debug)]
struct Target {
    number: u8,
    /// As [`Light::slope`].
    slope: [f64; 2],
    /// Mean square of the slope that a frame's rings say less the one known before, over the variance of its
    /// noise: 1 while the light stays.
    news: f64,
    frames: f64,
}

/// What the rings of a target say of its light in one frame.
struct Mean {
    slope: [f64; 2],
    /// Its variance in either direction, as the rings' own scatter makes it likely.
    variance: f64,
    /// How far a ring's own slope gives way to the target's.
    share: f64,
    count: usize,
}

impl Illumination {
    /// Moves the slopes of each target's rings towards what is known of it with this frame, and the centres
    /// with them.
    pub(crate) fn share(
        &mut self,
        searches: &[Search],
        rings: &mut [Result<Ring, Refusal>],
        lights: &[Light; MAX_CIRCLES],
    ) {
        for (i, search) in searches.iter().enumerate() {
            let target = search.target;
            if searches.iter().take(i).any(|before| before.target == target) {
                continue;
            }
            let others = searches.iter().zip(rings.iter_mut()).zip(lights);
            let of_target = others.filter(|((search, ring), light)| {
                search.target == target && ring.is_ok() && light.variance > 0.0
            });
            let mut told: Vec<(&mut Ring, &Light), MAX_CIRCLES> =
                of_target.filter_map(|((_, ring), light)| Some((ring.as_mut().ok()?, light))).collect();
            if told.len() < FEWEST {
                continue;
            }
            let mean = Mean::of(told.iter().map(|(_, light)| *light));
            let (slope, left) = self.known(target, &mean);
            let gain = mean.share * (1.0 - left / mean.count as f64);
            for (ring, light) in &mut told {
                let [u, v] = [0, 1].map(|axis| mean.share * (slope[axis] - light.slope[axis]));
                let [uu, uv, vv] = light.pull;
                let at = ring.centre.at;
                ring.centre.at = [at[0] - (uu * u + uv * v), at[1] - (uv * u + vv * v)];
                for (entry, by_slope) in ring.centre.covariance.iter_mut().zip(light.by_slope) {
                    *entry -= gain * by_slope;
                }
            }
        }
    }

    /// The slope over a target with this frame's mean, and the share of that mean's variance that is left.
    fn known(&mut self, number: u8, mean: &Mean) -> ([f64; 2], f64) {
        let first = Target { number, slope: mean.slope, news: 1.0, frames: 0.0 };
        let Some(target) = self.targets.iter_mut().find(|target| target.number == number) else {
            // At most as many targets as circles, which are bounded by MAX_CIRCLES.
            let _ = self.targets.push(first);
            return (mean.slope, 1.0);
        };
        let off = [0, 1].map(|axis| mean.slope[axis] - target.slope[axis]);
        let news = 0.5 * (off[0] * off[0] + off[1] * off[1]) / mean.variance;
        // What is no number is none to go on from either.
        let goes_on = news <= ANOTHER;
        if !goes_on {
            *target = first;
            return (mean.slope, 1.0);
        }
        target.frames = (target.frames + 1.0).min(FRAMES);
        target.news += (news - target.news) / target.frames;
        // News of variance P + V, where V is this mean's and P that of what was known before, ask for the
        // gain P / (P + V); the variance left is that share of V. A mean of n is no better than an n-th.
        let gain = (1.0 - 1.0 / target.news).max(1.0 / (target.frames + 1.0)).max(1.0 - CLEAR / news);
        target.slope = [0, 1].map(|axis| target.slope[axis] + gain * off[axis]);
        (target.slope, gain)
    }
}

impl Mean {
    /// Of [`FEWEST`] or more.
    fn of<'l>(lights: impl Iterator<Item = &'l Light> + Clone) -> Self {
        let (mut weights, mut sum, mut count) = (0.0, [0.0; 2], 0);
        for light in lights.clone() {
            let weight = 1.0 / light.variance;
            weights += weight;
            sum = [0, 1].map(|axis| sum[axis] + weight * light.slope[axis]);
            count += 1;
        }
        let slope = sum.map(|sum| sum / weights);
        let scatter = lights.fold(0.0, |scatter, light| {
            let off = [0, 1].map(|axis| light.slope[axis] - slope[axis]);
            scatter + (off[0] * off[0] + off[1] * off[1]) / light.variance
        });
        // Two numbers a ring, two spent on the mean; the estimator takes two more.
        let share = ((2 * count - 4) as f64 / scatter).min(1.0);
        Self { slope, variance: 1.0 / (share * weights), share, count }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthetic::Random;
    use gangway_pose::Centre;
    use std::vec;
    use std::vec::Vec;

    /// How far a ring's centre follows its slope, px.
    const PULL: f64 = 2.0;
    const RINGS: usize = 5;

    /// Where rings with these centres and slopes along u are with the light shared; slopes have a variance
    /// of 1 and, known, would leave centres as much.
    fn shared(light: &mut Illumination, told: &[(f64, f64)]) -> Vec<Centre> {
        let searches = vec![Search::round([0.0; 2], 20.0); told.len()];
        let variance = 1.0 + PULL * PULL;
        let ring = |u| Ring {
            centre: Centre { at: [u, 0.0], covariance: [variance, 0.0, variance] },
            diameter_px: 20.0,
            white: 0.8,
            black: 0.1,
            noise: 0.01,
            blur_px: 0.7,
        };
        let mut rings: Vec<_> = told.iter().map(|(u, _)| Ok(ring(*u))).collect();
        let mut lights = [Light::NONE; MAX_CIRCLES];
        for (light, (_, slope)) in lights.iter_mut().zip(told) {
            let (pull, by_slope) = ([PULL, 0.0, PULL], [PULL * PULL, 0.0, PULL * PULL]);
            *light = Light { slope: [*slope, 0.0], variance: 1.0, pull, by_slope };
        }
        light.share(&searches, &mut rings, &lights);
        rings.into_iter().map(|ring| ring.unwrap().centre).collect()
    }

    fn with_slopes(slopes: &[f64]) -> Vec<Centre> {
        shared(&mut Illumination::default(), &slopes.iter().map(|slope| (0.0, *slope)).collect::<Vec<_>>())
    }

    /// The mean error of a frame's rings under light of this slope, px.
    fn mean_error(light: &mut Illumination, slope: f64, random: &mut Random) -> f64 {
        let told = [(); RINGS].map(|()| {
            let off = random.normal();
            (random.normal() - PULL * off, slope + off)
        });
        shared(light, &told).iter().map(|centre| centre.at[0]).sum::<f64>() / RINGS as f64
    }

    /// Those of so many frames, one after the other.
    fn errors(frames: usize, light: &mut Illumination, slope: f64, random: &mut Random) -> Vec<f64> {
        (0..frames).map(|_| mean_error(light, slope, random)).collect()
    }

    fn mean_square(errors: &[f64]) -> f64 {
        errors.iter().map(|error| error * error).sum::<f64>() / errors.len() as f64
    }

    #[test]
    fn slopes_that_agree_within_their_noise_become_one_and_centres_follow() {
        let centres = with_slopes(&[0.5, -0.5, 0.5, -0.5, 0.0]);
        // The centre goes by `pull` against what its slope is moved by: to the mean, 0.
        assert_eq!(centres[0].at, [1.0, 0.0]);
        assert_eq!(centres[1].at, [-1.0, 0.0]);
        // Four fifths of the slope's part of the variance are gone.
        assert!((centres[0].covariance[0] - (5.0 - 0.8 * 4.0)).abs() < 1e-12);
    }

    #[test]
    fn slopes_that_differ_by_more_than_noise_stay_and_so_do_those_of_few_rings() {
        let far = with_slopes(&[30.0, -30.0, 30.0, -30.0]);
        assert!(far[0].at[0].abs() < 0.1 && far[0].covariance[0] > 4.99);
        let few = with_slopes(&[0.5, -0.5, 0.5]);
        assert_eq!(few[0].at, [0.0, 0.0]);
    }

    #[test]
    fn light_that_stays_is_known_from_the_frames_before() {
        let mut random = Random::new(1);
        // A frame by itself knows the slope no better than its rings' mean does.
        let alone = [(); 2000].map(|()| mean_error(&mut Illumination::default(), 3.0, &mut random));
        let alone = mean_square(&alone);
        let known = (1.0 / RINGS as f64, PULL * PULL / RINGS as f64);
        assert!((alone - known.0 - known.1).abs() < 0.1, "{alone}");
        let mut light = Illumination::default();
        errors(64, &mut light, 3.0, &mut random);
        let after = mean_square(&errors(2000, &mut light, 3.0, &mut random));
        // Chance is taken for news by a tenth on average, which leaves a twentieth of a mean's variance.
        assert!(after < known.0 + 0.1 * known.1, "{after}, alone {alone}");
    }

    #[test]
    fn a_change_that_is_hardly_clear_is_followed_within_frames() {
        let mut random = Random::new(3);
        // Five times the noise of a mean: without following it the centres would be off by as much.
        let step = 5.0 / (RINGS as f64).sqrt();
        let frames = [(); 500].map(|()| {
            let mut light = Illumination::default();
            errors(64, &mut light, 0.0, &mut random);
            errors(3, &mut light, step, &mut random)
        });
        let of_frame = |k: usize| mean_square(&frames.iter().map(|errors| errors[k]).collect::<Vec<_>>());
        let alone = (1.0 + PULL * PULL) / RINGS as f64;
        let whole = (PULL * step) * (PULL * step);
        assert!(of_frame(0) < 0.3 * whole + alone, "{} of {whole}", of_frame(0));
        assert!(of_frame(2) < 0.15 * whole + alone, "{} of {whole}", of_frame(2));
    }

    #[test]
    fn what_is_no_number_is_forgotten_with_its_frame() {
        let mut light = Illumination::default();
        shared(&mut light, &[(0.0, f64::NAN); RINGS]);
        shared(&mut light, &[(0.0, f64::INFINITY); RINGS]);
        let centres = shared(&mut light, &[(0.0, 1.0); RINGS]);
        assert!(centres.iter().all(|centre| centre.at[0] == 0.0), "{centres:?}");
    }

    #[test]
    fn light_that_changes_is_followed_at_once_and_light_that_drifts_closely() {
        let mut random = Random::new(2);
        let mut light = Illumination::default();
        errors(64, &mut light, 0.0, &mut random);
        // Of a frame by itself.
        let alone = (1.0 + PULL * PULL) / RINGS as f64;
        // Forty times the noise of a mean; the mean of twenty squares is off by a third.
        let after = mean_square(&errors(20, &mut light, 18.0, &mut random));
        assert!(after < 1.3 * alone, "{after}");
        // By as much as the noise of a mean, frame after frame: what is known lags behind by about that.
        let drift = 1.0 / (RINGS as f64).sqrt();
        let slopes = (0..500).map(|frame| 18.0 + drift * f64::from(frame));
        let drifting: Vec<_> = slopes.map(|slope| mean_error(&mut light, slope, &mut random)).collect();
        let drifting = mean_square(&drifting);
        assert!(drifting < 1.1 * alone, "{drifting}");
    }
}
