//! The start of motion from the summed absolute difference to the first picture, SAD = sum |F_0 - F_t|
//! (thesis 5.4.2, equation 5.1): of pictures by their samples, of motions by the six degrees of freedom in
//! units of requirement R(a).

use super::track::{Six, Track};
use crate::DEGREES_OF_FREEDOM;

/// Samples at the beginning from which the noise at rest is learned, at most.
const REST_SAMPLES: usize = 10;
/// The start exceeds the noise at rest so many times ...
const NOISE: f64 = 6.0;
/// ... and this share of the largest difference.
const SHARE: f64 = 0.01;
/// It is no flicker: so many samples in a row do.
const IN_A_ROW: usize = 3;

/// Summed absolute difference of two pictures' samples (equation 5.1). Samples that only one of them has do
/// not count.
pub fn summed_absolute_difference(first: &[u8], frame: &[u8]) -> u64 {
    first.iter().zip(frame).map(|(a, b)| u64::from(a.abs_diff(*b))).sum()
}

/// The first sample at which a series of summed absolute differences changes for good, in the manner of
/// thesis figure 5.16; `None` where it never does, or does so from the beginning.
pub fn motion_start(differences: &[f64]) -> Option<usize> {
    // Noise makes the difference of any two pictures: the first one's zero to itself does not count.
    let rest = differences.get(1..=REST_SAMPLES.min(differences.len() / 4))?;
    let base = crate::statistics::median(rest.to_vec())?;
    let spread = crate::statistics::median(rest.iter().map(|d| (d - base).abs()).collect())?;
    let most = differences.iter().fold(base, |most, d| most.max(*d));
    // 1.48 times the median absolute deviation is the standard deviation of normal noise.
    let threshold = base + (NOISE * 1.48 * spread).max(SHARE * (most - base));
    if most <= threshold {
        return None;
    }
    let above: Vec<bool> = differences.iter().map(|d| *d > threshold).collect();
    let start = above.windows(IN_A_ROW).position(|run| run.iter().all(|above| *above))?;
    (start > rest.len()).then_some(start)
}

/// The time at which a recorded motion starts, s.
pub(crate) fn track_start(track: &Track) -> Option<f64> {
    let first = track.values().first()?;
    let difference = |values: &Six| -> f64 {
        values.iter().zip(first).zip(DEGREES_OF_FREEDOM).map(|((a, b), of)| (a - b).abs() / of.limit).sum()
    };
    let differences: Vec<f64> = track.values().iter().map(difference).collect();
    motion_start(&differences).map(|i| track.times()[i])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_difference_of_pictures_is_that_of_equation_5_1() {
        assert_eq!(summed_absolute_difference(&[10, 200, 0], &[13, 190, 0]), 13);
    }

    #[test]
    fn the_start_is_where_the_difference_grows_for_good() {
        let mut differences = vec![0.0];
        differences.extend((1..60).map(|i| 100.0 + f64::from(i % 3)));
        // A flash of two frames is no start.
        differences[30] = 900.0;
        differences[31] = 900.0;
        differences.extend((0..50).map(|i| 102.0 + 12.0 * f64::from(i)));
        assert_eq!(motion_start(&differences), Some(61));
    }

    #[test]
    fn without_rest_or_without_motion_there_is_no_start() {
        assert_eq!(motion_start(&[0.0, 100.0, 101.0, 100.0, 101.0, 100.0, 100.0, 101.0]), None);
        let moving: Vec<f64> = (0..100).map(|i| 50.0 * (f64::from(i) * 0.3).sin().abs()).collect();
        assert_eq!(motion_start(&moving), None);
        assert_eq!(motion_start(&[]), None);
    }
}
