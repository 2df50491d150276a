//! Numbers that the inner loop of the refinement computes with: one, or those of two circles at once, which
//! the compiler turns into vector instructions of any machine.

use core::ops::{Add, AddAssign, Div, Mul, Neg, Sub};

/// One `f64` or several side by side.
pub(crate) trait Number:
    Copy
    + Add<Output = Self>
    + AddAssign
    + Div<Output = Self>
    + Mul<Output = Self>
    + Neg<Output = Self>
    + Sub<Output = Self>
{
    /// The same number everywhere.
    fn of(value: f64) -> Self;

    /// Whether all of them are above a limit; NaN is not.
    fn are_above(self, limit: f64) -> bool;

    /// Whether all of them are finite.
    fn are_finite(self) -> bool;

    /// Whether a test holds for all places of two numbers.
    fn hold(a: Self, b: Self, test: impl Fn(f64, f64) -> bool) -> bool;
}

impl Number for f64 {
    #[inline(always)]
    fn of(value: f64) -> Self {
        value
    }

    #[inline(always)]
    fn are_above(self, limit: f64) -> bool {
        self > limit
    }

    #[inline(always)]
    fn are_finite(self) -> bool {
        self.is_finite()
    }

    #[inline(always)]
    fn hold(a: Self, b: Self, test: impl Fn(f64, f64) -> bool) -> bool {
        test(a, b)
    }
}

/// Two numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(align(16))]
pub(crate) struct Pair(pub(crate) [f64; 2]);

impl Pair {
    pub(crate) const ZERO: Self = Self([0.0; 2]);

    /// What `of` says of each of two.
    #[inline(always)]
    pub(crate) fn each<T>(two: [&T; 2], of: impl Fn(&T) -> f64) -> Self {
        Self([of(two[0]), of(two[1])])
    }

    /// The sum of both.
    #[inline(always)]
    pub(crate) fn sum(self) -> f64 {
        self.0[0] + self.0[1]
    }

    #[inline(always)]
    fn zip(self, other: Self, f: impl Fn(f64, f64) -> f64) -> Self {
        Self([f(self.0[0], other.0[0]), f(self.0[1], other.0[1])])
    }
}

impl Number for Pair {
    #[inline(always)]
    fn of(value: f64) -> Self {
        Self([value; 2])
    }

    #[inline(always)]
    fn are_above(self, limit: f64) -> bool {
        (self.0[0] > limit) & (self.0[1] > limit)
    }

    #[inline(always)]
    fn are_finite(self) -> bool {
        self.0[0].is_finite() & self.0[1].is_finite()
    }

    #[inline(always)]
    fn hold(a: Self, b: Self, test: impl Fn(f64, f64) -> bool) -> bool {
        test(a.0[0], b.0[0]) && test(a.0[1], b.0[1])
    }
}

impl Add for Pair {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.zip(other, |a, b| a + b)
    }
}

impl AddAssign for Pair {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl Sub for Pair {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.zip(other, |a, b| a - b)
    }
}

impl Mul for Pair {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.zip(other, |a, b| a * b)
    }
}

impl Div for Pair {
    type Output = Self;
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        self.zip(other, |a, b| a / b)
    }
}

impl Neg for Pair {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self([-self.0[0], -self.0[1]])
    }
}
