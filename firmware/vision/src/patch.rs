//! The pixels about a ring at full depth, one after the other: read once for each pass of the sub-pixel step.

use gangway_device::Frame;

use crate::MAX_SIDE;
use crate::chords::{Chords, ROWS, Spans, cross};
use crate::lanes::BLOCK;
use crate::loader::{CHUNK, LINE, Line, Rect, Rows};

/// Belts of a patch at the most.
const MAX_BELTS: usize = 2;

/// A whole window, and what lies between belts and beyond the last one.
const MAX_PIXELS: usize = MAX_SIDE * MAX_SIDE + MAX_BELTS * BLOCK;

/// The number of every column.
const COLUMNS: Line = {
    let mut columns = [0; LINE];
    let mut i = 0;
    while i < columns.len() {
        columns[i] = i as u8;
        i += 1;
    }
    columns
};

/// Pixels of a part of the picture.
pub(crate) struct Patch {
    /// Column and row from the corner of the part.
    x: [u8; MAX_PIXELS],
    y: [u8; MAX_PIXELS],
    values: [u16; MAX_PIXELS],
    /// Pixels taken, with those between the belts.
    count: usize,
    rect: Rect,
}

/// Which pixels are taken, by their radius in the circle's plane, px; more where a gap in a row is narrow.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Belt {
    pub(crate) from: f64,
    pub(crate) to: f64,
}

impl Belt {
    /// All pixels up to a radius.
    pub(crate) fn whole(to: f64) -> Self {
        Self { from: 0.0, to }
    }
}

/// The pixels of a belt in a patch: the first one's block, and how many they are.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Part {
    block: usize,
    count: usize,
}

/// Columns, rows and values of pixels.
pub(crate) type Block<'a> = (&'a [u8; BLOCK], &'a [u8; BLOCK], &'a [u16; BLOCK]);

impl Patch {
    pub(crate) const fn new() -> Self {
        Self {
            x: [0; MAX_PIXELS],
            y: [0; MAX_PIXELS],
            values: [0; MAX_PIXELS],
            count: 0,
            rect: Rect { x: 0, y: 0, width: 0, height: 0 },
        }
    }

    /// Where in the picture the pixels are counted from.
    pub(crate) fn origin(&self) -> [f64; 2] {
        [f64::from(self.rect.x), f64::from(self.rect.y)]
    }

    /// Starts over, in another part of the picture.
    pub(crate) fn clear(&mut self, rect: Rect) {
        (self.rect, self.count) = (rect, 0);
    }

    /// Takes every `every`th row, as far as it lies in the belt about the ellipses of this shape (of
    /// determinant 1) and `centre` (in the picture), to the nearest pixel.
    pub(crate) fn take(
        &mut self,
        frame: &Frame,
        centre: [f64; 2],
        shape: [f64; 3],
        belt: &Belt,
        every: usize,
    ) -> Part {
        let block = self.count.div_ceil(BLOCK);
        self.count = block * BLOCK;
        let (rect, origin) = (self.rect, self.origin());
        let own = [centre[0] - origin[0], centre[1] - origin[1]];
        let chords = Chords::new(own, shape, belt, rect.width);
        let (first, last) = chords.rows(rect.height);
        let rows = Rows::of(frame, rect);
        let mut spans = Spans::EMPTY;
        let mut row = first.next_multiple_of(every);
        while row < last {
            cross(&chords, row, every, &mut spans);
            let count = ROWS.min((last - row).div_ceil(every));
            let taken = self.take_lines(&rows, (row, every), count, &spans);
            for i in taken..count {
                for (start, end) in spans.of(i) {
                    self.take_span(&rows, row + i * every, start, end);
                }
            }
            row += ROWS * every;
        }
        Part { block, count: self.count - block * BLOCK }
    }

    /// Takes the pixels of `count` rows as long as a line of samples lies there ready, and says of how many.
    /// Not inlined: so the compiler keeps all that the loop needs in registers.
    #[inline(never)]
    fn take_lines(
        &mut self,
        rows: &Rows,
        (row, every): (usize, usize),
        count: usize,
        spans: &Spans,
    ) -> usize {
        let mut at = self.count;
        let mut lines = rows.lines(row, every);
        for i in 0..count.min(ROWS) {
            let Some(line) = lines.next() else {
                self.count = at;
                return i;
            };
            let number = [(row + i * every) as u8; CHUNK];
            for (start, end) in spans.of(i) {
                // Written in whole chunks: what is too much is overwritten by the next span.
                let (mut first, mut into) = (start, at);
                while first < end {
                    let from = into.min(MAX_PIXELS - CHUNK);
                    put(&mut self.x, from, chunk_of(&COLUMNS, first));
                    put(&mut self.y, from, number);
                    put(&mut self.values, from, chunk_of(line, first).map(u16::from));
                    (first, into) = (first + CHUNK, into + CHUNK);
                }
                at += end - start;
            }
        }
        self.count = at;
        count
    }

    /// Takes the pixels of a row from `start` up to `end`, of any layout.
    fn take_span(&mut self, rows: &Rows, row: usize, start: usize, end: usize) {
        for first in (start..end).step_by(CHUNK) {
            let count = (end - first).min(CHUNK);
            let from = self.count.min(MAX_PIXELS - CHUNK);
            put(&mut self.x, from, chunk_of(&COLUMNS, first));
            put(&mut self.y, from, [row as u8; CHUNK]);
            let mut values = [0; CHUNK];
            rows.load(row, first, count, &mut values);
            put(&mut self.values, from, values);
            self.count += count;
        }
    }

    /// What was taken, and how many pixels of each block; the others of the last one mean nothing.
    pub(crate) fn blocks(&self, part: Part) -> impl Iterator<Item = (Block<'_>, usize)> {
        let places = self.x.as_chunks().0.iter().zip(self.y.as_chunks().0);
        let blocks = places.zip(self.values.as_chunks().0).map(|((x, y), values)| (x, y, values));
        let counts = (0..part.count).step_by(BLOCK).map(move |first| (part.count - first).min(BLOCK));
        blocks.skip(part.block).zip(counts)
    }
}

/// Writes a chunk of a column; nothing where that has none there.
#[inline(always)]
fn put<T: Copy>(column: &mut [T; MAX_PIXELS], at: usize, chunk: [T; CHUNK]) {
    if let Some(into) = column.get_mut(at..at + CHUNK) {
        into.copy_from_slice(&chunk);
    }
}

/// A chunk of a line, from a column of a window on.
#[inline(always)]
fn chunk_of(line: &Line, first: usize) -> [u8; CHUNK] {
    let first = first % (LINE - CHUNK);
    core::array::from_fn(|i| line[first + i])
}
