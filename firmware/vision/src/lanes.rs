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
