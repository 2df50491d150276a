//! The linear system that DLT, homography and EPnP share.
//!
//! In the basis of the points' centroid and principal axes, scaled to unit spread, a point is
//! `p = c + sum_k sigma_k a_k e_k`, and in the camera `X_c = b_0 + sum_k a_k b_k` with unknown columns `b`.
//! Every ray (x, y, 1) gives two equations, `X - x Z = 0` and `Y - y Z = 0`: the DLT (Hartley and Zisserman
//! 7.1), and, the b's being EPnP's control points written as differences, also the matrix M of EPnP (Lepetit
//! et al. 2009). `M^T M` has the blocks `[[S, 0, -Sx], [0, S, -Sy], [-Sx, -Sy, Sxx + Syy]]`; in this basis
//! `S = n I`, so X and Y of the columns follow from their depths and the 12 x 12 eigenproblem shrinks to 4 x
//! 4 (3 x 3 for a plane).

use crate::eigen;
use crate::problem::Row;

/// Spread across the best line below this share of the spread along it: one line.
const LINE: f64 = 1e-3;
/// Spread across the best plane below this share of the smaller spread in it: one plane.
const PLANE: f64 = 0.02;

/// Centroid and principal axes of the points.
#[derive(Clone, Copy)]
pub(crate) struct Basis {
    /// mm.
    pub(crate) centroid: [f64; 3],
    /// Unit axes, one a row, right-handed, the longest first.
    pub(crate) axes: [[f64; 3]; 3],
    /// Root mean square extent along each axis, mm, descending.
    pub(crate) sigma: [f64; 3],
}

impl Basis {
    /// `None` where the points lie on one line.
    pub(crate) fn of(rows: &[Row]) -> Option<Self> {
        let share = 1.0 / rows.len() as f64;
        let mut centroid = [0.0; 3];
        for row in rows {
            for (c, p) in centroid.iter_mut().zip(row.point) {
                *c += share * p;
            }
        }
        let mut scatter = [[0.0; 3]; 3];
        for row in rows {
            let d = [row.point[0] - centroid[0], row.point[1] - centroid[1], row.point[2] - centroid[2]];
            for i in 0..3 {
                for k in i..3 {
                    scatter[i][k] += share * d[i] * d[k];
                }
            }
        }
        for i in 0..3 {
            for k in 0..i {
                scatter[i][k] = scatter[k][i];
            }
        }
        let (values, [_, middle, long]) = eigen::symmetric(scatter);
        let sigma = [values[2], values[1], values[0]].map(|v| libm::sqrt(v.max(0.0)));
        let across = cross(&long, &middle);
        // NaN fails the comparison.
        (sigma[1] > LINE * sigma[0]).then_some(Self { centroid, axes: [long, middle, across], sigma })
    }

    /// Whether the points lie in one plane, or so near to it that the start may take them so.
    pub(crate) fn is_planar(&self) -> bool {
        self.sigma[2] < PLANE * self.sigma[1]
    }

    /// (1, a_1, ...) of a point: N - 1 axes are used.
    fn coordinates<const N: usize>(&self, point: &[f64; 3]) -> [f64; N] {
        let d = [point[0] - self.centroid[0], point[1] - self.centroid[1], point[2] - self.centroid[2]];
        let mut a = [1.0; N];
        for k in 1..N {
            a[k] = dot(&self.axes[k - 1], &d) / self.sigma[k - 1];
        }
        a
    }
}

/// The candidate solutions: eigenvectors of the reduced system, the one of the smallest eigenvalue first.
pub(crate) struct Candidates<const N: usize> {
    pub(crate) eigenvalues: [f64; N],
    /// `columns[k][j]` is b_j of the k-th eigenvector.
    pub(crate) columns: [[[f64; 3]; N]; N],
}

/// Builds and solves the reduced system for N - 1 axes: N = 3 for a plane, N = 4 in general.
pub(crate) fn candidates<const N: usize>(basis: &Basis, rows: &[Row], rays: &[[f64; 2]]) -> Candidates<N> {
    let share = 1.0 / rows.len() as f64;
    // Taking the mean ray off changes nothing but the rounding errors of the elimination.
    let mut mean = [0.0; 2];
    for [x, y] in rays {
        mean[0] += share * x;
        mean[1] += share * y;
    }
    let mut sx = [[0.0; N]; N];
    let mut sy = [[0.0; N]; N];
    let mut reduced = [[0.0; N]; N];
    for (row, ray) in rows.iter().zip(rays) {
        let a: [f64; N] = basis.coordinates(&row.point);
        let (x, y) = (share * (ray[0] - mean[0]), share * (ray[1] - mean[1]));
        let xy = x * (ray[0] - mean[0]) + y * (ray[1] - mean[1]);
        for i in 0..N {
            for k in i..N {
                let product = a[i] * a[k];
                sx[i][k] += x * product;
                sy[i][k] += y * product;
                reduced[i][k] += xy * product;
            }
        }
    }
    for i in 0..N {
        for k in 0..i {
            sx[i][k] = sx[k][i];
            sy[i][k] = sy[k][i];
        }
    }
    for i in 0..N {
        for k in i..N {
            for m in 0..N {
                reduced[i][k] -= sx[i][m] * sx[m][k] + sy[i][m] * sy[m][k];
            }
            reduced[k][i] = reduced[i][k];
        }
    }
    let (eigenvalues, depths) = eigen::symmetric(reduced);
    let mut columns = [[[0.0; 3]; N]; N];
    for (columns, z) in columns.iter_mut().zip(&depths) {
        for (j, column) in columns.iter_mut().enumerate() {
            *column = [mean[0] * z[j], mean[1] * z[j], z[j]];
            for m in 0..N {
                column[0] += sx[j][m] * z[m];
                column[1] += sy[j][m] * z[m];
            }
        }
    }
    Candidates { eigenvalues, columns }
}

pub(crate) fn dot(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(crate) fn cross(a: &[f64; 3], b: &[f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}
