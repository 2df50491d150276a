//! The evaluation as text, in the manner of thesis tables 5.1 to 5.7.

use std::fmt::Write;
use std::path::Path;

use crate::sync::Alignment;
use crate::{DEGREES_OF_FREEDOM, Deviation, Evaluation, RATE_LIMIT_HZ};

/// Heads and rows of a table, for text and page alike.
pub(crate) struct Cells {
    pub(crate) head: Vec<String>,
    pub(crate) rows: Vec<Vec<String>>,
}

impl Evaluation {
    /// The table of deviations (of motions, where there is no reference), and below it what was counted.
    pub fn table(&self) -> String {
        let mut text = format!("{}\n\n", self.title());
        let cells = self.cells();
        let widths: Vec<usize> = (0..cells.head.len())
            .map(|c| {
                let of = cells.rows.iter().chain([&cells.head]).filter_map(|r| r.get(c));
                of.map(|cell| cell.chars().count()).max().unwrap_or(0)
            })
            .collect();
        for row in [&cells.head].into_iter().chain(&cells.rows) {
            let mut line = String::new();
            for (c, (cell, width)) in row.iter().zip(&widths).enumerate() {
                // Names and units to the left, numbers to the right.
                let gap = if c == 0 { "" } else { "  " };
                let _ = match c {
                    0 | 1 => write!(line, "{gap}{cell:<width$}"),
                    _ => write!(line, "{gap}{cell:>width$}"),
                };
            }
            text.push_str(line.trim_end());
            text.push('\n');
        }
        text.push('\n');
        for line in self.notes() {
            text.push_str(&line);
            text.push('\n');
        }
        text
    }

    /// What was compared with what.
    pub(crate) fn title(&self) -> String {
        match &self.reference {
            Some(reference) => format!("Deviations of {} from {}", short(&self.session), short(reference)),
            None => format!("Motions of {}, without a reference", short(&self.session)),
        }
    }

    pub(crate) fn cells(&self) -> Cells {
        match &self.deviation {
            Some(deviation) => self.deviation_cells(deviation),
            None => self.motion_cells(),
        }
    }

    fn deviation_cells(&self, deviation: &[Deviation; 6]) -> Cells {
        let head =
            ["", "", "MAX", "RMSE", "MEAN", "STD", "at frame", "R(a)", "", "1 sigma", "2 sigma", "3 sigma"];
        let row = |i: usize, d: &Deviation| {
            let of = DEGREES_OF_FREEDOM[i];
            let digits = block_digits(i, |i| deviation[i].rmse);
            let number = |v: f64| fixed(v, digits);
            let mut row = vec![of.name.to_owned(), of.unit.to_owned()];
            row.extend([d.max, d.rmse, d.mean, d.std].map(number));
            row.extend([d.max_frame.to_string(), format!("+-{}", d.limit), kept(d.within_limit).to_owned()]);
            match d.within_sigma {
                Some(shares) => row.extend(shares.map(|s| format!("{:.1} %", s * 100.0))),
                None => row.extend([const { String::new() }; 3]),
            }
            row
        };
        Cells {
            head: head.map(str::to_owned).to_vec(),
            rows: deviation.iter().enumerate().map(|(i, d)| row(i, d)).collect(),
        }
    }

    fn motion_cells(&self) -> Cells {
        let row = |i: usize| {
            let (of, m) = (DEGREES_OF_FREEDOM[i], &self.motion[i]);
            let digits = block_digits(i, |i| self.motion[i].std) + 1;
            let mut row = vec![of.name.to_owned(), of.unit.to_owned()];
            row.extend([m.min, m.max, m.mean, m.std].map(|v| fixed(v, digits)));
            row.push(m.sigma_median.map(|s| fixed(s, digits_for(s))).unwrap_or_default());
            row
        };
        Cells {
            head: ["", "", "MIN", "MAX", "MEAN", "STD", "median sigma"].map(str::to_owned).to_vec(),
            rows: (0..6).map(row).collect(),
        }
    }

