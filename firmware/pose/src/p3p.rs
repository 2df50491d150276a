//! Poses from three circles, up to four of them, exact for those three: the hypotheses of the robust search
//! and the start for so few circles that the linear methods are undetermined.
//!
//! The depths l along the unit rays fulfil three quadratic equations, the squared distances. Two combinations
//! of them without a constant term are conics in the plane of (l1 : l2 : l3); a degenerate conic of their
//! pencil is a pair of lines, and each line meets the other conic in two points (Persson and Nordberg 2018).

use heapless::Vec;

use crate::eigen;
use crate::geometry::Pose;
use crate::linear::{cross, dot};
use nalgebra::{Matrix3, Vector3};

type Conic = [[f64; 3]; 3];

/// All poses that put three points (mm) on their unit rays before the camera.
pub(crate) fn p3p(points: &[[f64; 3]; 3], rays: &[[f64; 3]; 3]) -> Vec<Pose, 4> {
    let mut poses = Vec::new();
    let squared = |i: usize, k: usize| {
        let d = [0, 1, 2].map(|c| points[i][c] - points[k][c]);
        dot(&d, &d)
    };
    let (a12, a13, a23) = (squared(0, 1), squared(0, 2), squared(1, 2));
    if !(a12 > 0.0 && a13 > 0.0 && a23 > 0.0) {
        return poses;
    }
    // l^T M_ik l = |l_i ray_i - l_k ray_k|^2 = a_ik.
    let form = |i: usize, k: usize| {
        let mut m = [[0.0; 3]; 3];
        (m[i][i], m[k][k]) = (1.0, 1.0);
        m[i][k] = -dot(&rays[i], &rays[k]);
        m[k][i] = m[i][k];
        m
    };
    let (m12, m13, m23) = (form(0, 1), form(0, 2), form(1, 2));
    let mut first = combine(&m12, 1.0 / a12, &m23, -1.0 / a23);
    let mut second = combine(&m13, 1.0 / a13, &m23, -1.0 / a23);
    // The conic with the larger determinant takes the cubic's leading place.
    if determinant(&first).abs() > determinant(&second).abs() {
        core::mem::swap(&mut first, &mut second);
    }
    let Some(share) = real_root(pencil(&first, &second)) else { return poses };
    let pair = combine(&first, 1.0, &second, share);
    let (values, vectors) = eigen::symmetric(pair);
    // e1 < 0 < e3, e2 = 0 up to rounding: sqrt(e3) (v3 . l) = +- sqrt(-e1) (v1 . l).
    let (minus, plus) = (libm::sqrt((-values[0]).max(0.0)), libm::sqrt(values[2].max(0.0)));
    for sign in [-1.0, 1.0] {
        let line = [0, 1, 2].map(|c| plus * vectors[2][c] + sign * minus * vectors[0][c]);
        // The middle eigenvector lies on both lines; a second point of this one stands across.
        let across = cross(&line, &vectors[1]);
        let norm = libm::sqrt(dot(&across, &across));
        if norm == 0.0 {
            continue;
        }
        let across = across.map(|c| c / norm);
        for depths in line_meets_conic(&vectors[1], &across, &second) {
            if let Some(pose) = pose_of_depths(points, rays, &depths, &m12, &m13, &m23, a12 + a13 + a23) {
                // Two lines with two points each: never more than four.
                let _ = poses.push(pose);
            }
        }
    }
    poses
}

/// The points `c p + s q` on a conic, of any scale.
fn line_meets_conic(p: &[f64; 3], q: &[f64; 3], conic: &Conic) -> Vec<[f64; 3], 2> {
    let (pp, pq, qq) = (bilinear(conic, p, p), bilinear(conic, p, q), bilinear(conic, q, q));
    // Rounding can turn a touching line into a missing one.
    let discriminant = (pq * pq - pp * qq).max(0.0);
    let root = libm::sqrt(discriminant);
    let t = if pq >= 0.0 { -pq - root } else { -pq + root };
    // Roots c : s of pp c^2 + 2 pq c s + qq s^2, without cancellation: t : pp and qq : t.
    let mut points = Vec::new();
    for (c, s) in [(t, pp), (qq, t)] {
        let point = [0, 1, 2].map(|i| c * p[i] + s * q[i]);
        if dot(&point, &point) > 0.0 {
            let _ = points.push(point);
        }
    }
    points
}

