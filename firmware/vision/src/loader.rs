//! From the camera's bytes to the tracker's own memory: the only code that knows sample layouts.
//!
//! Detection works on the top 8 bits of a window, the sub-pixel step on all bits of the ring's surroundings.

use gangway_device::{Frame, Layout};
use multiversion::multiversion;

use crate::MAX_SIDE;

mod ray;

pub(crate) use ray::Ray;

/// A rectangle of the picture that lies wholly within it, at most `MAX_SIDE` either way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Rect {
    pub(crate) x: u16,
    pub(crate) y: u16,
    pub(crate) width: usize,
    pub(crate) height: usize,
}

impl Rect {
    /// The part of the picture from `low` up to `high` (both included, px); `None` where that is empty,
    /// larger than `MAX_SIDE` or not a number.
    pub(crate) fn clipped(frame: &Frame, low: [f64; 2], high: [f64; 2]) -> Option<Self> {
        let (x, width) = clip(low[0], high[0], frame.width())?;
        let (y, height) = clip(low[1], high[1], frame.height())?;
        Some(Self { x, y, width, height })
    }
}

/// First sample and number of samples of `low..=high` within `0..size`.
fn clip(low: f64, high: f64, size: u16) -> Option<(u16, usize)> {
    // Written so that a NaN is refused too.
    if !(low <= high && high >= 0.0 && low <= f64::from(size)) {
        return None;
    }
    let first = (low.max(0.0) + 0.5) as u16;
    let last = (high + 0.5).min(f64::from(size) - 0.5) as u16;
    let count = (last as usize + 1).checked_sub(first as usize)?;
    (1..=MAX_SIDE).contains(&count).then_some((first, count))
}

/// Room for a window of 8-bit samples.
pub(crate) struct Plane {
    rows: [[u8; MAX_SIDE]; MAX_SIDE],
}

/// A window of 8-bit samples, where they lie.
#[derive(Clone, Copy)]
pub(crate) struct View<'a> {
    /// From the first sample on, to the last row's `MAX_SIDE`th byte at the least.
    bytes: &'a [u8],
    stride: usize,
    width: usize,
    height: usize,
}

impl<'a> View<'a> {
    pub(crate) fn width(&self) -> usize {
        self.width
    }

    pub(crate) fn height(&self) -> usize {
        self.height
    }

    /// Every `every`th row; bytes beyond `width` mean nothing.
    pub(crate) fn rows(&self, every: usize) -> impl Iterator<Item = &'a [u8; MAX_SIDE]> {
        rows(self.bytes, every * self.stride).take(self.height.div_ceil(every))
    }
}

/// Rows of bytes, so many bytes apart, as long as there are as many as a row has.
#[inline(always)]
fn rows<const N: usize>(mut bytes: &[u8], step: usize) -> impl Iterator<Item = &[u8; N]> {
    core::iter::from_fn(move || {
        let row = bytes.first_chunk()?;
        bytes = bytes.get(step..).unwrap_or_default();
        Some(row)
    })
}

impl Plane {
    pub(crate) const fn new() -> Self {
        Self { rows: [[0; MAX_SIDE]; MAX_SIDE] }
    }

    /// The top 8 bits of every `every`th sample of `rect`, either way: where they are in the frame if they
    /// lie there as bytes, or taken from there.
    pub(crate) fn load<'a>(&'a mut self, frame: &Frame<'a>, rect: Rect, every: usize) -> View<'a> {
        let every = every.max(1);
        let [width, height] = [rect.width, rect.height].map(|side| side.div_ceil(every).min(MAX_SIDE));
        if every == 1 && frame.layout() == Layout::GREY {
            let bytes = frame.rows_from(rect.y).get(usize::from(rect.x)..).unwrap_or_default();
            let stride = frame.stride();
            // The last rows of a picture may have less behind them.
            if bytes.len() >= (height - 1) * stride + MAX_SIDE {
                return View { bytes, stride, width, height };
            }
        }
        for (row, y) in self.rows.iter_mut().take(height).zip((rect.y..).step_by(every)) {
            let bytes = match frame.layout() {
                Layout::GREY => frame.row(y).and_then(|bytes| bytes.get(usize::from(rect.x)..)),
                _ => None,
            };
            let is_taken = every == 2 && bytes.is_some_and(|bytes| thin(bytes, width, row));
            if !is_taken && let Some(into) = row.get_mut(..width) {
                top_bits(frame, (rect.x, y), every, into);
            }
        }
        View { bytes: self.rows.as_flattened(), stride: MAX_SIDE, width, height }
    }