    /// Counts, rate and flags, a sentence each; a long one has its line break in it.
    pub(crate) fn notes(&self) -> Vec<String> {
        let f = self.frames;
        let mut notes = Vec::new();
        let mut counts = format!("Frames: {} in all, {} compared", f.all, f.compared);
        if self.reference.is_none() {
            counts = format!("Frames: {} in all, {} with a pose", f.all, f.compared);
        }
        let _ =
            write!(counts, ", {} waiting for the rest pose, {} without a pose", f.waiting, f.without_pose);
        if f.unlit > 0 {
            let _ = write!(counts, " ({} of them while the lamps were dark or switched)", f.unlit);
        }
        if self.reference.is_some() {
            let _ = write!(counts, ", {} not in the truth", f.not_in_reference);
        }
        notes.push(counts + ".");
        notes.extend(self.sync.iter().flat_map(Alignment::notes));
        if f.not_in_session > 0 {
            notes.push(format!("{} frames of the truth are missing in the session.", f.not_in_session));
        }
        if self.longest_gap_frames > 0 {
            let frames = if self.longest_gap_frames == 1 { "frame" } else { "frames" };
            notes.push(format!("Longest stretch without a pose: {} {frames}.", self.longest_gap_frames));
        }
        if let Some(rate) = self.rate_hz {
            notes.push(format!(
                "Time: {:.2} s at {rate:.2} frames/s (R(a) asks for {RATE_LIMIT_HZ} or more: {}).",
                self.duration_s,
                kept(rate >= RATE_LIMIT_HZ)
            ));
        }
        let flags = [
            (self.flags.ambiguous, "ambiguous"),
            (self.flags.outliers, "with circles left out"),
            (self.flags.beyond_limits, "beyond the limits of the motion"),
            (self.flags.after_gap, "after missing frames"),
            (self.flags.corrupt, "from damaged frames"),
            (self.flags.sparse, "from fewer than 7 in 10 of the circles"),
            (self.flags.camera_moved, "since the camera may have moved"),
            (self.flags.unreferenced, "without reference targets"),
        ];
        let flagged: Vec<String> =
            flags.iter().filter(|(n, _)| *n > 0).map(|(n, what)| format!("{n} {what}")).collect();
        if !flagged.is_empty() {
            notes.push(format!("Flagged poses, all included: {}.", flagged.join(", ")));
        }
        if self.deviation.is_some() {
            notes.push(
                "1, 2, 3 sigma: share of frames within so many of their own stated standard deviations (68.3, 95.4, 99.7 % if\n\
                 normal; the rest pose's own part is common to the whole ride, so that one ride alone may lie above or below)."
                    .to_owned(),
            );
        }
        notes
    }
}

/// A name without the folders it is in.
pub(crate) fn short(name: &str) -> &str {
    Path::new(name).file_name().and_then(|n| n.to_str()).unwrap_or(name)
}

/// "kept" or "NOT kept".
pub(crate) fn kept(is: bool) -> &'static str {
    if is { "kept" } else { "NOT kept" }
}

/// Decimals for `i`'s block of three (mm or degrees): three digits for its largest number, two for its
/// smallest.
pub(crate) fn block_digits(i: usize, value: impl Fn(usize) -> f64) -> usize {
    let start = i / 3 * 3;
    let digits: Vec<usize> = (start..start + 3).map(value).filter(|v| *v > 0.0).map(digits_for).collect();
    match (digits.iter().min(), digits.iter().max()) {
        (Some(&largest), Some(&smallest)) => largest.max(smallest - 1),
        _ => 3,
    }
}

/// Decimals that give a number three digits, at least one and at most six.
pub(crate) fn digits_for(value: f64) -> usize {
    if value <= 0.0 || !value.is_finite() {
        return 3;
    }
    (2.0 - value.log10().floor()).clamp(1.0, 6.0) as usize
}

/// A number with so many decimals, and no minus before a zero.
pub(crate) fn fixed(value: f64, digits: usize) -> String {
    let text = format!("{value:.digits$}");
    match text.strip_prefix('-') {
        Some(rest) if rest.bytes().all(|b| b == b'0' || b == b'.') => rest.to_owned(),
        _ => text,
    }
}
