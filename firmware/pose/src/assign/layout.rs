//! The targets as flat patterns: the circles of each in its own plane, and which targets are alike.

use heapless::Vec;
use nalgebra::{Matrix3, Vector3};

use crate::{Circle, MAX_CIRCLES};

/// Most circles of one target that its pattern is known by.
pub(crate) const MAX_PATTERN: usize = 12;
/// Fewest.
pub(crate) const MIN_PATTERN: usize = 4;
/// Most targets that are known by a pattern.
pub(crate) const MAX_PLATES: usize = MAX_CIRCLES / MIN_PATTERN;
/// Patterns alike to this share of a diameter are one.
const ALIKE: f64 = 0.02;

/// One target with its pattern.
#[derive(Clone, Debug)]
pub(crate) struct Plate {
    /// Number of its first circle.
    pub(crate) first: usize,
    /// Its first circle, mm.
    pub(crate) origin: Vector3<f64>,
    /// Columns: its axes in the carbody, e1 and e2 in its plane, e3 away from the camera. From the camera e1
    /// to e2 turns as u to v in the picture does.
    pub(crate) axes: Matrix3<f64>,
    /// The first plate that has the same pattern.
    pub(crate) kind: usize,
    /// Outer diameter, mm.
    pub(crate) outer_mm: f64,
    /// Circles in the plane, in diameters from the first.
    pub(crate) pattern: Vec<[f64; 2], MAX_PATTERN>,
}

/// All targets that have a pattern.
#[derive(Clone, Debug, Default)]
pub(crate) struct Layout {
    pub(crate) plates: Vec<Plate, MAX_PLATES>,
}

impl Layout {
    pub(crate) fn of(circles: &[Circle]) -> Self {
        let mut layout = Self::default();
        let mut first = 0;
        for target in circles.chunk_by(|a, b| a.target == b.target) {
            if let Some(mut plate) = plate(target, first) {
                plate.kind = layout.plates.len();
                if let Some(same) = layout.plates.iter().position(|other| is_alike(other, &plate)) {
                    plate.kind = same;
                }
                if layout.plates.push(plate).is_err() {
                    break;
                }
            }
            first += target.len();
        }
        layout
    }

    pub(crate) fn has_patterns(&self) -> bool {
        !self.plates.is_empty()
    }

    /// Circles of all patterns.
    pub(crate) fn circles(&self) -> usize {
        self.plates.iter().map(|plate| plate.pattern.len()).sum()
    }

    /// The first plate of every pattern.
    pub(crate) fn kinds(&self) -> impl Iterator<Item = (usize, &Plate)> {
        self.plates.iter().enumerate().filter(|(number, plate)| plate.kind == *number)
    }
}

impl Plate {
    /// Fewest circles by which it is known: a fifth or two of seven may be hidden.
    pub(crate) fn needed(&self) -> usize {
        (self.pattern.len() * 7 / 10).max(MIN_PATTERN)
    }

    /// A circle of the pattern on the plate, mm.
    pub(crate) fn flat(&self, circle: usize) -> Option<Vector3<f64>> {
        self.pattern.get(circle).map(|[a, b]| Vector3::new(a * self.outer_mm, b * self.outer_mm, 0.0))
    }
}

fn plate(circles: &[Circle], first: usize) -> Option<Plate> {
    let (one, two) = (circles.first()?, circles.get(1)?);
    let inwards = -one.normal;
    let along = two.point - one.point;
    let e1 = (along - inwards * along.dot(&inwards)).try_normalize(1e-9)?;
    let e2 = inwards.cross(&e1);
    let pattern: Vec<[f64; 2], MAX_PATTERN> = circles
        .iter()
        .take(MAX_PATTERN)
        .map(|circle| {
            let off = (circle.point - one.point) / one.outer_mm;
            [off.dot(&e1), off.dot(&e2)]
        })
        .collect();
    // On one line there is no plane.
    let width = pattern.iter().fold(0.0, |most: f64, [_, b]| most.max(b.abs()));
    let usable = pattern.len() >= MIN_PATTERN && width > 0.2 && one.outer_mm > 0.0;
    usable.then(|| Plate {
        first,
        origin: one.point,
        axes: Matrix3::from_columns(&[e1, e2, inwards]),
        kind: 0,
        outer_mm: one.outer_mm,
        pattern,
    })
}

fn is_alike(one: &Plate, other: &Plate) -> bool {
    let near = |a: &[f64; 2], b: &[f64; 2]| (a[0] - b[0]).abs() < ALIKE && (a[1] - b[1]).abs() < ALIKE;
    one.pattern.len() == other.pattern.len()
        && (one.outer_mm / other.outer_mm - 1.0).abs() < ALIKE
        && one.pattern.iter().zip(&other.pattern).all(|(a, b)| near(a, b))
}