    /// A window made by hand.
    #[cfg(test)]
    pub(crate) fn fill(&mut self, width: usize, height: usize, at: impl Fn(usize, usize) -> u8) -> View<'_> {
        for (y, row) in self.rows.iter_mut().take(height).enumerate() {
            row.iter_mut().take(width).enumerate().for_each(|(x, sample)| *sample = at(x, y));
        }
        View { bytes: self.rows.as_flattened(), stride: MAX_SIDE, width, height }
    }
}

/// Takes the top 8 bits of every `every`th sample of row `y` from column `x` on, as many as `into` has.
#[inline]
fn top_bits(frame: &Frame, (x, y): (u16, u16), every: usize, into: &mut [u8]) {
    match samples(frame, x, y, every * (into.len().max(1) - 1) + 1) {
        // A step of one that is not written out is not known to be one: a sample at a time.
        Samples::Byte(bytes) if every == 1 => {
            into.iter_mut().zip(bytes).for_each(|(to, from)| *to = *from);
        }
        Samples::Byte(bytes) => {
            into.iter_mut().zip(bytes.iter().step_by(every)).for_each(|(to, from)| *to = *from)
        }
        Samples::Spread(bytes, step) => {
            into.iter_mut().zip(bytes.iter().step_by(every * step)).for_each(|(to, from)| *to = *from)
        }
        Samples::Word(bytes, bits) => {
            for (to, from) in into.iter_mut().zip(bytes.chunks_exact(2).step_by(every)) {
                *to = top_of_word([from[0], from[1]], bits);
            }
        }
        Samples::Packed(groups) => {
            for (i, to) in into.iter_mut().enumerate() {
                *to = groups.top(every * i);
            }
        }
        Samples::None => into.fill(0),
    }
}

/// Takes every second of some bytes, `width` of them and what is left of whole chunks; whether there are as
/// many.
#[inline(always)]
fn thin(bytes: &[u8], width: usize, into: &mut [u8; MAX_SIDE]) -> bool {
    let size = width.next_multiple_of(CHUNK);
    let (Some(into), Some(bytes)) = (into.get_mut(..size), bytes.get(..2 * size)) else { return false };
    let chunks = into.as_chunks_mut().0.iter_mut().zip(bytes.as_chunks().0);
    chunks.for_each(|(to, from)| halve(from, to));
    true
}

/// Takes the first of each two bytes. Not inlined, and as the low half of a word: so the compiler packs whole
/// vectors.
#[multiversion(targets("x86_64+avx2"))]
#[inline(never)]
fn halve(bytes: &[u8; 2 * CHUNK], into: &mut [u8; CHUNK]) {
    for (to, pair) in into.iter_mut().zip(bytes.as_chunks::<2>().0) {
        *to = u16::from_le_bytes(*pair) as u8;
    }
}

/// Stray bits above the significant ones would wrap round; they count as white.
#[inline]
fn top_of_word(word: [u8; 2], bits: u8) -> u8 {
    (u16::from_le_bytes(word) >> bits.saturating_sub(8).min(8)).min(255) as u8
}

/// Samples that are taken at full depth together.
pub(crate) const CHUNK: usize = 16;

/// Samples of the longest window's row, and of a chunk from its end on.
pub(crate) const LINE: usize = 256 + CHUNK;
pub(crate) type Line = [u8; LINE];
const _: () = assert!(MAX_SIDE <= 256);

/// The rows of a part of the picture, at full depth.
pub(crate) struct Rows<'a> {
    frame: &'a Frame<'a>,
    rect: Rect,
    /// Bytes from the part's first sample on, where they are the samples.
    bytes: &'a [u8],
    stride: usize,
}

