//! Connected components of the binary window (thesis 3.2.5): dark 8-connected, bright 4-connected, by runs and
//! union-find in one walk over the rows, with area and centroid of each.

use crate::MAX_SIDE;
use crate::bits::Bits;

/// Most runs of one colour in a window. A window full of rings and clutter has a few hundred.
const MAX_RUNS: usize = 4096;

/// Most components of one colour before those that meet further down are united.
const MAX_PARTS: usize = 1024;

/// A window has too many runs or components for the tables: noise, not a picture of rings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Clutter;

/// A horizontal run of pixels of one colour.
#[derive(Clone, Copy, Debug)]
struct Run {
    y: u8,
    start: u8,
    /// One beyond the last pixel.
    end: u8,
    part: u16,
}

/// Area, first moments and bounding box of a component.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Part {
    /// Pixels.
    pub(crate) area: u32,
    sum_x: u32,
    sum_y: u32,
    /// First column and row.
    pub(crate) low: [u8; 2],
    /// Last column and row.
    pub(crate) high: [u8; 2],
}

impl Part {
    const EMPTY: Self = Self { area: 0, sum_x: 0, sum_y: 0, low: [u8::MAX; 2], high: [0; 2] };

    #[inline(always)]
    fn add_run(&mut self, y: u8, start: u8, end: u8) {
        let length = u32::from(end - start);
        self.area += length;
        // start + ... + (end - 1)
        self.sum_x += length * (u32::from(start) + u32::from(end) - 1) / 2;
        self.sum_y += length * u32::from(y);
        // Rows come from the top.
        self.low = [self.low[0].min(start), self.low[1].min(y)];
        self.high = [self.high[0].max(end - 1), y];
    }

    fn add(&mut self, other: &Self) {
        self.area += other.area;
        self.sum_x += other.sum_x;
        self.sum_y += other.sum_y;
        self.low = [self.low[0].min(other.low[0]), self.low[1].min(other.low[1])];
        self.high = [self.high[0].max(other.high[0]), self.high[1].max(other.high[1])];
    }

    /// Centroid in the window.
    pub(crate) fn centroid(&self) -> [f64; 2] {
        let area = f64::from(self.area.max(1));
        [f64::from(self.sum_x) / area, f64::from(self.sum_y) / area]
    }

    /// Whether it touches the edge of a window of this width and height.
    pub(crate) fn touches_edge(&self, size: [usize; 2]) -> bool {
        (0..2).any(|i| self.low[i] == 0 || self.high[i] as usize + 1 >= size[i])
    }

    /// Whether the bounding box of `other` lies strictly within this one's.
    pub(crate) fn encloses(&self, other: &Self) -> bool {
        (0..2).all(|i| self.low[i] < other.low[i] && other.high[i] < self.high[i])
    }
}

/// The components of one colour. `REACH` is 1 where diagonal neighbours belong together (8-connected), else 0.
pub(crate) struct Layer<const REACH: u8> {
    runs: [Run; MAX_RUNS],
    run_count: usize,
    /// Where the runs of the row before and of the present row start.
    before: usize,
    present: usize,
    /// First run of the row before that can still touch a new run.
    next: usize,
    parts: [Part; MAX_PARTS],
    /// Index of an earlier part that this one belongs to, or its own.
    parents: [u16; MAX_PARTS],
    part_count: usize,
}

impl<const REACH: u8> Layer<REACH> {
    const fn new() -> Self {
        Self {
            runs: [Run { y: 0, start: 0, end: 0, part: 0 }; MAX_RUNS],
            run_count: 0,
            before: 0,
            present: 0,
            next: 0,
            parts: [Part::EMPTY; MAX_PARTS],
            parents: [0; MAX_PARTS],
            part_count: 0,
        }
    }

