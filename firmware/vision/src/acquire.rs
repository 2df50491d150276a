//! Finds rings anywhere in a picture, without a prediction: rows a few pixels apart are searched for the
//! pattern white, black, white, black, white of a ring (as finder patterns of two-dimensional codes are,
//! ISO/IEC 18004), and what shows it is looked at along eight rays. In slices: so much work a frame and no
//! more.

mod disc;
mod probe;
mod row;

use core::ops::Range;

use gangway_device::Frame;
use gangway_pose::Sighting;
use heapless::Vec;

use crate::acquire::row::{Limits, Row, Shape};
use crate::{MAX_SIDE, Settings};

/// Most rings that one sweep can find; more ring-like things than that hide the real ones.
pub const MAX_SIGHTINGS: usize = 96;

/// Rows from one that is searched to the next, at least: the inner disc of the smallest ring (12 px, 2:1) is
/// 6 px high.
const ROW_STEPS: [f64; 2] = [4.0, 16.0];
/// The same as a share of the smallest diameter, where that is known.
const STEP_SHARE: f64 = 0.42;
/// First row of one sweep after another, as quarters of a step: what one sweep just misses the next one hits.
const FIRST_QUARTERS: [u16; 4] = [1, 3, 0, 2];
/// Diameters of the rings that are looked for, px: the greatest still has a window of 2.5 diameters.
const DIAMETERS_PX: [f64; 2] = [9.0, MAX_SIDE as f64 / 2.5];
/// How far the blur of optics and motion takes the diameters' ratio off, as a factor.
const RATIO_BLUR: f64 = 1.5;
/// Rings nearer to each other than this share of a diameter are one.
const SAME: f64 = 0.4;

// What a slice is counted in: instructions of tracking that take as long, fitted to the times of sweeps over
// 860 frames of five scenes (by which they are known to 4 %). One of these takes longer than one of tracking:
// it waits for what it branches on, and across the rows for memory.
/// Of four pixels of a searched row.
const WORK_FOUR_PIXELS: i32 = 12;
/// Of a change between black and white.
const WORK_EDGE: i32 = 140;
/// Of a look along the rays that finds no ring, or a ring ...
const WORK_RING: [i32; 2] = [3_500, 11_000];
/// ... and no disc, or a disc.
const WORK_DISC: [i32; 2] = [3_500, 5_500];

/// A part of a picture.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Part {
    /// Its columns.
    pub columns: Range<u16>,
    /// Its rows.
    pub rows: Range<u16>,
}

/// The search of whole pictures with its working memory.
pub struct Acquisition {
    limits: Limits,
    /// Outer to inner diameter of what is a ring.
    ratios: [f64; 2],
    row: Row,
    sightings: Vec<Sighting, MAX_SIGHTINGS>,
    /// Size of the picture that is being swept.
    size: (u16, u16),
    /// Rows from one to the next.
    step: u16,
    /// Next row; `None` before a sweep.
    next: Option<u16>,
    /// Rows are looked at in two pictures on end, and those up to here were in the first of them.
    twice: bool,
    once_until: Option<u16>,
    sweeps: usize,
}

impl Acquisition {
    /// A search with the tracker's settings for rings whose outer to inner diameter is from `ratios[0]` to
    /// `ratios[1]`.
    pub fn new(settings: &Settings, ratios: [f64; 2]) -> Self {
        Self {
            limits: Limits::new(settings.min_contrast, ratios),
            ratios: [ratios[0] / RATIO_BLUR, ratios[1] * RATIO_BLUR],
            row: Row::new(),
            sightings: Vec::new(),
            size: (0, 0),
            step: ROW_STEPS[0] as u16,
            next: None,
            twice: false,
            once_until: None,
            sweeps: 0,
        }
    }

    /// Looks for bright discs on dark as well.
    pub fn with_discs(mut self) -> Self {
        self.limits.take_discs();
        self
    }

    /// Looks at every row in two pictures on end: of lamps that alternate one is dark. A picture that is
    /// swept whole stands for itself.
    pub fn twice(mut self) -> Self {
        self.twice = true;
        self
    }

    /// Says how large the smallest ring shows, px, where that is known: fewer rows are enough for larger
    /// rings.
    pub fn expect(&mut self, diameter_px: f64) {
        let step = (STEP_SHARE * diameter_px).clamp(ROW_STEPS[0], ROW_STEPS[1]) as u16;
        // What is no number has become zero.
        self.step = step.max(ROW_STEPS[0] as u16);
    }

