//! From a target's plane to its carbody (thesis 3.4.2), and the few measures that the checks need.

use crate::parts::Target;

/// A vector in a carbody.
pub(crate) type Vector = [f64; 3];

pub(crate) fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(crate) fn norm(a: Vector) -> f64 {
    dot(a, a).sqrt()
}

fn cross(a: Vector, b: Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// a + k b
fn add(a: Vector, k: f64, b: Vector) -> Vector {
    [a[0] + k * b[0], a[1] + k * b[1], a[2] + k * b[2]]
}

fn unit(a: Vector) -> Vector {
    let norm = norm(a);
    a.map(|component| component / norm)
}

/// The target's axes u, v, w, made orthonormal: u keeps its direction, v its plane (Gram-Schmidt).
pub(crate) fn axes(target: &Target) -> [Vector; 3] {
    let u = unit(target.u);
    let v = unit(add(target.v, -dot(u, target.v), u));
    [u, v, cross(u, v)]
}

/// The target's circle centres in its carbody, mm.
pub(crate) fn points(target: &Target) -> Vec<Vector> {
    let [u, v, _] = axes(target);
    target.circles_mm.iter().map(|[a, b]| add(add(target.origin_mm, *a, u), *b, v)).collect()
}

/// Distance of two points.
pub(crate) fn distance(a: Vector, b: Vector) -> f64 {
    norm(add(a, -1.0, b))
}

/// Greatest distance of any point from the line through the two that are furthest apart, and the distance of
/// those two.
pub(crate) fn off_line(points: &[Vector]) -> (f64, f64) {
    let mut furthest = ([0.0; 3], [0.0; 3], 0.0);
    for (i, a) in points.iter().enumerate() {
        for b in &points[..i] {
            let apart = distance(*a, *b);
            if apart > furthest.2 {
                furthest = (*a, *b, apart);
            }
        }
    }
    let (a, b, apart) = furthest;
    if apart == 0.0 {
        return (0.0, 0.0);
    }
    let along = unit(add(b, -1.0, a));
    let off = points.iter().map(|point| norm(cross(along, add(*point, -1.0, a)))).fold(0.0, f64::max);
    (off, apart)
}
