//! Windows of the last frame without lamps, to be taken off the next one with them: what is left is the
//! lamps' own light, without sun and reflections.

use gangway_device::{Frame, Layout};
use gangway_pose::MAX_CIRCLES;
use heapless::Vec;

use crate::loader::{CHUNK, Rect, Rows, full_scale};
use crate::{MAX_SIDE, Search, length};

/// Samples that are kept in all. Windows of 18 discs of 16 px fit; what does not fit is not taken off.
const SAMPLES: usize = 15 << 10;

/// What is kept around a disc, px: its blur, what its prediction may be off and what it may have moved.
const MARGIN_PX: f64 = 6.0;

/// Greatest side of a window that is kept, px.
const SIDE: usize = MAX_SIDE / 3;

/// Windows further than this from where they were show something else, px.
const FURTHEST_PX: f64 = 1.0;

/// Share of full scale that a difference is lifted by, so that its noise goes both ways: 1 over this.
const LIFT: f32 = 64.0;

/// A window and where its samples begin.
struct Kept {
    at: [f64; 2],
    rect: Rect,
    start: usize,
}

/// The dark windows with their memory, and that of one difference.
pub(crate) struct Dark {
    kept: Vec<Kept, MAX_CIRCLES>,
    samples: [u16; SAMPLES],
    layout: Layout,
    difference: [u8; 2 * SIDE * SIDE],
}

impl Dark {
    pub(crate) const fn new() -> Self {
        Self {
            kept: Vec::new(),
            samples: [0; SAMPLES],
            layout: Layout::GREY,
            difference: [0; 2 * SIDE * SIDE],
        }
    }

    pub(crate) fn forget(&mut self) {
        self.kept.clear();
    }

    /// Keeps a square window about a disc's prediction.
    pub(crate) fn keep(&mut self, frame: &Frame, search: &Search) {
        let (at, half) = (search.at, 0.5 * search.diameter_px() + MARGIN_PX);
        let rect = Rect::clipped(frame, [at[0] - half, at[1] - half], [at[0] + half, at[1] + half]);
        let Some(rect) = rect.filter(|rect| rect.width.max(rect.height) <= SIDE) else { return };
        self.layout = frame.layout();
        let start = self.kept.last().map_or(0, |last| last.start + last.rect.width * last.rect.height);
        let Some(samples) = self.samples.get_mut(start..start + rect.width * rect.height) else { return };
        let rows = Rows::of(frame, rect);
        for (y, row) in samples.chunks_exact_mut(rect.width).enumerate() {
            each_sample(&rows, y, rect.width, |i, value| {
                if let Some(sample) = row.get_mut(i) {
                    *sample = value as u16;
                }
            });
        }
        // As many as circles at most.
        let _ = self.kept.push(Kept { at, rect, start });
    }

    /// This frame's window less the dark one that was kept there, as a frame of its own, and where its corner
    /// is in the picture. The dark one is moved as the prediction was, and `further`. `None` where none was
    /// kept, or the window has moved by more than a pixel.
    pub(crate) fn take_off(
        &mut self,
        frame: &Frame,
        search: &Search,
        further: [f64; 2],
    ) -> Option<(Frame<'_>, [u16; 2])> {
        let moved = |kept: &Kept| [0, 1].map(|i| search.at[i] - kept.at[i]);
        let is_near = |[u, v]: [f64; 2]| length(u, v) <= FURTHEST_PX;
        let kept = self.kept.iter().find(|kept| is_near(moved(kept)))?;
        let shift = [0, 1].map(|i| moved(kept)[i] + further[i]);
        if frame.layout() != self.layout || !is_near(shift) {
            return None;
        }
        let Rect { x, y, width, height } = kept.rect;
        let rows = Rows::of(frame, kept.rect);
        let dark = Shifted::new(self.samples.get(kept.start..kept.start + width * height)?, width, shift);
        let full = full_scale(frame);
        let into = self.difference.get_mut(..2 * width * height)?;
        // Samples of 8 bits take one byte, those of 9 to 16 two: the difference has more than 8 bits.
        let bits = frame.layout().bits().max(9);
        let scale = ((1u32 << bits) - 1) as f32 / full;
        for (row, into) in into.chunks_exact_mut(2 * width).enumerate() {
            each_sample(&rows, row, width, |i, value| {
                // What is saturated stays so.
                let less = if value >= full {
                    full
                } else {
                    (value - dark.at(i, row) + full / LIFT).clamp(0.0, full)
                };
                if let Some(bytes) = into.get_mut(2 * i..2 * i + 2) {
                    bytes.copy_from_slice(&((scale * less + 0.5) as u16).to_le_bytes());
                }
            });
        }
        let size = (width as u16, height as u16);
        let layout = Layout::Word { bits };
        let difference = Frame::new(into, size, 2 * width, layout, frame.number(), frame.time_ns()).ok()?;
        Some((difference, [x, y]))
    }
}

