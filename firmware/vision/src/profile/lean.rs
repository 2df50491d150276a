//! What the two sides of the profile say: roughly how far its centre is off, and how the light slopes; and
//! the profile about a better centre.

use core::ops::Range;

use multiversion::multiversion;

use super::{Kernel, PARTS, PER_PX, Profile, QUADRANTS, RINGS, Radial, unpacked};
use crate::lanes::{BLOCK, Column, LANES, Lanes, RUNS};

/// Mean of a direction's coordinate over a quadrant.
const SIDE: f64 = core::f64::consts::FRAC_2_PI;

/// Share of the white's slope that its sides tell beside their means at the least.
const LEAST_TOLD: f64 = 0.2;

/// What the two sides of the profile say.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lean {
    /// What is to be added to the centre, in the circle's plane, px.
    pub(crate) step: [f64; 2],
    /// Slope of the white along x and y, a px, as the white around the ring tells it, and the information in
    /// it: one over its variance for noise of variance 1.
    pub(crate) white_slope: [f64; 2],
    pub(crate) white_information: f64,
}

impl Profile {
    /// What the sides say of centre and slope, for a profile that is known. `around` are the radii of the
    /// white around the ring, px: nothing beyond it counts, and nothing above a level of saturation.
    pub(crate) fn lean(&self, radial: &Radial, around: &Range<f64>, saturated: f64) -> Lean {
        let kernel = Kernel::new(radial);
        let mut sums = Sides { squares: [Lanes::ZERO; SQUARES], quadrants: [[Lanes::ZERO; 2]; QUADRANTS] };
        let mut rings = Rings::new();
        for first in (0..self.used).step_by(BLOCK) {
            weigh_rings(&kernel, first, (around, saturated), &mut rings);
            if let (Some(radius), Some(value)) = (block(&self.radius, first), block(&self.value, first)) {
                rings.compare_with_mean(first, radius, value);
            }
            for (cells, quadrant) in self.quadrants().iter().zip(&mut sums.quadrants) {
                if let Some(cells) = block(cells, first) {
                    add_sides(cells, &rings, self.used - first, quadrant, &mut sums.squares);
                }
            }
        }
        // Half of the squared directions lie along x, half along y.
        let per_px = f64::from(kernel.per_px());
        let [square, cross, white_steep, information] = sums.squares.map(|sum| 0.5 * sum.sum());
        let [steep, white] = [0, 1].map(|k| sides(&sums.quadrants.map(|quadrant| quadrant[k].sum())));
        // The mean takes with it what both sides have in common.
        let white_square = information.max(1.0);
        let told = self.lopsided(around).map(|square| (1.0 - square / white_square).max(LEAST_TOLD));
        let white = [0, 1].map(|i| white[i] / told[i]);
        // What is left of the edge in the white follows the centre.
        let determinant = square * white_square - cross * white_steep;
        Lean {
            step: [0, 1].map(|i| (white_square * steep[i] - cross * white[i]) / (determinant * per_px)),
            white_slope: [0, 1].map(|i| (square * white[i] - white_steep * steep[i]) / determinant),
            // Less than the pixels', for a quadrant's all count by its mean direction.
            white_information: SIDE * SIDE * information * (told[0] + told[1]),
        }
    }

    /// Takes out of the rings' means what they owe to a centre that is off by `step`, px: few rows see more
    /// of one side than of the other.
    pub(crate) fn centre(&mut self, radial: &Radial, step: [f64; 2]) {
        let kernel = Kernel::new(radial);
        let step = step.map(|step| (SIDE * step) as f32 * kernel.per_px());
        for first in (0..self.used).step_by(BLOCK) {
            let value = self.value.get_mut(first..).and_then(|rings| rings.first_chunk_mut());
            if let (Some(radius), Some(right), Some(below), Some(value)) =
                (block(&self.radius, first), block(&self.right, first), block(&self.below, first), value)
            {
                centre_rings(&kernel, step, radius, (right, below), value);
            }
        }
    }

    /// Squares of the slope, along x and y, that the means of white rings take with them: few rows see more
    /// of one side than of the other.
    fn lopsided(&self, around: &Range<f64>) -> [f64; 2] {
        let mut sums = [0.0; 2];
        let [from, to] = [around.start, around.end].map(|at| (at * f64::from(PER_PX) + 0.5) as usize);
        for ring in from..to.min(self.used).min(RINGS) {
            let count = self.count[ring];
            if count > 0.0 {
                let square = self.radius[ring] * self.radius[ring] * count;
                for (sum, more) in sums.iter_mut().zip([self.right[ring], self.below[ring]]) {
                    *sum += 0.5 * more * more * square;
                }
            }
        }
        sums.map(f64::from)
    }
}

/// Squares of the steepness, of it with the slope and with the slope of the white alone, and of the latter.
const SQUARES: usize = 4;

