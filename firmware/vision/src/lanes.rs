//! Four `f32` that are computed at once: plain code that the compiler turns into vector instructions of any
//! machine, with sums in a fixed order.

use core::ops::{Add, AddAssign, Mul, Sub};

/// Numbers in a vector.
pub(crate) const LANES: usize = 4;

/// Four numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(align(16))]
pub(crate) struct Lanes([f32; LANES]);

impl Lanes {
    pub(crate) const ZERO: Self = Self([0.0; LANES]);

    #[inline(always)]
    pub(crate) fn splat(value: f32) -> Self {
        Self([value; LANES])
    }

    #[inline(always)]
    pub(crate) fn of(values: [f32; LANES]) -> Self {
        Self(values)
    }

    /// `start`, `start + 1`, ...
    #[inline(always)]
    pub(crate) fn count_from(start: f32) -> Self {
        Self([start, start + 1.0, start + 2.0, start + 3.0])
    }

    #[inline(always)]
    fn zip(self, other: Self, f: impl Fn(f32, f32) -> f32) -> Self {
        let (a, b) = (self.0, other.0);
        Self([f(a[0], b[0]), f(a[1], b[1]), f(a[2], b[2]), f(a[3], b[3])])
    }

    #[inline(always)]
    pub(crate) fn min(self, other: Self) -> Self {
        self.zip(other, |a, b| if a < b { a } else { b })
    }

    #[inline(always)]
    pub(crate) fn max(self, other: Self) -> Self {
        self.zip(other, |a, b| if a > b { a } else { b })
    }

    #[inline(always)]
    pub(crate) fn abs(self) -> Self {
        let positive = |x: f32| f32::from_bits(x.to_bits() & 0x7fff_ffff);
        let [a, b, c, d] = self.0;
        Self([positive(a), positive(b), positive(c), positive(d)])
    }

    /// 1 where it is less than `other`, else 0.
    #[inline(always)]
    pub(crate) fn less(self, other: Self) -> Self {
        self.zip(other, |a, b| if a < b { 1.0 } else { 0.0 })
    }

    /// 1 / sqrt(x) to 7e-4 of itself, finite for every x >= 0.
    #[inline(always)]
    pub(crate) fn inverse_sqrt(self) -> Self {
        // The bits of a float are nearly its logarithm: halve and negate it, then one of Newton's steps. The
        // constants (J. Kadlec) make the largest error least.
        let guess = |x: f32| f32::from_bits(0x5f1f_fff9_u32.wrapping_sub(x.to_bits() >> 1));
        let x = self.0;
        let y = Self([guess(x[0]), guess(x[1]), guess(x[2]), guess(x[3])]);
        y * (Self::splat(1.681_913_9) - self * y * y * Self::splat(0.703_952_25))
    }

    /// The sum of the four.
    #[inline(always)]
    pub(crate) fn sum(self) -> f64 {
        let [a, b, c, d] = self.0;
        (f64::from(a) + f64::from(b)) + (f64::from(c) + f64::from(d))
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_inverse_root_is_good_to_seven_ten_thousandths() {
        for i in -20..40 {
            let x = 1.37f32 * 2f32.powi(i);
            let Lanes([y, ..]) = Lanes::splat(x).inverse_sqrt();
            let exact = 1.0 / f64::from(x).sqrt();
            assert!((f64::from(y) / exact - 1.0).abs() < 7e-4);
        }
        let Lanes([y, ..]) = Lanes::ZERO.inverse_sqrt();
        assert!(y.is_finite());
    }
}