/// Scales the depths to the triangle's size and lays the triangle onto them.
fn pose_of_depths(
    points: &[[f64; 3]; 3],
    rays: &[[f64; 3]; 3],
    depths: &[f64; 3],
    m12: &Conic,
    m13: &Conic,
    m23: &Conic,
    size: f64,
) -> Option<Pose> {
    let sum = bilinear(m12, depths, depths) + bilinear(m13, depths, depths) + bilinear(m23, depths, depths);
    let scale = libm::sqrt(size / sum) * if depths[0] < 0.0 { -1.0 } else { 1.0 };
    let depths = depths.map(|l| scale * l);
    if !depths.iter().all(|l| *l > 0.0 && *l < f64::INFINITY) {
        return None;
    }
    let mut seen = [[0.0; 3]; 3];
    for i in 0..3 {
        seen[i] = rays[i].map(|c| depths[i] * c);
    }
    let (from, to) = (frame(points)?, frame(&seen)?);
    let rotation = to * from.transpose();
    let middle = |p: &[[f64; 3]; 3]| (Vector3::from(p[0]) + Vector3::from(p[1]) + Vector3::from(p[2])) / 3.0;
    let pose = Pose { rotation, translation: middle(&seen) - rotation * middle(points) };
    pose.is_rigid().then_some(pose)
}

/// Orthonormal axes of a triangle; `None` where it is a line.
fn frame(p: &[[f64; 3]; 3]) -> Option<Matrix3<f64>> {
    let [a, b, c] = p.map(Vector3::from);
    let x = (b - a).try_normalize(0.0)?;
    let z = x.cross(&(c - a)).try_normalize(0.0)?;
    Some(Matrix3::from_columns(&[x, z.cross(&x), z]))
}

fn combine(a: &Conic, s: f64, b: &Conic, t: f64) -> Conic {
    let mut sum = [[0.0; 3]; 3];
    for i in 0..3 {
        for k in 0..3 {
            sum[i][k] = s * a[i][k] + t * b[i][k];
        }
    }
    sum
}

fn bilinear(m: &Conic, a: &[f64; 3], b: &[f64; 3]) -> f64 {
    m.iter().zip(a).map(|(row, x)| x * dot(row, b)).sum()
}

fn determinant(m: &Conic) -> f64 {
    dot(&m[0], &cross(&m[1], &m[2]))
}

/// Coefficients of det(a + g b), constant first.
fn pencil(a: &Conic, b: &Conic) -> [f64; 4] {
    let mixed = |m: &Conic, n: &Conic| {
        dot(&n[0], &cross(&m[1], &m[2])) + dot(&m[0], &cross(&n[1], &m[2])) + dot(&m[0], &cross(&m[1], &n[2]))
    };
    [determinant(a), mixed(a, b), mixed(b, a), determinant(b)]
}

/// A real root of a cubic (constant first), by bisection between the bounds of its roots and Newton's method.
fn real_root([c0, c1, c2, c3]: [f64; 4]) -> Option<f64> {
    let value = |g: f64| ((c3 * g + c2) * g + c1) * g + c0;
    // Cauchy's bound.
    let bound = 1.0 + (c0.abs().max(c1.abs()).max(c2.abs())) / c3.abs();
    if !bound.is_finite() {
        return None;
    }
    let rising = c3 > 0.0;
    let (mut low, mut high) = (-bound, bound);
    let mut g = -c2 / (3.0 * c3);
    for _ in 0..100 {
        let f = value(g);
        if (f > 0.0) == rising {
            high = g
        } else {
            low = g
        }
        let newton = g - f / ((3.0 * c3 * g + 2.0 * c2) * g + c1);
        // NaN and steps that leave the bracket are halved instead.
        let next = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
        if (next - g).abs() <= 1e-15 * g.abs() || f == 0.0 {
            break;
        }
        g = next;
    }
    g.is_finite().then_some(g)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rotation;

    #[test]
    fn the_true_pose_is_among_those_of_three_points() {
        let points = [[0.0, 85.0, 508.0], [0.0, -620.0, 330.0], [900.0, 90.0, -250.0]];
        for step in 0..100 {
            let s = f64::from(step);
            let truth = Pose {
                rotation: Matrix3::new(0.0, -1.0, 0.0, 0.0, 0.0, -1.0, 1.0, 0.0, 0.0)
                    * rotation(libm::sin(s) * 0.3, libm::cos(1.7 * s) * 0.4, libm::sin(2.3 * s) * 0.5),
                translation: Vector3::new(300.0 * libm::sin(3.0 * s), 100.0, 1600.0 + 30.0 * s),
            };
            let rays = points.map(|p| truth.transform(&Vector3::from(p)).normalize().into());
            let found = p3p(&points, &rays);
            let nearest = found
                .iter()
                .map(|p| (p.translation - truth.translation).norm())
                .fold(f64::INFINITY, f64::min);
            // A double root (the danger cylinder) costs half the digits.
            assert!(nearest < 1e-3, "step {step}: {nearest} mm off, {} found", found.len());
        }
    }
}
