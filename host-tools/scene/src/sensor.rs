//! From light to samples: blur of the lens, photon and read noise, gain, black level, quantisation.

use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

use crate::coverage::Aperture;

/// The sensor and the blur before it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Sensor {
    /// Significant bits of a sample, 8 to 16; more than 8 take two bytes, little-endian.
    pub(crate) bits: u32,
    /// Standard deviation of the lens' Gaussian blur, px.
    pub(crate) blur_px: f64,
    /// Electrons of a reflectance of 1 under a light of 1.
    pub(crate) full_well_e: f64,
    /// Read noise, electrons.
    pub(crate) read_noise_e: f64,
    /// Whether photons arrive at random.
    pub(crate) shot_noise: bool,
    /// Factor on signal and noise.
    pub(crate) gain: f64,
    /// Added to every sample, share of full scale.
    pub(crate) black_level: f64,
}

/// Mixes numbers into a seed: every row of every frame has its own stream of noise, so that the picture does
/// not depend on who renders it when (the finaliser of SplitMix64).
pub(crate) fn mix(parts: &[u64]) -> u64 {
    parts.iter().fold(0, |seed, part| {
        let mut z = (seed ^ part).wrapping_add(0x9e37_79b9_7f4a_7c15);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    })
}

impl Sensor {
    /// Bytes of a sample.
    pub(crate) fn bytes(&self) -> usize {
        if self.bits > 8 { 2 } else { 1 }
    }

    /// Greatest sample.
    pub(crate) fn greatest(&self) -> f32 {
        ((1u32 << self.bits) - 1) as f32
    }

    /// How a pixel gathers light, and one side of the kernel of the blur that is left, from its middle on,
    /// adding up to 1 with its mirror image.
    pub(crate) fn optics(&self) -> (Aperture, Vec<f32>) {
        let (aperture, left) = Aperture::for_blur(self.blur_px);
        (aperture, kernel(left))
    }

    /// Gain and black level on a row of light, without noise: shares of full scale.
    pub(crate) fn amplify(&self, light: &mut [f32]) {
        let (gain, black) = (self.gain as f32, self.black_level as f32);
        for value in light {
            *value = black + gain * *value;
        }
    }

    /// Adds noise to a row of light (shares of the full well), with the row's own seed.
    pub(crate) fn add_noise(&self, light: &mut [f32], seed: u64) {
        let per_electron = (1.0 / self.full_well_e) as f32;
        let shot = if self.shot_noise { per_electron } else { 0.0 };
        let read = (self.read_noise_e as f32 * per_electron).powi(2);
        if shot == 0.0 && read == 0.0 {
            return;
        }
        let mut random = Pcg64Mcg::seed_from_u64(seed);
        for value in light {
            let normal: f32 = StandardNormal.sample(&mut random);
            *value += (read + shot * value.max(0.0)).sqrt() * normal;
        }
    }

    /// Samples of a row of shares of full scale, rounded and clipped.
    pub(crate) fn quantise(&self, shares: &[f32], samples: &mut [u8]) {
        let greatest = self.greatest();
        // The cast saturates at zero.
        let sample = |share: f32| (share * greatest + 0.5).min(greatest) as u16;
        if self.bits > 8 {
            for (share, bytes) in shares.iter().zip(samples.chunks_exact_mut(2)) {
                bytes.copy_from_slice(&sample(*share).to_le_bytes());
            }
        } else {
            for (share, byte) in shares.iter().zip(samples) {
                *byte = sample(*share) as u8;
            }
        }
    }
}

fn kernel(sigma: f64) -> Vec<f32> {
    if sigma <= 0.0 {
        return vec![1.0];
    }
    let half: Vec<f64> =
        (0..=(4.0 * sigma).ceil() as u32).map(|i| (-0.5 * (f64::from(i) / sigma).powi(2)).exp()).collect();
    let sum = 2.0 * half.iter().sum::<f64>() - half[0];
    half.iter().map(|value| (value / sum) as f32).collect()
}

