//! The ring's radial profile: what pixels of one radius have in common tells its levels, radii and blur, and
//! how they differ from one side to the other its centre and the light's slope, roughly.
//!
//! Pixels are sorted by radius, half a pixel a cell, and by quadrant of their direction; a cell knows the
//! mean radius and value of its own.

mod disc;
mod lean;

use multiversion::multiversion;

use crate::edge::{HALF_WIDTH, PEAK, edge};
use crate::lanes::{BLOCK, Column, LANES, Lanes, RUNS};

pub(crate) use lean::Lean;

/// Quadrants of the direction from the centre: bit 0 is set where x is negative, bit 1 where y is.
const QUADRANTS: usize = 4;

/// Rings of cells, those of 1 px, and the parts of one in which radii are counted.
const RINGS: usize = 256;
const PER_PX: f32 = 2.0;
const PARTS: u32 = 64;

/// Cells, those of a quadrant together.
const CELLS: usize = QUADRANTS * RINGS;

/// Radii beyond this are taken for it, px: no ring in a window is as large.
const FARTHEST_PX: f32 = 120.0;

/// A cell counts its pixels in the upper 16 bits, sums the parts of their radii in the next 16 and their
/// values in the lower 32. At the largest radius a ring has 400 pixels, so even four quadrants together do
/// not overflow.
const UPPER: u32 = 32;
const COUNT: u32 = 1 << 16;

/// Adding this to a float of less leaves the rounded number in its last bits.
const TO_BITS: f32 = 8_388_608.0;

/// How far pixels of a cell are from its mean radius, px, as a standard deviation: where the brighter of them
/// are clipped their mean says nothing.
const REACH_PX: f32 = 0.15;

/// Pixels of a ring whose mean is a level.
const ENOUGH: f32 = 4.0;

/// How far Gauss-Newton goes.
pub(crate) struct Passes {
    most: usize,
    /// Steps of the radii and of the half width, shares of the half width, below which a pass is the last:
    /// the next one's would be of their square.
    radii: f64,
    width: f64,
}

/// From a start within a third of a pixel and a factor of two in the blur; and from what that gave.
pub(crate) const ROUGH: Passes = Passes { most: 5, radii: 0.1, width: 0.2 };
pub(crate) const FINE: Passes = Passes { most: 2, radii: 0.03, width: 0.06 };
/// Under clipped white the level, radii and blur follow from what is left of the edges, and slowly.
const CLIPPED: Passes = Passes { most: 24, radii: 0.001, width: 0.001 };

/// Share of an edge's half width from which on dark beyond the white is told from the edge.
const SEEN: f64 = 0.3;

/// How far before the first ring that is seen to be dark pixels are left out, standard deviations of the
/// blur: what leaks further in is less than their noise.
const LEAKING: f64 = 0.65;

/// Share of its diagonal that is added to the normal matrix: levels, radii and blur of a small blurred ring
/// can hardly be told apart, and need not be.
const RIDGE: f64 = 1e-3;

/// How well the inner radius is known from the outer one, px, by printing and by the edge's shape; and the
/// noise of a pixel that this is weighed against, share of the white.
const RATIO_PX: f64 = 0.1;
const USUAL_NOISE: f64 = 0.01;

/// Bounds of the blur's standard deviation, px: the pixel's own area gives 0.29; and largest step of a pass.
const BLUR: (f64, f64) = (0.35, 2.0);
const LARGEST_STEP_PX: f64 = 1.0;

/// Levels, radii and blur of a ring, in the plane where its outer ellipse is a circle of its own area.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Radial {
    /// Level of the white at the centre.
    pub(crate) white: f64,
    /// White less black.
    pub(crate) contrast: f64,
    /// Radii of the edges, px; the inner one of a disc is [`NO_EDGE`].
    pub(crate) outer: f64,
    pub(crate) inner: f64,
    /// Standard deviation of the edges' blur, px.
    pub(crate) blur: f64,
}

/// Radius of an inner edge that is not there: no pixel is near it.
pub(crate) const NO_EDGE: f64 = -1e4;

impl Radial {
    /// Whether there is only an outer edge: a disc.
    pub(crate) fn is_disc(&self) -> bool {
        self.inner < 0.0
    }