/// A window moved by up to a pixel or so, linear between samples.
struct Shifted<'s> {
    samples: &'s [u16],
    width: usize,
    /// Columns and rows to the left and above of where samples are taken, whole and the rest.
    whole: [i32; 2],
    rest: [f32; 2],
}

impl<'s> Shifted<'s> {
    fn new(samples: &'s [u16], width: usize, shift: [f64; 2]) -> Self {
        let whole = shift.map(|s| libm::floor(s) as i32);
        let rest = [0, 1].map(|i| (shift[i] - f64::from(whole[i])) as f32);
        Self { samples, width, whole, rest }
    }

    fn at(&self, x: usize, y: usize) -> f32 {
        let last = [self.width, self.samples.len() / self.width.max(1)].map(|n| n as i32 - 1);
        let sample = |x: i32, y: i32| {
            let (x, y) = (x.clamp(0, last[0]) as usize, y.clamp(0, last[1]) as usize);
            self.samples.get(y * self.width + x).map_or(0.0, |sample| f32::from(*sample))
        };
        let (x, y) = (x as i32 - self.whole[0], y as i32 - self.whole[1]);
        let [u, v] = self.rest;
        let row = |y: i32| (1.0 - u) * sample(x, y) + u * sample(x - 1, y);
        (1.0 - v) * row(y) + v * row(y - 1)
    }
}

/// Shows the samples of row `y` of a part of the picture, at full depth.
fn each_sample(rows: &Rows, y: usize, count: usize, mut show: impl FnMut(usize, f32)) {
    let mut chunk = [0; CHUNK];
    for first in (0..count).step_by(CHUNK) {
        let some = (count - first).min(CHUNK);
        rows.load(y, first, some, &mut chunk);
        for (i, value) in chunk.iter().enumerate().take(some) {
            show(first + i, f32::from(*value));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shift_moves_what_was_kept_between_its_samples() {
        let samples: std::vec::Vec<u16> = (0..36).map(|i| 10 * (i % 6) + i / 6).collect();
        let shifted = Shifted::new(&samples, 6, [0.25, -0.5]);
        // A sample at (3, 2) is then what lay at (2.75, 2.5).
        assert!((shifted.at(3, 2) - (27.5 + 2.5)).abs() < 1e-5);
        assert_eq!(Shifted::new(&samples, 6, [-1.0, 0.0]).at(2, 2), 32.0);
    }

    #[test]
    fn a_dark_window_is_taken_off_only_where_it_has_not_moved_by_more_than_a_pixel() {
        let bytes = [100; 64 * 64];
        let frame = Frame::new(&bytes, (64, 64), 64, Layout::GREY, 0, 0).unwrap();
        let mut dark = std::boxed::Box::new(Dark::new());
        let kept = Search::disc([32.0, 32.0], 10.0);
        dark.keep(&frame, &kept);
        let moved = |u: f64, v: f64| Search { at: [32.0 + u, 32.0 + v], ..kept };
        let mut is_taken =
            |search: &Search, further: [f64; 2]| dark.take_off(&frame, search, further).is_some();
        for near in [moved(0.0, 0.0), moved(0.99, 0.0), moved(-0.7, 0.7)] {
            assert!(is_taken(&near, [0.0; 2]), "{:?}", near.at);
        }
        for far in [moved(1.01, 0.0), moved(-0.8, 0.8), moved(0.0, -5.0)] {
            assert!(!is_taken(&far, [0.0; 2]), "{:?}", far.at);
        }
        // The disc itself counts, not its prediction alone.
        assert!(is_taken(&moved(0.6, 0.0), [0.3, 0.0]) && !is_taken(&moved(0.6, 0.0), [0.5, 0.0]));
    }
}
