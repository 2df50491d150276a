//! The truth as a CSV file: `frame,dx_mm,dy_mm,dz_mm,roll_deg,pitch_deg,yaw_deg`, one row a frame.
//!
//! Columns may stand in any order, others are ignored. `x_mm` or `x [mm]` are as good as `dx_mm`, `roll (°)`
//! as `roll_deg`; a name without its unit is not, for nobody can tell millimetres from metres. A row whose
//! six cells are all empty says that the frame has no truth: an exported ride can be the reference of
//! another.

use std::collections::BTreeMap;
use std::path::Path;

use csv::StringRecord;

use crate::columns::{self, Columns};
use crate::{DEGREES_OF_FREEDOM, ReportError};

/// The true motion of each frame.
#[derive(Clone, Debug)]
pub struct Reference {
    name: String,
    truth: BTreeMap<u32, [f64; 6]>,
}

impl Reference {
    /// Takes the truth from pairs of frame number and x, y, z (mm), roll, pitch, yaw (degrees).
    ///
    /// # Errors
    ///
    /// Where there is not one pair.
    pub fn new(name: &str, truth: impl IntoIterator<Item = (u32, [f64; 6])>) -> Result<Self, ReportError> {
        let (name, truth) = (name.to_owned(), BTreeMap::from_iter(truth));
        if truth.is_empty() { Err(ReportError::EmptyReference { name }) } else { Ok(Self { name, truth }) }
    }

    /// Reads a CSV file.
    ///
    /// # Errors
    ///
    /// Where it cannot be read, or is not as described above: with its line and column.
    pub fn read(path: &Path) -> Result<Self, ReportError> {
        columns::read_file(path, Self::parse)
    }

    /// Reads the text of a CSV file; `name` is what messages call it.
    ///
    /// # Errors
    ///
    /// As [`Reference::read`].
    pub fn parse(text: &[u8], name: &str) -> Result<Self, ReportError> {
        let (columns, rows) = columns::table(text, &allowed_names(0), name)?;
        let mut truth = BTreeMap::new();
        let mut lines = BTreeMap::new();
        for (line, row) in rows {
            let (frame, values) = read_row(&columns, &row, line, name)?;
            if let Some(before) = lines.insert(frame, line) {
                let what = format!("frame {frame} is given on line {before} already; each frame has one row");
                return Err(columns.cell_error(0, line, name, what));
            }
            if let Some(values) = values {
                truth.insert(frame, values);
            }
        }
        Self::new(name, truth)
    }

    /// What messages and reports call it.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The truth of a frame: x, y, z (mm), roll, pitch, yaw (degrees).
    pub fn at(&self, frame: u32) -> Option<[f64; 6]> {
        self.truth.get(&frame).copied()
    }

    /// First and last frame.
    pub fn frames(&self) -> (u32, u32) {
        let first = self.truth.keys().next().copied().unwrap_or_default();
        (first, self.truth.keys().next_back().copied().unwrap_or(first))
    }

    /// Frames with a truth from `first` to `last`, both included.
    pub(crate) fn between(&self, first: u32, last: u32) -> impl Iterator<Item = u32> {
        let range = if first <= last { Some(self.truth.range(first..=last)) } else { None };
        range.into_iter().flatten().map(|(frame, _)| *frame)
    }
}

/// Frame number, and the motion where the row has one.
fn read_row(
    columns: &Columns,
    row: &StringRecord,
    line: u64,
    name: &str,
) -> Result<(u32, Option<[f64; 6]>), ReportError> {
    let text = columns.cell(row, 0, line, name)?;
    let frame = text.parse::<u32>().map_err(|_| {
        let what = format!("\"{text}\" is not a frame number; expected is a whole number from 0");
        columns.cell_error(0, line, name, what)
    })?;
    Ok((frame, columns.motion(row, line, name)?))
}

/// What column `i` (0: frame) may be called, the first being the usual name.
pub(crate) fn allowed_names(i: usize) -> Vec<String> {
    match i.checked_sub(1).map(|i| DEGREES_OF_FREEDOM[i]) {
        None => vec!["frame".to_owned()],
        Some(of) if of.is_angle => vec![format!("{}_deg", of.name)],
        Some(of) => vec![format!("d{}_mm", of.name), format!("{}_mm", of.name)],
    }
}

/// `X [mm]` as `x_mm`, `Roll (°)` as `roll_deg`.
pub(crate) fn plain_name(column: &str) -> String {
    let text = column.to_lowercase().replace('°', "deg");
    let words: Vec<&str> =
        text.split(|c: char| !c.is_ascii_alphanumeric()).filter(|w| !w.is_empty()).collect();
    words.join("_")
}
