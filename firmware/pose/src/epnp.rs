//! EPnP with Gauss-Newton on the betas (thesis 3.3; Lepetit, Moreno-Noguer and Fua 2009), planar and general,
//! from four circles. The control points are the centroid and the ends of the principal axes.

use crate::PoseError;
use crate::dlt::pose_of_columns;
use crate::geometry::Pose;
use crate::homography::pose_of_plane;
use crate::linear::{Candidates, candidates, dot};
use crate::problem::{Problem, Rays};

/// Gauss-Newton steps on the betas, as in the paper's own code.
const STEPS: usize = 5;
/// A mean reprojection error below this (px RMS) needs no further start.
const GOOD_ENOUGH_PX: f64 = 2.0;

/// The best of the starts (betas from the smallest eigenvector, from the two smallest, and from equal
/// depths).
pub(crate) fn epnp(problem: &Problem, rays: &Rays) -> Result<Pose, PoseError> {
    let basis = &problem.basis;
    let pose = if basis.is_planar() {
        let found = candidates::<3>(basis, &problem.rows, rays);
        best_start(problem, &found, |b| pose_of_plane(basis, b))
    } else {
        let found = candidates::<4>(basis, &problem.rows, rays);
        best_start(problem, &found, |b| pose_of_columns(basis, b))
    };
    pose.ok_or(PoseError::NoConsensus)
}

fn best_start<const N: usize>(
    problem: &Problem,
    found: &Candidates<N>,
    to_pose: impl Fn(&[[f64; 3]; N]) -> Option<Pose>,
) -> Option<Pose> {
    let lengths = Lengths::of(problem, found);
    let good_enough = GOOD_ENOUGH_PX * GOOD_ENOUGH_PX * problem.rows.len() as f64;
    let mut best: Option<(f64, Pose)> = None;
    for start in [Lengths::one, Lengths::two, Lengths::equal_depths] {
        let betas = lengths.gauss_newton(start(&lengths, found));
        let mut columns = [[0.0; 3]; N];
        for (beta, of_eigenvector) in betas.iter().zip(&found.columns) {
            for (column, part) in columns.iter_mut().zip(of_eigenvector) {
                for i in 0..3 {
                    column[i] += beta * part[i];
                }
            }
        }
        let Some(pose) = to_pose(&columns) else { continue };
        let sum: f64 = problem.rows.iter().map(|row| problem.error(row, &pose).px2).sum();
        if best.is_none_or(|(least, _)| sum < least) {
            best = Some((sum, pose));
        }
        if sum < good_enough {
            break;
        }
    }
    best.map(|(_, pose)| pose)
}

/// Pairs of edges of the control points, at most.
const PAIRS: usize = 6;

/// What the betas must fulfil: the edges of the control points keep their lengths and their right angles.
struct Lengths<const N: usize> {
    /// `products[pair][k][l]`: (b_i of k) . (b_j of l), made symmetric in k and l.
    products: [[[f64; N]; N]; PAIRS],
    /// sigma_i sigma_j delta_ij, in units of the longest edge.
    targets: [f64; PAIRS],
    pairs: usize,
}

impl<const N: usize> Lengths<N> {
    fn of(problem: &Problem, found: &Candidates<N>) -> Self {
        let mut lengths = Self { products: [[[0.0; N]; N]; PAIRS], targets: [0.0; PAIRS], pairs: 0 };
        let longest = problem.basis.sigma[0];
        for i in 1..N {
            for j in i..N {
                let pair = lengths.pairs;
                for k in 0..N {
                    for l in k..N {
                        let (a, b) = (&found.columns[k], &found.columns[l]);
                        let product = 0.5 * (dot(&a[i], &b[j]) + dot(&b[i], &a[j]));
                        lengths.products[pair][k][l] = product;
                        lengths.products[pair][l][k] = product;
                    }
                }
                if i == j {
                    let share = problem.basis.sigma[i - 1] / longest;
                    lengths.targets[pair] = share * share;
                }
                lengths.pairs += 1;
            }
        }
        lengths
    }

    fn pairs(&self) -> impl Iterator<Item = (&[[f64; N]; N], f64)> {
        self.products.iter().zip(self.targets).take(self.pairs)
    }