    /// Whether levels and radii are those of a black ring on white or of a bright disc on dark. Not a number
    /// is neither.
    fn is_sound(&self) -> bool {
        if self.is_disc() {
            self.contrast < 0.0 && self.outer > 0.0
        } else {
            self.contrast > 0.0 && self.inner > 0.5 && self.outer > self.inner
        }
    }

    /// Length of the edges, px.
    pub(crate) fn edges_px(&self) -> f64 {
        core::f64::consts::TAU * (self.outer + self.inner.max(0.0))
    }

    /// Radius half way between the edges, px.
    pub(crate) fn middle(&self) -> f64 {
        0.5 * (self.outer + self.inner)
    }

    /// Half the width of an edge, px.
    pub(crate) fn half_width(&self) -> f64 {
        HALF_WIDTH * self.blur
    }

    /// The same with blur of less variance by `square`, px^2.
    pub(crate) fn less_blur(&self, square: f64) -> Self {
        let least = BLUR.0 * BLUR.0;
        Self { blur: libm::sqrt((self.blur * self.blur - square).max(least)), ..*self }
    }

    /// Change of a pixel's value where an edge is steepest and moves by 1 px.
    pub(crate) fn peak(&self) -> f64 {
        PEAK * self.contrast / self.half_width()
    }

    /// Share of the outer edge in the length of both, and so in the information on the centre.
    pub(crate) fn outer_share(&self) -> f64 {
        self.outer / (self.outer + self.inner.max(0.0))
    }
}

/// The profile with its working memory.
pub(crate) struct Profile {
    cells: [u64; CELLS],
    /// Rings in use.
    used: usize,
    /// Mean radius and value of a ring's pixels, and how many they are.
    radius: [f32; RINGS],
    value: [f32; RINGS],
    count: [f32; RINGS],
    /// Share of them by which more are on the right than on the left, and below than above.
    right: [f32; RINGS],
    below: [f32; RINGS],
}

/// Where the pixels of a block are in the circle's plane: direction from the centre, and distance, px.
pub(crate) struct Places {
    pub(crate) x: Column,
    pub(crate) y: Column,
    pub(crate) radius: Column,
}

impl Places {
    pub(crate) fn new() -> Self {
        let zero = [0.0; BLOCK];
        Self { x: zero, y: zero, radius: zero }
    }

    /// Takes pixels from number `count` on out of every profile.
    pub(crate) fn forget_from(&mut self, count: usize) {
        self.radius.get_mut(count..).unwrap_or_default().fill(FARTHEST_PX);
    }
}

/// Pixels that count, derivatives of the profile and residuals, of a block of rings.
struct Terms {
    count: Column,
    rows: [Column; EVEN],
    residual: Column,
}

/// Unknowns of the profile: white, contrast, outer and inner radius, half width.
const EVEN: usize = 5;
/// Upper triangle of their normal matrix, and the right-hand side.
const EVEN_SUMS: usize = EVEN * (EVEN + 1) / 2 + EVEN;
/// Those of the first two rows, and of the others: as many as fit into a processor's vectors.
const UPPER_SUMS: usize = 2 * EVEN + 1;
const LOWER_SUMS: usize = EVEN_SUMS - UPPER_SUMS;

impl Profile {
    pub(crate) const fn new() -> Self {
        let zero = [0.0; RINGS];
        Self { cells: [0; CELLS], used: 0, radius: zero, value: zero, count: zero, right: zero, below: zero }
    }

    /// Starts over, for pixels up to `end` px from the centre.
    pub(crate) fn clear(&mut self, end: f64) {
        let rings = (end * f64::from(PER_PX)) as usize + 2;
        self.used = rings.next_multiple_of(LANES).min(RINGS);
        let used = self.used;
        self.quadrants_mut().iter_mut().for_each(|cells| cells.get_mut(..used).unwrap_or_default().fill(0));
    }

    fn quadrants(&self) -> &[[u64; RINGS]] {
        self.cells.as_chunks().0
    }

    fn quadrants_mut(&mut self) -> &mut [[u64; RINGS]] {
        self.cells.as_chunks_mut().0
    }