/// Sums of both sides: these squares, and for every quadrant residuals times steepness and times slope of the
/// white alone.
struct Sides {
    squares: [Lanes; SQUARES],
    quadrants: [[Lanes; 2]; QUADRANTS],
}

/// What a block of rings of cells has in common: the model's value at their beginning, their own mean there,
/// the change of both with a part, the model's change as centre and slope change, and the latter in the white
/// alone.
struct Rings {
    model: Column,
    mean: Column,
    by_part: Column,
    steep: Column,
    slope: Column,
    white: Column,
}

impl Rings {
    fn new() -> Self {
        let zero = [0.0; BLOCK];
        Self { model: zero, mean: zero, by_part: zero, steep: zero, slope: zero, white: zero }
    }

    /// Compares sides with the mean of all of them, at the rings' mean radii: few rows see more of one side
    /// than of the other, and what the profile does not explain would lean to that side.
    fn compare_with_mean(&mut self, first: usize, radius: &Column, value: &Column) {
        for i in 0..BLOCK {
            let part = (radius[i] * PER_PX - (first + i) as i32 as f32) * PARTS as f32;
            self.mean[i] = value[i] - part * self.by_part[i];
        }
    }
}

/// A block of what is known of all rings.
fn block<T>(rings: &[T; RINGS], first: usize) -> Option<&[T; BLOCK]> {
    rings.get(first..)?.first_chunk()
}

/// Not inlined, as [`super::sort`]: so the compiler makes one loop over whole vectors of it.
#[multiversion(targets("x86_64+avx2"))]
#[inline(never)]
fn add_sides(
    cells: &[u64; BLOCK],
    rings: &Rings,
    used: usize,
    quadrant: &mut [Lanes; 2],
    squares: &mut [Lanes; SQUARES],
) {
    for i in 0..used.div_ceil(LANES).min(RUNS) {
        let at = |column: &Column| Lanes::load(column, i);
        let cell: [_; LANES] = core::array::from_fn(|lane| unpacked(cells[LANES * i + lane]));
        let (count, parts) = (Lanes::of(cell.map(|cell| cell.0)), Lanes::of(cell.map(|cell| cell.1)));
        let value = Lanes::of(cell.map(|cell| cell.2));
        let (steep, slope, white) = (at(&rings.steep), at(&rings.slope), at(&rings.white));
        let value = value - parts * at(&rings.by_part);
        quadrant[0] += steep * (value - count * at(&rings.model));
        quadrant[1] += white * (value - count * at(&rings.mean));
        let counted = steep * count;
        squares[0] += counted * steep;
        squares[1] += counted * slope;
        squares[2] += counted * white;
        squares[3] += white * white * count;
    }
}

/// What the rings of cells from number `first` on have in common.
#[multiversion(targets("x86_64+avx2"))]
#[inline(never)]
fn weigh_rings(kernel: &Kernel, first: usize, (around, saturated): (&Range<f64>, f64), rings: &mut Rings) {
    let (white_from, end, saturated) = (around.start as f32, around.end as f32, saturated as f32);
    let (depth, per_px) = (kernel.contrast / kernel.white, kernel.per_px());
    let (per_part, reach) = (per_px / (PER_PX * PARTS as f32), kernel.reach());
    for i in 0..BLOCK {
        // The middle of the cells.
        let radius = ((first + i) as i32 as f32 + 0.5) / PER_PX;
        let (outer, inner, covered) = kernel.at(radius);
        let model = kernel.white - kernel.contrast * covered;
        let by_part = per_part * (outer - inner);
        let brightest = model + reach * (outer + inner);
        let counts = if (brightest < saturated) & (radius < end) { 1.0 } else { 0.0 };
        rings.model[i] = model - 0.5 * PARTS as f32 * by_part;
        rings.by_part[i] = by_part;
        rings.steep[i] = (inner - outer) * counts;
        rings.slope[i] = radius * (1.0 - depth * covered) * counts;
        rings.white[i] = if radius > white_from { rings.slope[i] } else { 0.0 };
    }
}

/// Means of a block of rings about a centre that is `step` further on. Not inlined, as [`super::sort`].
#[multiversion(targets("x86_64+avx2"))]
#[inline(never)]
fn centre_rings(
    kernel: &Kernel,
    step: [f32; 2],
    radius: &Column,
    (right, below): (&Column, &Column),
    value: &mut Column,
) {
    for i in 0..BLOCK {
        let (outer, inner, _) = kernel.at(radius[i]);
        value[i] += (outer - inner) * (step[0] * right[i] + step[1] * below[i]);
    }
}

/// Sums over quadrants as the least squares' sides of x and of y.
fn sides(sums: &[f64; QUADRANTS]) -> [f64; 2] {
    let [a, b, c, d] = *sums;
    // Weighted as if every pixel had its quadrant's mean direction, whose square is less than that of single
    // pixels.
    [a - b + c - d, a + b - c - d].map(|sum| 0.5 / SIDE * sum)
}

#[cfg(test)]
mod tests;