    /// Starts over with `parts` empty components.
    fn clear(&mut self, parts: usize) {
        (self.run_count, self.before, self.present, self.next) = (0, 0, 0, 0);
        self.part_count = parts;
        for (i, (part, parent)) in (0u16..).zip(self.parts.iter_mut().zip(&mut self.parents)).take(parts) {
            *part = Part::EMPTY;
            *parent = i;
        }
    }

    fn start_row(&mut self) {
        (self.before, self.present) = (self.present, self.run_count);
        self.next = self.before;
    }

    /// Adds a run of the present row, to component `known` or to those of the row before that it touches.
    #[inline(always)]
    fn push(&mut self, y: u8, start: u8, end: u8, known: Option<u16>) -> Result<(), Clutter> {
        let above = self.runs.get(..self.present).unwrap_or_default();
        let mut part = known;
        for run in above.get(self.next..).unwrap_or_default() {
            if run.end + REACH <= start {
                self.next += 1;
                continue;
            }
            if run.start >= end + REACH {
                break;
            }
            part = match part {
                None => Some(run.part),
                Some(part) if part == run.part => Some(part),
                Some(part) => Some(unite(&mut self.parents, part, run.part)),
            };
        }
        let part = match part {
            Some(part) => part,
            None => {
                let fresh = self.part_count;
                let (Some(part), Some(parent)) = (self.parts.get_mut(fresh), self.parents.get_mut(fresh))
                else {
                    return Err(Clutter);
                };
                *part = Part::EMPTY;
                *parent = fresh as u16;
                self.part_count += 1;
                fresh as u16
            }
        };
        let run = self.runs.get_mut(self.run_count).ok_or(Clutter)?;
        *run = Run { y, start, end, part };
        self.run_count += 1;
        if let Some(part) = self.parts.get_mut(part as usize) {
            part.add_run(y, start, end);
        }
        Ok(())
    }

    /// Puts what belongs together into the earliest part.
    fn finish(&mut self) {
        for i in (1..self.part_count.min(MAX_PARTS)).rev() {
            let parent = self.parents[i] as usize;
            if parent < i {
                let part = self.parts[i];
                self.parts[parent].add(&part);
                self.parts[i].area = 0;
            }
        }
    }

    /// The components with their numbers; their order is that of their first rows.
    pub(crate) fn parts(&self) -> impl Iterator<Item = (u16, &Part)> {
        (0u16..).zip(self.parts.get(..self.part_count).unwrap_or_default()).filter(|(_, part)| part.area > 0)
    }

    /// Second moments (uu, uv, vv) of component `number` about `centre`, summed over its pixels.
    pub(crate) fn second_moments(&self, number: u16, part: &Part, centre: [f64; 2]) -> [f64; 3] {
        let mut sum = [0.0; 3];
        let runs = self.runs.get(..self.run_count).unwrap_or_default();
        let first = runs.partition_point(|run| run.y < part.low[1]);
        for run in runs.get(first..).unwrap_or_default() {
            if run.y > part.high[1] {
                break;
            }
            if root(&self.parents, run.part) != number {
                continue;
            }
            let length = f64::from(run.end - run.start);
            let x = 0.5 * (f64::from(run.start) + f64::from(run.end) - 1.0) - centre[0];
            let y = f64::from(run.y) - centre[1];
            // The sum of squares of n numbers one apart about their mean is n (n^2 - 1) / 12.
            sum[0] += length * (x * x + (length * length - 1.0) / 12.0);
            sum[1] += length * x * y;
            sum[2] += length * y * y;
        }
        sum
    }
}

/// Makes two components one and says which.
fn unite(parents: &mut [u16; MAX_PARTS], one: u16, other: u16) -> u16 {
    let (one, other) = (root(parents, one), root(parents, other));
    let (low, high) = (one.min(other), one.max(other));
    if let Some(parent) = parents.get_mut(high as usize) {
        *parent = low;
    }
    low
}