    /// Adds the pixels of a block.
    pub(crate) fn add(&mut self, places: &Places, values: &[u16; BLOCK]) {
        let (mut cells, mut more) = ([0; BLOCK], [[0; 2]; BLOCK]);
        sort(places, values, &mut cells, &mut more);
        for i in 0..BLOCK {
            let sum = &mut self.cells[cells[i] as usize % CELLS];
            let [lower, upper] = more[i];
            *sum = sum.wrapping_add(u64::from(upper) << UPPER | u64::from(lower));
        }
    }

    /// Makes the profile of the cells.
    pub(crate) fn close(&mut self) {
        for ring in 0..self.used.min(RINGS) {
            let cells = [0, 1, 2, 3].map(|k| self.cells[k * RINGS + ring]);
            let sum = cells.iter().fold(0u64, |sum, cell| sum.wrapping_add(*cell));
            let (count, parts, value) = unpacked(sum);
            let per_count = if count > 0.0 { 1.0 / count } else { 0.0 };
            let [a, b, c, d] = cells.map(|cell| ((cell >> UPPER) as u32 / COUNT) as i32);
            self.right[ring] = (a - b + c - d) as f32 * per_count;
            self.below[ring] = (a + b - c - d) as f32 * per_count;
            self.count[ring] = count;
            self.radius[ring] = (ring as i32 as f32 + parts * per_count / PARTS as f32) / PER_PX;
            self.value[ring] = value * per_count;
        }
    }

    /// The darkest and the brightest ring up to `end` px; `None` where there are none of enough pixels.
    pub(crate) fn extremes(&self, end: f64) -> Option<(f64, f64)> {
        let (mut least, mut most) = (f32::INFINITY, 0.0_f32);
        let rings = (end * f64::from(PER_PX)) as usize;
        for (value, count) in self.value.iter().zip(&self.count).take(rings.min(self.used)) {
            if *count >= ENOUGH {
                (least, most) = (least.min(*value), most.max(*value));
            }
        }
        (least < most).then_some((f64::from(least), f64::from(most)))
    }

    /// Fits levels, radii and blur to the rings up to `end` px that are darker than `saturated`, from a
    /// start. The ratio of the radii is expected to be that of the ring. `None` where the pixels do not
    /// determine a ring.
    pub(crate) fn fit(
        &self,
        start: &Radial,
        ratio: f64,
        (end, saturated): (f64, f64),
        passes: &Passes,
    ) -> Option<Radial> {
        let mut radial = *start;
        let zero = [0.0; BLOCK];
        let mut terms = Terms { count: zero, rows: [zero; EVEN], residual: zero };
        let passes = if saturated < f64::INFINITY { &CLIPPED } else { passes };
        let rings = ((end * f64::from(PER_PX)) as usize + 1).min(self.used);
        for _ in 0..passes.most {
            let (mut upper, mut lower) = ([Lanes::ZERO; UPPER_SUMS], [Lanes::ZERO; LOWER_SUMS]);
            let kernel = Kernel::new(&radial);
            let limits = (end as f32, saturated as f32);
            let columns = self.radius.as_chunks().0.iter().zip(self.value.as_chunks().0);
            let blocks = columns.zip(self.count.as_chunks().0);
            for (((radius, value), count), first) in blocks.zip((0..rings).step_by(BLOCK)) {
                compare(&kernel, radius, value, count, limits, &mut terms);
                add_products::<0, 2, UPPER_SUMS>(&terms, rings - first, &mut upper);
                add_products::<2, EVEN, LOWER_SUMS>(&terms, rings - first, &mut lower);
            }
            let mut sums = [0.0; EVEN_SUMS];
            sums.iter_mut().zip(upper.iter().chain(&lower)).for_each(|(sum, lanes)| *sum = lanes.sum());
            if radial.is_disc() {
                disc::hold(&mut sums, &radial, saturated);
            } else {
                expect_ratio(&mut sums, &radial, ratio);
            }
            let step = solve(&sums)?;
            let bounded = |step: f64| step.clamp(-LARGEST_STEP_PX, LARGEST_STEP_PX);
            radial.white += step[0];
            radial.contrast += step[1];
            radial.outer += bounded(step[2]);
            radial.inner += bounded(step[3]);
            radial.blur = (radial.blur + bounded(step[4]) / HALF_WIDTH).clamp(BLUR.0, BLUR.1);
            if !radial.is_sound() {
                return None;
            }
            let [radii, width] = [step[2].abs().max(step[3].abs()), step[4].abs()];
            if radii < passes.radii * radial.half_width() && width < passes.width * radial.half_width() {
                break;
            }
        }
        Some(radial)
    }