    /// Begins a new sweep with the next picture.
    pub fn restart(&mut self) {
        (self.next, self.once_until) = (None, None);
    }

    /// Whether a sweep has begun and is not over.
    pub fn is_going(&self) -> bool {
        self.next.is_some()
    }

    /// Goes on with the sweep in this picture for about `work`, which it takes off; true when the last
    /// row is done. The next call begins a new sweep.
    ///
    /// A sweep over several pictures finds each ring where it was when its rows were searched.
    pub fn advance(&mut self, frame: &Frame, work: &mut i32) -> bool {
        let size = (frame.width(), frame.height());
        let begins = self.next.is_none() || self.size != size;
        if begins {
            self.size = size;
            self.sightings.clear();
            self.next = FIRST_QUARTERS.get(self.sweeps % FIRST_QUARTERS.len()).map(|n| n * self.step / 4);
            self.sweeps = self.sweeps.wrapping_add(1);
            self.once_until = None;
        }
        let (first, end) = (self.next, self.once_until.unwrap_or(size.1));
        while let Some(y) = self.next.filter(|y| *y < end) {
            if *work <= 0 {
                break;
            }
            let looked_for = (&self.limits, self.ratios);
            search(&mut self.row, frame, &(0..size.0), y, looked_for, &mut self.sightings, work);
            self.next = y.checked_add(self.step);
        }
        let is_whole = begins && self.next.is_none_or(|y| y >= size.1);
        if self.twice && self.once_until.take().is_none() && !is_whole {
            (self.next, self.once_until) = (first, Some(self.next.unwrap_or(size.1)));
            return false;
        }
        if self.next.is_some_and(|y| y < size.1) {
            return false;
        }
        self.next = None;
        true
    }

    /// Looks for rings in one part of the picture, all of it at once unless `work`, which it takes off, is
    /// not enough: then false. A sweep that is going on is left alone.
    pub fn look_in(
        &mut self,
        frame: &Frame,
        part: &Part,
        into: &mut Vec<Sighting, MAX_SIGHTINGS>,
        work: &mut i32,
    ) -> bool {
        let rows = part.rows.start..part.rows.end.min(frame.height());
        for y in rows.step_by(usize::from(self.step)) {
            if *work <= 0 {
                return false;
            }
            let (limits, ratios) = (&self.limits, self.ratios);
            search(&mut self.row, frame, &part.columns, y, (limits, ratios), into, work);
        }
        true
    }

    /// The rings of the last sweep, or of the one going on.
    pub fn sightings(&self) -> &[Sighting] {
        &self.sightings
    }
}

/// Searches these columns of one row, for rings of these limits and ratios that are not known yet.
fn search(
    row: &mut Row,
    frame: &Frame,
    columns: &Range<u16>,
    y: u16,
    (limits, ratios): (&Limits, [f64; 2]),
    sightings: &mut Vec<Sighting, MAX_SIGHTINGS>,
    work: &mut i32,
) {
    let mut spent = columns.len() as i32 / 4 * WORK_FOUR_PIXELS;
    let edges = row.patterns(frame, columns, y, limits, |pattern| {
        let at = [f64::from(pattern.middle), f64::from(y)];
        if sightings.is_full() || sightings.iter().any(|known| is_within(at, known)) {
            return;
        }
        let (found, works) = match pattern.shape {
            Shape::Ring => (probe::ring(frame, &pattern, y, ratios), WORK_RING),
            Shape::Disc => (disc::disc(frame, &pattern, y, ratios[0].is_finite()), WORK_DISC),
        };
        spent += works[usize::from(found.is_some())];
        let least = if pattern.shape == Shape::Disc { disc::LEAST_PX } else { DIAMETERS_PX[0] };
        let fits = |ring: &Sighting| (least..=DIAMETERS_PX[1]).contains(&ring.diameter_px());
        if let Some(ring) = found.filter(fits)
            && !sightings.iter().any(|known| is_within(ring.at, known))
        {
            // Asked above whether it is full.
            let _ = sightings.push(ring);
        }
    });
    *work = work.saturating_sub(spent + WORK_EDGE * edges as i32);
}

/// Whether a place is in the middle of a ring already known.
fn is_within(at: [f64; 2], known: &Sighting) -> bool {
    let off = [at[0] - known.at[0], at[1] - known.at[1]];
    // Compared by squares: half a ring of the same size.
    let reach = SAME * known.diameter_px();
    off[0] * off[0] + off[1] * off[1] < reach * reach
}

#[cfg(test)]
mod tests;