/// The component that `part` has become.
#[inline(always)]
fn root(parents: &[u16; MAX_PARTS], mut part: u16) -> u16 {
    // Parents have smaller numbers than their children, so this ends.
    while let Some(&parent) = parents.get(part as usize) {
        if parent == part {
            break;
        }
        part = parent;
    }
    part
}

/// Dark and bright components of a window.
pub(crate) struct Components {
    pub(crate) dark: Layer<1>,
    /// All bright runs that touch the window's edge are component 0: none of them is inside a ring.
    pub(crate) bright: Layer<0>,
}

/// The bright component that is not inside anything.
pub(crate) const OUTSIDE: u16 = 0;

impl Components {
    pub(crate) const fn new() -> Self {
        Self { dark: Layer::new(), bright: Layer::new() }
    }

    /// Finds the components of `bits`.
    pub(crate) fn find(&mut self, bits: &Bits) -> Result<(), Clutter> {
        self.dark.clear(0);
        self.bright.clear(1);
        let width = bits.width().min(MAX_SIDE) as u8;
        let words = bits.width().div_ceil(64);
        let last_row = bits.height().saturating_sub(1);
        for (y, row) in bits.rows().iter().enumerate() {
            self.dark.start_row();
            self.bright.start_row();
            let edge_row = y == 0 || y == last_row;
            let y = y as u8;
            // Where the colour changes: bright from 0 on, dark after the first change, bright after the second.
            let mut start = 0u8;
            let mut dark = false;
            let mut carry = 0;
            for (i, &word) in row.iter().enumerate().take(words) {
                let offset = 64 * i as u8;
                let mut changes = word ^ (word << 1 | carry);
                carry = word >> 63;
                while changes != 0 {
                    let x = offset + changes.trailing_zeros() as u8;
                    changes &= changes - 1;
                    if x >= width {
                        break;
                    }
                    if dark {
                        self.dark.push(y, start, x, None)?;
                    } else if x > start {
                        let outside = edge_row || start == 0;
                        self.bright.push(y, start, x, outside.then_some(OUTSIDE))?;
                    }
                    (start, dark) = (x, !dark);
                }
            }
            if start < width {
                if dark {
                    self.dark.push(y, start, width, None)?;
                } else {
                    self.bright.push(y, start, width, Some(OUTSIDE))?;
                }
            }
        }
        self.dark.finish();
        self.bright.finish();
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::loader::Plane;
    use crate::synthetic::Random;
    use std::boxed::Box;
    use std::vec::Vec;

    /// Components by flood fill: (area, sum x, sum y, touches the edge) of each, sorted.
    fn flood(
        width: usize,
        height: usize,
        dark: impl Fn(usize, usize) -> bool,
        diagonal: bool,
    ) -> Vec<(u32, u32, u32, bool)> {
        let mut seen = std::vec![false; width * height];
        let mut out = Vec::new();
        for i in 0..width * height {
            if seen[i] || !dark(i % width, i / width) {
                continue;
            }
            let (mut stack, mut sums) = (std::vec![i], (0, 0, 0, false));
            seen[i] = true;
            while let Some(i) = stack.pop() {
                let (x, y) = (i % width, i / width);
                sums.0 += 1;
                sums.1 += x as u32;
                sums.2 += y as u32;
                sums.3 |= x == 0 || y == 0 || x == width - 1 || y == height - 1;
                for dy in -1isize..=1 {
                    for dx in -1isize..=1 {
                        let (nx, ny) = (x.wrapping_add_signed(dx), y.wrapping_add_signed(dy));
                        let near = diagonal || dx == 0 || dy == 0;
                        if near && nx < width && ny < height && dark(nx, ny) && !seen[ny * width + nx] {
                            seen[ny * width + nx] = true;
                            stack.push(ny * width + nx);
                        }
                    }
                }
            }
            out.push(sums);
        }
        out.sort_unstable();
        out
    }

    fn sorted<const REACH: u8>(layer: &Layer<REACH>, skip: Option<u16>) -> Vec<(u32, u32, u32)> {
        let parts = layer.parts().filter(|(number, _)| Some(*number) != skip);
        let mut out: Vec<_> = parts.map(|(_, p)| (p.area, p.sum_x, p.sum_y)).collect();
        out.sort_unstable();
        out
    }

    fn check(plane: &Plane) {
        let (width, height) = (plane.width(), plane.height());
        let mut bits = Bits::new();
        bits.pack(plane, 128);
        let mut components = Box::new(Components::new());
        components.find(&bits).unwrap();
        let dark: Vec<_> = flood(width, height, |x, y| bits.get(x, y), true)
            .into_iter()
            .map(|(a, x, y, _)| (a, x, y))
            .collect();
        assert_eq!(sorted(&components.dark, None), dark);
        let bright = flood(width, height, |x, y| !bits.get(x, y), false);
        let inside: Vec<_> = bright.iter().filter(|c| !c.3).map(|&(a, x, y, _)| (a, x, y)).collect();
        assert_eq!(sorted(&components.bright, Some(OUTSIDE)), inside);
        let outside: u32 = bright.iter().filter(|c| c.3).map(|c| c.0).sum();
        let pooled = components.bright.parts().find(|(n, _)| *n == OUTSIDE).map_or(0, |(_, p)| p.area);
        assert_eq!(pooled, outside);
    }

    #[test]
    fn components_are_those_of_a_flood_fill() {
        let mut random = Random::new(11);
        for (width, height) in
            [(1, 1), (1, 9), (9, 1), (30, 30), (63, 20), (64, 20), (65, 20), (128, 9), (192, 12)]
        {
            for share in [10u64, 30, 50, 70, 90] {
                let dark: Vec<bool> = (0..width * height).map(|_| random.next() % 100 < share).collect();
                check(&Plane::from_fn(width, height, |x, y| if dark[y * width + x] { 9 } else { 200 }));
            }
        }
    }

    #[test]
    fn spirals_are_one_component() {
        // Nested rectangles joined at one place: many unions, late.
        check(&Plane::from_fn(41, 41, |x, y| {
            let ring = x.min(y).min(40 - x).min(40 - y);
            if ring % 2 == 0 || (x == 20 && y > 20) { 9 } else { 200 }
        }));
    }

    #[test]
    fn second_moments_are_those_of_the_pixels() {
        let inside = |x: usize, y: usize| (x as f64 - 20.3).powi(2) + (y as f64 - 17.8).powi(2) < 90.0;
        let plane = Plane::from_fn(40, 36, |x, y| if inside(x, y) || x == 3 { 0 } else { 255 });
        let mut bits = Bits::new();
        bits.pack(&plane, 128);
        let mut components = Box::new(Components::new());
        components.find(&bits).unwrap();
        let (number, part) = components.dark.parts().find(|(_, part)| part.low[0] > 3).unwrap();
        let [cx, cy] = part.centroid();
        let mut naive = [0.0; 3];
        for y in 0..36 {
            for x in 0..40 {
                if inside(x, y) {
                    let (dx, dy) = (x as f64 - cx, y as f64 - cy);
                    naive = [naive[0] + dx * dx, naive[1] + dx * dy, naive[2] + dy * dy];
                }
            }
        }
        let sums = components.dark.second_moments(number, part, [cx, cy]);
        for (sum, naive) in sums.iter().zip(naive) {
            // Rounding of a few hundred additions.
            assert!((sum - naive).abs() < 1e-8, "{sum} {naive}");
        }
    }

    #[test]
    fn a_window_of_noise_is_clutter_and_not_a_panic() {
        let plane = Plane::from_fn(192, 192, |x, y| if (x + y) % 2 == 0 { 0 } else { 255 });
        let mut bits = Bits::new();
        bits.pack(&plane, 128);
        let mut components = Box::new(Components::new());
        assert_eq!(components.find(&bits), Err(Clutter));
    }
}