    /// Radius up to which it is white around the ring, px: the sheet's edge, a neighbour or a post makes a
    /// ring of cells darker than the profile by more than `share` of the contrast. Saturated white is darker
    /// than the profile and no sheet's edge.
    pub(crate) fn white_end(&self, radial: &Radial, share: f64, saturated: f64) -> f64 {
        let kernel = Kernel::new(radial);
        let (most, saturated, reach) = ((share * radial.contrast) as f32, saturated as f32, kernel.reach());
        let from = ((radial.outer + SEEN * radial.half_width()) * f64::from(PER_PX)) as usize;
        let columns = self.radius.iter().zip(&self.value).zip(&self.count).take(self.used).skip(from);
        let mut dark = columns.map(|((radius, value), count)| {
            if *count == 0.0 {
                return false;
            }
            // Nearer to the edge the profile itself is less well known.
            let (steep, _, covered) = kernel.at(*radius);
            let most = most * (1.0 + 3.0 * steep);
            let is_darker = kernel.white - kernel.contrast * covered - *value > most;
            is_darker && *value + reach * steep < saturated
        });
        let Some(first) = dark.position(|dark| dark) else { return f64::INFINITY };
        (from + first) as f64 / f64::from(PER_PX) - LEAKING * radial.blur
    }
}

/// Count, sum of parts and sum of values of a cell.
#[inline(always)]
fn unpacked(cell: u64) -> (f32, f32, f32) {
    let upper = (cell >> UPPER) as u32;
    ((upper / COUNT) as i32 as f32, (upper % COUNT) as i32 as f32, cell as u32 as i32 as f32)
}

/// The cell of every pixel and what it adds to its lower and upper half.
#[multiversion(targets("x86_64+avx2"))]
#[inline(never)]
fn sort(places: &Places, values: &[u16; BLOCK], cells: &mut [u32; BLOCK], more: &mut [[u32; 2]; BLOCK]) {
    for i in 0..BLOCK {
        let radius = places.radius[i];
        let far = if radius < FARTHEST_PX { radius } else { FARTHEST_PX };
        let parts = (far * (PER_PX * PARTS as f32) + TO_BITS).to_bits() & (RINGS as u32 * PARTS - 1);
        let left = if places.x[i] < 0.0 { 1 } else { 0 };
        let above = if places.y[i] < 0.0 { 2 } else { 0 };
        cells[i] = (left | above) * RINGS as u32 + parts / PARTS;
        more[i] = [u32::from(values[i]), COUNT + parts % PARTS];
    }
}

/// A profile made ready for rings of cells.
struct Kernel {
    outer: f32,
    inner: f32,
    per_width: f32,
    white: f32,
    contrast: f32,
}

impl Kernel {
    fn new(radial: &Radial) -> Self {
        // A cell's own width blurs too: a uniform density.
        let cell = 1.0 / (12.0 * f64::from(PER_PX * PER_PX));
        let blur = libm::sqrt(radial.blur * radial.blur + cell);
        Self {
            outer: radial.outer as f32,
            inner: radial.inner as f32,
            per_width: (1.0 / (HALF_WIDTH * blur)) as f32,
            white: radial.white as f32,
            contrast: radial.contrast as f32,
        }
    }

    /// Change of the value where an edge is steepest, a px.
    fn per_px(&self) -> f32 {
        self.contrast * PEAK as f32 * self.per_width
    }

    /// Steepness of the outer and the inner edge and share that the ring covers, at a radius.
    #[inline(always)]
    fn at(&self, radius: f32) -> (f32, f32, f32) {
        let (outer, outer_sum) = edge((radius - self.outer) * self.per_width);
        let (inner, inner_sum) = edge((radius - self.inner) * self.per_width);
        (outer, inner, inner_sum - outer_sum)
    }

    /// How much brighter a cell's pixels are than its mean where an edge is steepest. Of a clipped disc all
    /// is taken that can be: it has little.
    fn reach(&self) -> f32 {
        REACH_PX * self.per_px().max(0.0)
    }
}

