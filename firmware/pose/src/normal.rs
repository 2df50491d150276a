//! The normal equations of the refinement: their sums and their solution by Cholesky's method without square
//! roots (L D L^T), fixed at six unknowns.

use nalgebra::Matrix6;

use crate::number::Pair;
use crate::problem::Row;
use crate::refine::Derivative;

/// A pivot below this share of its diagonal element means that the unknown is not determined.
const SINGULAR: f64 = 1e-13;

/// `H = J^T W J` (upper triangle), `g = J^T W r` and `r^T W r`. Unknowns: (v, w) as
/// [`crate::Solution::covariance`].
#[derive(Clone, Copy)]
pub(crate) struct Normal {
    pub(crate) h: [[f64; 6]; 6],
    pub(crate) g: [f64; 6],
    pub(crate) chi2: f64,
}

/// The sums of a [`Normal`], of every other row and of those between.
pub(crate) struct Sums {
    h: [[Pair; 6]; 6],
    g: [Pair; 6],
    chi2: Pair,
}

impl Sums {
    pub(crate) const ZERO: Self = Self { h: [[Pair::ZERO; 6]; 6], g: [Pair::ZERO; 6], chi2: Pair::ZERO };

    /// Adds two rows with their derivatives.
    #[inline(always)]
    pub(crate) fn add(&mut self, of: &Derivative<Pair>, row: &Row<Pair>) {
        let Derivative { a, b, eu, ev } = of;
        let (wa, wb) = (a.map(|c| row.weight_u * c), b.map(|c| row.weight_v * c));
        for i in 0..6 {
            for k in i..6 {
                self.h[i][k] += wa[i] * a[k] + wb[i] * b[k];
            }
            self.g[i] += wa[i] * *eu + wb[i] * *ev;
        }
        self.chi2 += row.weight_u * *eu * *eu + row.weight_v * *ev * *ev;
    }

    pub(crate) fn normal(&self) -> Normal {
        Normal { h: self.h.map(|row| row.map(Pair::sum)), g: self.g.map(Pair::sum), chi2: self.chi2.sum() }
    }
}

impl Normal {
    /// L and D of `H` with its diagonal made larger by the factor `1 + damping`; `None` where `H` is
    /// singular.
    pub(crate) fn factor(&self, damping: f64) -> Option<Factor> {
        let h = &self.h;
        let mut l = [[0.0; 6]; 6];
        let mut inverse_d = [0.0; 6];
        let mut d = [0.0; 6];
        for k in 0..6 {
            let mut pivot = h[k][k] * (1.0 + damping);
            let floor = SINGULAR * pivot;
            for i in 0..k {
                pivot -= l[k][i] * l[k][i] * d[i];
            }
            // NaN fails the comparison.
            if !(pivot > floor && pivot < f64::INFINITY) {
                return None;
            }
            d[k] = pivot;
            inverse_d[k] = 1.0 / pivot;
            for row in k + 1..6 {
                let mut sum = h[k][row];
                for i in 0..k {
                    sum -= l[row][i] * l[k][i] * d[i];
                }
                l[row][k] = sum * inverse_d[k];
            }
        }
        Some(Factor { l, inverse_d })
    }
}

/// `L D L^T`.
pub(crate) struct Factor {
    l: [[f64; 6]; 6],
    inverse_d: [f64; 6],
}

impl Factor {
    /// `H^-1 g`.
    pub(crate) fn solve(&self, g: &[f64; 6]) -> [f64; 6] {
        let mut x = *g;
        for row in 0..6 {
            for i in 0..row {
                x[row] -= self.l[row][i] * x[i];
            }
        }
        for row in (0..6).rev() {
            x[row] *= self.inverse_d[row];
            for i in row + 1..6 {
                x[row] -= self.l[i][row] * x[i];
            }
        }
        x
    }

    /// `H^-1`.
    pub(crate) fn inverse(&self) -> Matrix6<f64> {
        // M = L^-1, lower triangular with ones; H^-1 = M^T D^-1 M.
        let mut m = [[0.0; 6]; 6];
        for column in 0..6 {
            m[column][column] = 1.0;
            for row in column + 1..6 {
                let mut sum = 0.0;
                for i in column..row {
                    sum -= self.l[row][i] * m[i][column];
                }
                m[row][column] = sum;
            }
        }
        let mut inverse = Matrix6::zeros();
        for i in 0..6 {
            for k in i..6 {
                let mut sum = 0.0;
                for row in k..6 {
                    sum += m[row][i] * m[row][k] * self.inverse_d[row];
                }
                inverse[(i, k)] = sum;
                inverse[(k, i)] = sum;
            }
        }
        inverse
    }
}