impl<'a> Rows<'a> {
    pub(crate) fn of(frame: &'a Frame<'a>, rect: Rect) -> Self {
        let bytes = match frame.layout() {
            Layout::GREY => frame.rows_from(rect.y).get(usize::from(rect.x)..),
            _ => None,
        };
        Self { frame, rect, bytes: bytes.unwrap_or_default(), stride: frame.stride() }
    }

    /// The samples of rows `y`, `y + every` and so on and what follows them, where bytes are samples and a
    /// line of them is left.
    #[inline(always)]
    pub(crate) fn lines(&self, y: usize, every: usize) -> impl Iterator<Item = &'a Line> {
        rows(self.bytes.get(y * self.stride..).unwrap_or_default(), every * self.stride)
    }

    /// Takes `count` samples, at most a chunk, of row `y` from column `x` of the part on. What is in `into`
    /// beyond them means nothing.
    #[inline(never)]
    pub(crate) fn load(&self, y: usize, x: usize, count: usize, into: &mut [u16; CHUNK]) {
        let at = (self.rect.x + x as u16, self.rect.y + y as u16);
        match samples(self.frame, at.0, at.1, count.min(CHUNK)) {
            Samples::Byte(bytes) => into.iter_mut().zip(bytes).for_each(|(to, from)| *to = u16::from(*from)),
            Samples::Spread(bytes, step) => {
                into.iter_mut().zip(bytes.iter().step_by(step)).for_each(|(to, from)| *to = u16::from(*from))
            }
            Samples::Word(bytes, bits) => {
                // Stray bits above the significant ones count as white.
                let full = u16::MAX >> (16 - bits.clamp(1, 16));
                for (to, from) in into.iter_mut().zip(bytes.chunks_exact(2)) {
                    *to = u16::from_le_bytes([from[0], from[1]]).min(full);
                }
            }
            Samples::Packed(groups) => {
                for (i, to) in into.iter_mut().take(count).enumerate() {
                    *to = groups.sample(i);
                }
            }
            Samples::None => into.fill(0),
        }
    }
}

/// Takes the top 8 bits of row `y` from column `x` on, as many samples as `into` has.
pub(crate) fn load_top(frame: &Frame, (x, y): (u16, u16), into: &mut [u8]) {
    top_bits(frame, (x, y), 1, into);
}

/// The top 8 bits of one sample; `None` outside the picture.
#[inline(always)]
pub(crate) fn top(frame: &Frame, x: u16, y: u16) -> Option<u8> {
    if x >= frame.width() {
        return None;
    }
    let (row, x) = (frame.row(y)?, usize::from(x));
    match frame.layout() {
        Layout::Byte { step, offset } => row.get(x * usize::from(step) + usize::from(offset)).copied(),
        Layout::Word { bits } => Some(top_of_word([*row.get(2 * x)?, *row.get(2 * x + 1)?], bits)),
        // The top 8 bits have a byte of their own; every group before adds the one with its low bits.
        layout @ Layout::Packed { .. } => row.get(x + x / layout.group()).copied(),
    }
}

/// One sample to 8 bits, share of full scale; 0 outside the picture.
pub fn level(frame: &Frame, x: u16, y: u16) -> f32 {
    top(frame, x, y).map_or(0.0, |value| f32::from(value) / 255.0)
}

/// The value of a saturated sample.
pub(crate) fn full_scale(frame: &Frame) -> f32 {
    ((1u32 << frame.layout().bits().min(16)) - 1) as f32
}