/// Sum of a kernel's terms around one place: `at(0)` the middle, `at(-i)` and `at(i)` to either side.
pub(crate) fn blur_row(kernel: &[f32], row: &[f32], out: &mut [f32]) {
    let reach = kernel.len() - 1;
    let middle = &row[reach..reach + out.len()];
    for (out, value) in out.iter_mut().zip(middle) {
        *out = kernel[0] * value;
    }
    for (i, weight) in kernel.iter().enumerate().skip(1) {
        let (left, right) = (&row[reach - i..], &row[reach + i..]);
        for ((out, a), b) in out.iter_mut().zip(left).zip(right) {
            *out += weight * (a + b);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sensor() -> Sensor {
        Sensor {
            bits: 8,
            blur_px: 0.0,
            full_well_e: 10_000.0,
            read_noise_e: 20.0,
            shot_noise: true,
            gain: 1.0,
            black_level: 0.0,
        }
    }

    #[test]
    fn noise_has_the_mean_and_the_variance_that_were_set() {
        for (shot_noise, variance) in [(true, 0.25 / 10_000.0 + 4e-6), (false, 4e-6)] {
            let mut row = vec![0.25; 400_000];
            Sensor { shot_noise, ..sensor() }.add_noise(&mut row, 3);
            let mean = row.iter().map(|v| f64::from(*v)).sum::<f64>() / row.len() as f64;
            let seen = row.iter().map(|v| (f64::from(*v) - mean).powi(2)).sum::<f64>() / row.len() as f64;
            // Four standard errors: sqrt(variance / n) of the mean, sqrt(2 / n) of the variance's ratio.
            assert!((mean - 0.25).abs() < 4.0 * (variance / 400_000.0f64).sqrt(), "{mean}");
            assert!((seen / variance - 1.0).abs() < 4.0 * (2.0 / 400_000.0f64).sqrt(), "{seen}");
        }
    }

    #[test]
    fn samples_are_rounded_clipped_and_little_endian() {
        let mut samples = [0; 4];
        sensor().quantise(&[-0.2, 0.1, 0.498, 1.3], &mut samples);
        // 0.1 * 255 = 25.5 rounds up, 0.498 * 255 = 126.99.
        assert_eq!(samples, [0, 26, 127, 255]);
        let mut samples = [0; 4];
        Sensor { bits: 10, ..sensor() }.quantise(&[0.5, 2.0], &mut samples);
        assert_eq!(samples, [0, 2, 0xff, 0x03]);
        let mut samples = [0; 2];
        Sensor { bits: 16, ..sensor() }.quantise(&[2.0], &mut samples);
        assert_eq!(samples, [0xff, 0xff]);
    }

    #[test]
    fn gain_and_black_level_act_on_the_light() {
        let mut row = [0.0, 0.5];
        Sensor { gain: 1.5, black_level: 0.1, ..sensor() }.amplify(&mut row);
        assert_eq!(row, [0.1, 0.85]);
    }

    #[test]
    fn a_blurred_point_keeps_its_sum_and_its_place_and_gets_the_width_that_was_set() {
        let kernel = kernel(1.2);
        let reach = kernel.len() - 1;
        let mut row = vec![0.0; 21 + 2 * reach];
        row[10 + reach] = 1.0;
        let mut out = vec![0.0; 21];
        blur_row(&kernel, &row, &mut out);
        let moment = |n: i32| -> f64 {
            out.iter().enumerate().map(|(i, v)| f64::from(*v) * (i as f64 - 10.0).powi(n)).sum()
        };
        // f32 weights; the kernel ends at four sigma, which costs 0.1 % of the variance.
        assert!((moment(0) - 1.0).abs() < 1e-6 && moment(1).abs() < 1e-6);
        assert!((moment(2).sqrt() - 1.2).abs() < 0.002, "{}", moment(2).sqrt());
    }

    #[test]
    fn every_row_of_every_frame_has_its_own_seed() {
        assert_ne!(mix(&[1, 2, 3]), mix(&[1, 3, 2]));
        assert_ne!(mix(&[1, 0, 0]), mix(&[1, 0, 1]));
    }
}
