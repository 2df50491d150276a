//! Pictures of rings for the tests: supersampled edges, blur, uneven light, noise.

use std::vec;
use std::vec::Vec;

use gangway_device::{Frame, Layout};

/// A small random generator (xorshift64*), so that tests need nothing else.
pub(crate) struct Random(u64);

impl Random {
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1)
    }

    pub(crate) fn next(&mut self) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        self.0.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 32
    }

    /// From `low` to `high`.
    pub(crate) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.next() as f64 / 4_294_967_296.0
    }

    /// Mean 0, standard deviation 1: the sum of twelve uniform numbers.
    pub(crate) fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.between(0.0, 1.0)).sum::<f64>() - 6.0
    }
}

/// A picture in shares of full scale.
pub(crate) struct Picture {
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) values: Vec<f64>,
}

/// Samples of a pixel either way.
const FINE: usize = 10;

impl Picture {
    pub(crate) fn new(width: usize, height: usize, white: f64) -> Self {
        Self { width, height, values: vec![white; width * height] }
    }

    /// Covers with `level` what is `inside`, by the share of each pixel.
    pub(crate) fn cover(&mut self, level: f64, inside: impl Fn(f64, f64) -> bool) {
        for (i, value) in self.values.iter_mut().enumerate() {
            let (x, y) = ((i % self.width) as f64, (i / self.width) as f64);
            let fine = |k: usize| (k as f64 + 0.5) / FINE as f64 - 0.5;
            let hits = (0..FINE * FINE).filter(|k| inside(x + fine(k % FINE), y + fine(k / FINE))).count();
            let share = hits as f64 / (FINE * FINE) as f64;
            *value += share * (level - *value);
        }
    }

    /// A black ring, twice as wide outside as inside.
    pub(crate) fn ring(&mut self, centre: [f64; 2], diameter: f64, black: f64) {
        self.cover(black, |x, y| {
            let square = 4.0 * ((x - centre[0]).powi(2) + (y - centre[1]).powi(2));
            (0.25 * diameter * diameter..diameter * diameter).contains(&square)
        });
    }

    /// A disc, to 1/2000 of a pixel's light: chords of so many lines a pixel, each cut exactly.
    pub(crate) fn disc(&mut self, centre: [f64; 2], diameter: f64, level: f64) {
        const LINES: usize = 64;
        for (i, value) in self.values.iter_mut().enumerate() {
            let (x, y) = ((i % self.width) as f64 - centre[0], (i / self.width) as f64 - centre[1]);
            if x.hypot(y) > 0.5 * diameter + 1.0 {
                continue;
            }
            let share = (0..LINES).map(|k| {
                let y = y + (k as f64 + 0.5) / LINES as f64 - 0.5;
                let half = (0.25 * diameter * diameter - y * y).max(0.0).sqrt();
                ((x + 0.5).min(half) - (x - 0.5).max(-half)).max(0.0)
            });
            *value += share.sum::<f64>() / LINES as f64 * (level - *value);
        }
    }

    /// Light that grows by `slope` of itself a pixel from left to right.
    pub(crate) fn light(&mut self, slope: f64) {
        let middle = self.width as f64 / 2.0;
        for (i, value) in self.values.iter_mut().enumerate() {
            *value *= 1.0 + slope * ((i % self.width) as f64 - middle);
        }
    }

    /// Gaussian blur.
    pub(crate) fn blur(&mut self, sigma: f64) {
        let weights: Vec<f64> = (-5..=5).map(|k| (-0.5 * (f64::from(k) / sigma).powi(2)).exp()).collect();
        let sum: f64 = weights.iter().sum();
        for (step, size) in [(1, self.width), (self.width, self.height)] {
            let old = self.values.clone();
            for (i, value) in self.values.iter_mut().enumerate() {
                let place = if step == 1 { i % size } else { i / step };
                let taps = weights.iter().zip(-5isize..).map(|(weight, k)| {
                    let to = (place as isize + k).clamp(0, size as isize - 1) - place as isize;
                    weight * old[(i as isize + to * step as isize) as usize]
                });
                *value = taps.sum::<f64>() / sum;
            }
        }
    }

    pub(crate) fn noise(&mut self, sigma: f64, random: &mut Random) {
        self.values.iter_mut().for_each(|value| *value += sigma * random.normal());
    }

    /// The picture's bytes in a layout.
    pub(crate) fn bytes(&self, layout: Layout) -> Vec<u8> {
        let full = f64::from((1u32 << layout.bits()) - 1);
        let levels = self.values.iter().map(|value| (value * full).round().clamp(0.0, full) as u16);
        match layout {
            Layout::Byte { step, offset } => levels
                .flat_map(|level| {
                    let mut bytes = vec![0x5a; step as usize];
                    bytes[offset as usize] = level as u8;
                    bytes
                })
                .collect(),
            Layout::Word { .. } => levels.flat_map(u16::to_le_bytes).collect(),
            Layout::Packed { bits } => {
                let (levels, low) = (levels.collect::<Vec<_>>(), bits - 8);
                let pack = |group: &[u16]| {
                    let tops =
                        (0..layout.group()).map(|i| group.get(i).map_or(0, |level| (level >> low) as u8));
                    let lows =
                        group.iter().rev().fold(0, |lows, level| lows << low | level & ((1 << low) - 1));
                    tops.chain([lows as u8]).collect::<Vec<_>>()
                };
                levels.chunks(self.width).flat_map(|row| row.chunks(layout.group()).flat_map(pack)).collect()
            }
        }
    }

    /// A frame over bytes of this picture.
    pub(crate) fn frame<'a>(&self, bytes: &'a [u8], layout: Layout) -> Frame<'a> {
        let stride = bytes.len() / self.height;
        Frame::new(bytes, (self.width as u16, self.height as u16), stride, layout, 0, 0).unwrap()
    }
}
