//! A reference recorder's file: `time_s,dx_mm,dy_mm,dz_mm,roll_deg,pitch_deg,yaw_deg`, a row a sample, at a
//! rate and on a clock of its own (thesis 5.4.2: the test rig's control system).
//!
//! The time may be `time_s`, `time_ms`, `time_us` or `time_ns`, from any zero; it rises from row to row and
//! need not do so evenly. The other columns are as in a [`Reference`](crate::Reference). A row whose six
//! cells are all empty is a gap.

use std::path::Path;

use csv::StringRecord;

use super::track::Track;
use crate::ReportError;
use crate::columns::{self, Columns};
use crate::reference::plain_name;

/// Fewest rows that can be aligned.
const FEWEST_ROWS: usize = 10;

/// What a recorder wrote.
#[derive(Clone, Debug)]
pub struct Recorder {
    name: String,
    /// Motion over seconds since its first row.
    pub(crate) track: Track,
    /// Its clock at the first row, s.
    pub(crate) first_s: f64,
}

impl Recorder {
    /// Takes pairs of time (s, rising) and x, y, z (mm), roll, pitch, yaw (degrees).
    ///
    /// # Errors
    ///
    /// Where there are fewer than ten, or a time is not after the one before.
    pub fn new(name: &str, rows: impl IntoIterator<Item = (f64, [f64; 6])>) -> Result<Self, ReportError> {
        let mut first = None;
        let (mut times, mut values) = (Vec::new(), Vec::new());
        for (time, motion) in rows {
            let zero = *first.get_or_insert(time);
            times.push(time - zero);
            values.push(motion);
        }
        let rises = times.windows(2).all(|pair| pair[1] > pair[0]);
        if times.len() < FEWEST_ROWS || !rises {
            let rows = times.len();
            return Err(ReportError::FewRows { name: name.to_owned(), rows, least: FEWEST_ROWS });
        }
        Ok(Self {
            name: name.to_owned(),
            track: Track::new(times, values),
            first_s: first.unwrap_or_default(),
        })
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
    /// As [`Recorder::read`].
    pub fn parse(text: &[u8], name: &str) -> Result<Self, ReportError> {
        let times = TIMES.map(|(name, _)| name.to_owned());
        let (columns, rows) = columns::table(text, &times, name)?;
        let mut first = None;
        let mut before = None;
        let mut kept = Vec::new();
        for (line, row) in rows {
            let (nanoseconds, values) = read_row(&columns, &row, line, name)?;
            if before.is_some_and(|before| nanoseconds <= before) {
                let what = "the time is not after that of the row before; expected are times that rise";
                return Err(columns.cell_error(0, line, name, what.to_owned()));
            }
            before = Some(nanoseconds);
            let zero = *first.get_or_insert(nanoseconds);
            // Whole nanoseconds first: the difference of two times of this century keeps all its digits.
            kept.extend(values.map(|values| ((nanoseconds - zero) as f64 * 1e-9, values)));
        }
        let clock = first.unwrap_or_default() as f64 * 1e-9;
        let mut recorder = Self::new(name, kept)?;
        recorder.first_s += clock;
        Ok(recorder)
    }

    /// What messages and reports call it.
    pub fn name(&self) -> &str {
        &self.name
    }
}

/// Names of the time's column, and nanoseconds of their unit.
const TIMES: [(&str, f64); 4] = [("time_s", 1e9), ("time_ms", 1e6), ("time_us", 1e3), ("time_ns", 1.0)];

/// Nanoseconds of the unit that a file gives its time in.
fn unit_ns(columns: &Columns) -> f64 {
    let unit = TIMES.iter().find(|(unit, _)| *unit == plain_name(columns.name(0)));
    unit.map_or(1e9, |(_, unit)| *unit)
}

/// Time in nanoseconds, and the motion where the row has one.
fn read_row(
    columns: &Columns,
    row: &StringRecord,
    line: u64,
    name: &str,
) -> Result<(i128, Option<[f64; 6]>), ReportError> {
    let unit_ns = unit_ns(columns);
    let text = columns.cell(row, 0, line, name)?;
    // Whole numbers are taken whole: nanoseconds since 1970 have more digits than a floating number.
    let whole = text.parse::<i128>().ok().filter(|v| v.unsigned_abs() < 1 << 96);
    let time = match whole {
        Some(whole) => Some(whole * unit_ns as i128),
        None => text.parse::<f64>().ok().filter(|v| v.abs() < 1e12).map(|v| (v * unit_ns).round() as i128),
    };
    let time = time.ok_or_else(|| {
        let what = format!("\"{text}\" is not a time; expected is a number such as 12.34");
        columns.cell_error(0, line, name, what)
    })?;
    Ok((time, columns.motion(row, line, name)?))
}