/// Not inlined: so the compiler makes one loop over whole vectors of it.
#[multiversion(targets("x86_64+avx2"))]
#[inline(never)]
fn compare(
    kernel: &Kernel,
    radius: &Column,
    value: &Column,
    count: &Column,
    (end, saturated): (f32, f32),
    terms: &mut Terms,
) {
    let (per_px, reach) = (kernel.per_px(), kernel.reach());
    for i in 0..BLOCK {
        let (outer, inner, covered) = kernel.at(radius[i]);
        let by_outer = -per_px * outer;
        let by_inner = per_px * inner;
        let width = by_outer * (radius[i] - kernel.outer) + by_inner * (radius[i] - kernel.inner);
        terms.rows[0][i] = 1.0;
        terms.rows[1][i] = -covered;
        terms.rows[2][i] = by_outer;
        terms.rows[3][i] = by_inner;
        terms.rows[4][i] = width * kernel.per_width;
        let brightest = value[i] + reach * (outer + inner);
        terms.count[i] = if (radius[i] < end) & (brightest < saturated) { count[i] } else { 0.0 };
        terms.residual[i] = value[i] - (kernel.white - kernel.contrast * covered);
    }
}

/// Rows `FROM` up to `TO` of the normal equations, by the first `rings` of a block. Not inlined, with a copy
/// of the sums: so the compiler keeps them in vectors.
#[multiversion(targets("x86_64+avx2"))]
#[inline(never)]
fn add_products<const FROM: usize, const TO: usize, const N: usize>(
    terms: &Terms,
    rings: usize,
    sums: &mut [Lanes; N],
) {
    let mut sum = *sums;
    for i in 0..rings.div_ceil(LANES).min(RUNS) {
        let at = |column: &Column| Lanes::load(column, i);
        let mut next = 0;
        for k in FROM..TO {
            let counted = at(&terms.rows[k]) * at(&terms.count);
            for j in k..EVEN {
                sum[next] += counted * at(&terms.rows[j]);
                next += 1;
            }
            sum[next] += counted * at(&terms.residual);
            next += 1;
        }
    }
    *sums = sum;
}

/// Adds what is known of the ring to the normal equations: the ratio of its radii. Where blur joins both
/// edges, pixels tell a thin black ring from a thicker one that is less black by nothing else.
fn expect_ratio(sums: &mut [f64; EVEN_SUMS], radial: &Radial, ratio: f64) {
    let noise = USUAL_NOISE * radial.white;
    let weight = noise * noise / (RATIO_PX * RATIO_PX);
    let (off, share) = (radial.outer / ratio - radial.inner, 1.0 / ratio);
    let [outer_square, both, outer, inner_square, inner] = [11, 12, 14, 15, 17];
    sums[outer_square] += weight * share * share;
    sums[both] -= weight * share;
    sums[outer] -= weight * share * off;
    sums[inner_square] += weight;
    sums[inner] += weight * off;
}

/// Solves the normal equations by Cholesky's method without square roots.
fn solve(sums: &[f64; EVEN_SUMS]) -> Option<[f64; EVEN]> {
    // Rows of the upper triangle, each with its right-hand side behind it.
    let mut rows = [[0.0; EVEN + 1]; EVEN];
    let mut next = sums.iter();
    for k in 0..EVEN {
        for j in k..=EVEN {
            rows[k][j] = *next.next()?;
        }
        rows[k][k] *= 1.0 + RIDGE;
    }
    let mut per_pivot = [0.0; EVEN];
    for k in 0..EVEN {
        // NaN fails the comparison.
        if !(rows[k][k] > 0.0 && rows[k][k] < f64::INFINITY) {
            return None;
        }
        per_pivot[k] = 1.0 / rows[k][k];
        for i in k + 1..EVEN {
            let share = rows[k][i] * per_pivot[k];
            for j in i..=EVEN {
                rows[i][j] -= share * rows[k][j];
            }
        }
    }
    let mut solution = [0.0; EVEN];
    for k in (0..EVEN).rev() {
        let known = (k + 1..EVEN).fold(rows[k][EVEN], |sum, i| sum - rows[k][i] * solution[i]);
        solution[k] = known * per_pivot[k];
    }
    Some(solution)
}