/// The bytes that hold some samples of a row, and how they lie there.
enum Samples<'a> {
    Byte(&'a [u8]),
    Spread(&'a [u8], usize),
    Word(&'a [u8], u8),
    Packed(Groups<'a>),
    None,
}

/// Samples that share the bytes of their low bits.
struct Groups<'a> {
    /// From the group of the first sample to that of the last one.
    bytes: &'a [u8],
    /// Place of the first sample in its group.
    first: usize,
    /// Samples of a group.
    group: usize,
}

impl Groups<'_> {
    /// Top 8 bits of sample `i`.
    #[inline]
    fn top(&self, i: usize) -> u8 {
        let at = self.first + i;
        self.bytes.get(at + at / self.group).copied().unwrap_or(0)
    }

    /// All bits of sample `i`: 10 where four share a byte, 12 where two do.
    #[inline]
    fn sample(&self, i: usize) -> u16 {
        let (at, bits) = (self.first + i, 8 / self.group);
        let low = self.bytes.get((at / self.group + 1) * (self.group + 1) - 1).copied().unwrap_or(0);
        let low = low >> (at % self.group * bits) & ((1 << bits) - 1);
        u16::from(self.top(i)) << bits | u16::from(low)
    }
}

/// `count` samples from column `x` of row `y`.
#[inline]
fn samples<'a>(frame: &Frame<'a>, x: u16, y: u16, count: usize) -> Samples<'a> {
    let Some(row) = frame.row(y) else { return Samples::None };
    let x = x as usize;
    match frame.layout() {
        Layout::Byte { step: 1, offset } => {
            row.get(x + offset as usize..x + offset as usize + count).map_or(Samples::None, Samples::Byte)
        }
        Layout::Byte { step, offset } => {
            let (step, offset) = (step.max(1) as usize, offset as usize);
            let needed = (count.max(1) - 1) * step + 1;
            row.get(x * step + offset..x * step + offset + needed)
                .map_or(Samples::None, |bytes| Samples::Spread(bytes, step))
        }
        Layout::Word { bits } => {
            row.get(2 * x..2 * (x + count)).map_or(Samples::None, |bytes| Samples::Word(bytes, bits))
        }
        layout @ Layout::Packed { .. } => {
            let group = layout.group();
            let (from, to) = (x / group * (group + 1), (x + count).div_ceil(group) * (group + 1));
            let groups = |bytes| Samples::Packed(Groups { bytes, first: x % group, group });
            row.get(from..to).map_or(Samples::None, groups)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two groups of MIPI CSI-2's RAW10, written out by hand: samples 0x3ff, 0, 0x155, 0x2aa and 1, 2, 3,
    /// 0x200.
    const TEN: [u8; 10] = [0xff, 0x00, 0x55, 0xaa, 0b10_01_00_11, 0x00, 0x00, 0x00, 0x80, 0b00_11_10_01];
    /// Two groups of RAW12: samples 0xabc, 0x123 and 0xfff, 0x00f.
    const TWELVE: [u8; 6] = [0xab, 0x12, 0x3c, 0xff, 0x00, 0xff];

    #[test]
    fn packed_samples_have_all_their_bits_wherever_a_window_begins() {
        let ten: &[u16] = &[0x3ff, 0, 0x155, 0x2aa, 1, 2, 3, 0x200];
        let twelve: &[u16] = &[0xabc, 0x123, 0xfff, 0x00f];
        for (bits, bytes, samples) in [(10, &TEN[..], ten), (12, &TWELVE[..], twelve)] {
            let size = (samples.len() as u16, 1);
            let frame = Frame::new(bytes, size, bytes.len(), Layout::Packed { bits }, 0, 0).unwrap();
            for x in 0..samples.len() {
                for count in 0..=samples.len() - x {
                    let expected = &samples[x..x + count];
                    let mut chunk = [0; CHUNK];
                    let rect = Rect { x: 0, y: 0, width: samples.len(), height: 1 };
                    Rows::of(&frame, rect).load(0, x, count, &mut chunk);
                    assert_eq!(chunk[..count], *expected, "{bits} bits, {count} from {x}");
                    let mut tops = std::vec![0; count];
                    top_bits(&frame, (x as u16, 0), 1, &mut tops);
                    let top = |sample: &u16| (sample >> (bits - 8)) as u8;
                    assert_eq!(tops, expected.iter().map(top).collect::<std::vec::Vec<_>>());
                }
                assert_eq!(super::top(&frame, x as u16, 0), Some((samples[x] >> (bits - 8)) as u8));
            }
            assert_eq!(super::top(&frame, size.0, 0), None);
        }
    }
}
