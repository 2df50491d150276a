//! The pixels about a ring at full depth, one after the other: read once for each pass of the sub-pixel step.

use gangway_device::Frame;

use crate::MAX_SIDE;
use crate::lanes::LANES;
use crate::loader::{Rect, load_block};

/// Pixels that are worked on together.
pub(crate) const BLOCK: usize = 32;

/// Runs of `LANES` neighbours in a block.
pub(crate) const RUNS: usize = BLOCK / LANES;

/// A whole window, and what fills up the last run of every row, four times where a row is taken in four parts.
const MAX_PIXELS: usize = (MAX_SIDE + 4 * LANES).next_multiple_of(BLOCK) * MAX_SIDE;

/// A gap in a row that is narrower, px, costs less than two spans.
const WORTHWHILE_PX: f64 = 6.0;

/// Columns of the first pixels of the runs of a block, from the first one's, in the bytes of a number.
const COLUMNS: u64 = 0x1c18_1410_0c08_0400;
const ALIKE: u64 = 0x0101_0101_0101_0101;
const _: () = assert!(RUNS == 8 && LANES == 4 && MAX_SIDE + BLOCK <= 256);

/// Value of what fills up runs and blocks: more than any sample, so that it counts as saturated.
const FILL: f32 = f32::MAX;

/// Pixels of a part of the picture.
pub(crate) struct Patch {
    /// Column and row of each run's first pixel from the corner of the part.
    x: [u8; MAX_PIXELS / LANES],
    y: [u8; MAX_PIXELS / LANES],
    values: [f32; MAX_PIXELS],
    /// Pixels taken, with what fills up the runs.
    count: usize,
    rect: Rect,
}

/// Which pixels are taken, by their radius in the circle's plane, px: from `from` to `to` and from `again` to `end`,
/// and what lies between where that is little.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Belts {
    pub(crate) from: f64,
    pub(crate) to: f64,
    pub(crate) again: f64,
    pub(crate) end: f64,
}

impl Belts {
    /// All pixels up to a radius.
    pub(crate) fn whole(end: f64) -> Self {
        Self { from: 0.0, to: end, again: end, end }
    }
}

/// Column and row of runs, and values of pixels.
pub(crate) type Block<'a> = (&'a [u8; RUNS], &'a [u8; RUNS], &'a [f32; BLOCK]);

impl Patch {
    pub(crate) const fn new() -> Self {
        Self {
            x: [0; MAX_PIXELS / LANES],
            y: [0; MAX_PIXELS / LANES],
            values: [0.0; MAX_PIXELS],
            count: 0,
            rect: Rect { x: 0, y: 0, width: 0, height: 0 },
        }
    }

    /// Where in the picture the pixels are counted from.
    pub(crate) fn origin(&self) -> [f64; 2] {
        [f64::from(self.rect.x), f64::from(self.rect.y)]
    }

    /// Takes every `every`th row of `rect`, as far as it lies in the belts about the ellipses of this shape (of
    /// determinant 1) and `centre` (in the picture), to the nearest pixel.
    pub(crate) fn take(
        &mut self,
        frame: &Frame,
        rect: Rect,
        centre: [f64; 2],
        shape: [f64; 3],
        belts: &Belts,
        every: usize,
    ) {
        (self.rect, self.count) = (rect, 0);
        let own = [centre[0] - f64::from(rect.x), centre[1] - f64::from(rect.y)];
        // q0 x^2 + 2 q1 x y + q2 y^2 = radius^2 with q the inverse of the shape.
        let (q0, lean) = (shape[2], shape[1] / shape[2]);
        let squares = [belts.from, belts.to, belts.again, belts.end].map(|radius| radius * radius * q0);
        let per_q0 = 1.0 / q0;
        let (split, hollow) = (belts.again > belts.to, 2.0 * belts.from > WORTHWHILE_PX);
        for row in (0..rect.height).step_by(every) {
            let dy = row as f64 - own[1];
            // Half the chord that the row cuts out of each ellipse; none where it passes by.
            let half = |i: usize| libm::sqrt((squares[i] - dy * dy).max(0.0)) * per_q0;
            let middle = own[0] + lean * dy;
            let end = half(3);
            if end <= 0.0 {
                continue;
            }
            let (again, to) = if split { (half(2), half(1)) } else { (0.0, 0.0) };
            if to > 0.0 && again - to > WORTHWHILE_PX {
                self.take_span(frame, row, middle - end, middle - again);
                self.take_about(frame, row, middle, half(0), to);
                self.take_span(frame, row, middle + again, middle + end);
            } else if split && to <= 0.0 {
                self.take_about(frame, row, middle, again, end);
            } else if hollow {
                self.take_about(frame, row, middle, half(0), end);
            } else {
                self.take_span(frame, row, middle - end, middle + end);
            }
        }
        while !self.count.is_multiple_of(BLOCK) {
            let runs = self.x.get_mut(self.count / LANES).zip(self.y.get_mut(self.count / LANES));
            let values = self.values.get_mut(self.count..self.count + LANES);
            let (Some((x, y)), Some(values)) = (runs, values) else { return };
            (*x, *y) = (0, 0);
            values.fill(FILL);
            self.count += LANES;
        }
    }

    /// Takes the pixels of a row from `from` to `to` on either side of `middle`, and those between where they are few.
    #[inline(always)]
    fn take_about(&mut self, frame: &Frame, row: usize, middle: f64, from: f64, to: f64) {
        if 2.0 * from > WORTHWHILE_PX {
            self.take_span(frame, row, middle - to, middle - from);
            self.take_span(frame, row, middle + from, middle + to);
        } else {
            self.take_span(frame, row, middle - to, middle + to);
        }
    }

    /// Takes the pixels of a row from `low` to `high`.
    #[inline(always)]
    fn take_span(&mut self, frame: &Frame, row: usize, low: f64, high: f64) {
        // Rounded up and down: what lies nearer to a belt's edge than a pixel hardly counts.
        let (start, end) = ((low.max(0.0) + 0.999) as i32 as usize, (high + 1.0).max(0.0) as i32 as usize);
        let end = end.min(self.rect.width);
        if start >= end {
            return;
        }
        let length = end - start;
        let at = (self.rect.x + start as u16, self.rect.y + row as u16);
        // Written in whole blocks: what is too much is overwritten by the next span.
        for first in (0..length).step_by(BLOCK) {
            let (from, run) = (self.count + first, (self.count + first) / LANES);
            let (Some(x), Some(y)) = (self.x.get_mut(run..run + RUNS), self.y.get_mut(run..run + RUNS))
            else {
                return;
            };
            let column = (start + first) as u64;
            x.copy_from_slice(&(column * ALIKE + COLUMNS).to_le_bytes());
            y.copy_from_slice(&(row as u64 * ALIKE).to_le_bytes());
            let Some(values) = self.values.get_mut(from..).and_then(|values| values.first_chunk_mut()) else {
                return;
            };
            load_block(frame, (at.0 + first as u16, at.1), length - first, values);
        }
        let rest = self.values.get_mut(self.count + length..);
        if let Some(rest) = rest.and_then(|values| values.first_chunk_mut::<LANES>()) {
            *rest = [FILL; LANES];
        }
        self.count += length.next_multiple_of(LANES);
    }

    /// What was taken.
    pub(crate) fn blocks(&self) -> impl Iterator<Item = Block<'_>> {
        let places = self.x.as_chunks().0.iter().zip(self.y.as_chunks().0);
        let blocks = places.zip(self.values.as_chunks().0).map(|((x, y), values)| (x, y, values));
        blocks.take(self.count / BLOCK)
    }
}
