//! Four `f32` that are computed at once: plain code that the compiler turns into vector instructions of any
//! machine, with sums in a fixed order.

use core::ops::{Add, AddAssign, Mul, Sub};

/// Numbers in a vector.
pub(crate) const LANES: usize = 4;

/// Numbers in a block, for loops that the compiler makes vectors of, and its vectors.
pub(crate) const BLOCK: usize = 32;
pub(crate) const RUNS: usize = BLOCK / LANES;
const _: () = assert!(BLOCK == RUNS * LANES);

/// A number for each place in a block.
pub(crate) type Column = [f32; BLOCK];

/// Four numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(align(16))]
pub(crate) struct Lanes([f32; LANES]);

impl Lanes {
    pub(crate) const ZERO: Self = Self([0.0; LANES]);

    #[inline(always)]
    pub(crate) const fn of(values: [f32; LANES]) -> Self {
        Self(values)
    }

    /// Numbers `LANES * i` and on of a column.
    #[inline(always)]
    pub(crate) fn load<const N: usize>(column: &[f32; N], i: usize) -> Self {
        Self(core::array::from_fn(|lane| column[LANES * i + lane]))
    }

    #[inline(always)]
    fn zip(self, other: Self, f: impl Fn(f32, f32) -> f32) -> Self {
        let (a, b) = (self.0, other.0);
        Self([f(a[0], b[0]), f(a[1], b[1]), f(a[2], b[2]), f(a[3], b[3])])
    }

    /// The sum of the four.
    #[inline(always)]
    pub(crate) fn sum(self) -> f64 {
        let [a, b, c, d] = self.0;
        f64::from((a + c) + (b + d))
    }
}

impl Add for Lanes {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.zip(other, |a, b| a + b)
    }
}

impl Sub for Lanes {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.zip(other, |a, b| a - b)
    }
}

impl Mul for Lanes {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.zip(other, |a, b| a * b)
    }
}

impl AddAssign for Lanes {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

/// 1 / sqrt(x) to 2e-5 of itself, finite for every x >= 0.
#[inline(always)]
pub(crate) fn inverse_sqrt(x: f32) -> f32 {
    // The bits of a float are nearly its logarithm: halve and negate it, then one step of third order. The
    // constants make the largest error least: it moves a pixel at the largest radius by a thousandth.
    let y = f32::from_bits(0x5f20_0000_u32.wrapping_sub(x.to_bits() >> 1));
    let off = x * y * y;
    y * (2.102_354_5 - off * (1.760_927_4 - 0.663_152_4 * off))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_inverse_root_is_good_to_a_fifty_thousandth() {
        for i in -2000..4000 {
            let x = 1.37f32 * 2f32.powf(0.01 * i as f32);
            let exact = 1.0 / f64::from(x).sqrt();
            assert!((f64::from(inverse_sqrt(x)) / exact - 1.0).abs() < 2e-5);
        }
        assert!(inverse_sqrt(0.0).is_finite());
    }
}