    /// Only the smallest eigenvector: its scale.
    fn one(&self, _: &Candidates<N>) -> [f64; N] {
        let mut betas = [0.0; N];
        betas[0] = 1.0;
        self.scaled(betas)
    }

    /// The two smallest: least squares for (b00, b01, b11), by its normal equations.
    fn two(&self, _: &Candidates<N>) -> [f64; N] {
        let mut h = [[0.0; 3]; 3];
        let mut g = [0.0; 3];
        for (products, target) in self.pairs() {
            let row = [products[0][0], 2.0 * products[0][1], products[1][1]];
            for i in 0..3 {
                for k in 0..3 {
                    h[i][k] += row[i] * row[k];
                }
                g[i] += row[i] * target;
            }
        }
        let mut betas = [0.0; N];
        if let Some([b00, b01, b11]) = cholesky_solve(h, g) {
            betas[0] = libm::sqrt(b00.abs());
            betas[1] = libm::sqrt(b11.abs());
            if b01 < 0.0 {
                betas[1] = -betas[1];
            }
        } else {
            betas[0] = 1.0;
        }
        self.scaled(betas)
    }

    /// All at the same depth: the paper's case of a long focal length, and the only start for four circles in
    /// space, whose eigenvectors are arbitrary.
    fn equal_depths(&self, found: &Candidates<N>) -> [f64; N] {
        let mut betas = [0.0; N];
        for (beta, columns) in betas.iter_mut().zip(&found.columns) {
            *beta = columns[0][2];
        }
        self.scaled(betas)
    }

    /// The scale that fits the lengths best.
    fn scaled(&self, betas: [f64; N]) -> [f64; N] {
        let (mut along, mut square) = (0.0, 0.0);
        for (products, target) in self.pairs() {
            let value = quadratic(products, &betas);
            along += target * value;
            square += value * value;
        }
        let scale = libm::sqrt(along.abs() / square);
        if scale.is_finite() { betas.map(|b| scale * b) } else { betas }
    }

    fn gauss_newton(&self, mut betas: [f64; N]) -> [f64; N] {
        for _ in 0..STEPS {
            let mut h = [[0.0; N]; N];
            let mut g = [0.0; N];
            for (products, target) in self.pairs() {
                let mut row = [0.0; N];
                let mut value = 0.0;
                for k in 0..N {
                    for l in 0..N {
                        row[k] += products[k][l] * betas[l];
                    }
                    value += row[k] * betas[k];
                }
                for i in 0..N {
                    for k in 0..N {
                        h[i][k] += 4.0 * row[i] * row[k];
                    }
                    g[i] += 2.0 * row[i] * (target - value);
                }
            }
            // Three pairs cannot fix what the plane's third eigenvector adds: a touch of damping keeps it
            // small.
            let trace: f64 = (0..N).map(|i| h[i][i]).sum();
            for (i, row) in h.iter_mut().enumerate() {
                row[i] += 1e-9 * trace;
            }
            let Some(step) = cholesky_solve(h, g) else { break };
            let mut square = 0.0;
            for (beta, d) in betas.iter_mut().zip(step) {
                *beta += d;
                square += d * d;
            }
            if square < 1e-12 * betas.iter().map(|b| b * b).sum::<f64>() {
                break;
            }
        }
        betas
    }
}

fn quadratic<const N: usize>(products: &[[f64; N]; N], betas: &[f64; N]) -> f64 {
    let mut sum = 0.0;
    for k in 0..N {
        for l in 0..N {
            sum += products[k][l] * betas[k] * betas[l];
        }
    }
    sum
}

/// Solves `h x = g` for a small positive definite `h` by L D L^T.
fn cholesky_solve<const N: usize>(mut h: [[f64; N]; N], mut g: [f64; N]) -> Option<[f64; N]> {
    for k in 0..N {
        let pivot = h[k][k];
        // NaN fails the comparison.
        if !(pivot > 0.0 && pivot < f64::INFINITY) {
            return None;
        }
        for row in k + 1..N {
            let factor = h[row][k] / pivot;
            for i in k..N {
                h[row][i] -= factor * h[k][i];
            }
            g[row] -= factor * g[k];
        }
    }
    for row in (0..N).rev() {
        for i in row + 1..N {
            g[row] -= h[row][i] * g[i];
        }
        g[row] /= h[row][row];
    }
    g.iter().all(|x| x.is_finite()).then_some(g)
}
