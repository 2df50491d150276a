//! References in CSV: their rows, and the columns of what each row is of (a frame, a time) and of the six
//! degrees of freedom.

use std::path::Path;

use csv::StringRecord;

use crate::reference::{allowed_names, plain_name};
use crate::{DEGREES_OF_FREEDOM, ReportError};

/// What `parse` makes of a file and of what messages call it.
pub(crate) fn read_file<T>(
    path: &Path,
    parse: impl FnOnce(&[u8], &str) -> Result<T, ReportError>,
) -> Result<T, ReportError> {
    let name = path.display().to_string();
    match std::fs::read(path) {
        Ok(text) => parse(&text, &name),
        Err(why) => Err(ReportError::ReadReference { name, why }),
    }
}

/// The columns of a file whose first column is called as `first` says, and its rows, each with its line.
pub(crate) fn table(
    text: &[u8],
    first: &[String],
    name: &str,
) -> Result<(Columns, Vec<(u64, StringRecord)>), ReportError> {
    let text = text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(text);
    let text = String::from_utf8_lossy(text);
    let reader = csv::ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .delimiter(delimiter(&text))
        .trim(csv::Trim::All)
        .from_reader(text.as_bytes());
    let mut rows = reader.into_records().map(|row| {
        let row = row.map_err(|e| ReportError::ReadReference { name: name.to_owned(), why: e.into() })?;
        Ok((line_of(&row, &text), row))
    });
    let Some(header) = rows.next() else {
        return Err(ReportError::EmptyReference { name: name.to_owned() });
    };
    let columns = Columns::find(&header?.1, first, name)?;
    Ok((columns, rows.collect::<Result<_, _>>()?))
}

/// Comma, semicolon or tab, whichever the first line that says something has most of.
fn delimiter(text: &str) -> u8 {
    let header = text.lines().find(|l| !l.trim().is_empty()).unwrap_or_default();
    let count = |c: u8| header.bytes().filter(|b| *b == c).count();
    // Of equals, the last would win: the comma is the last.
    [b'\t', b';', b','].into_iter().max_by_key(|c| count(*c)).unwrap_or(b',')
}

/// Line of a row, from 1. The reader's position is where it began to look; empty lines may come before the
/// row.
fn line_of(row: &StringRecord, text: &str) -> u64 {
    let Some(position) = row.position() else { return 0 };
    let rest = text.get(position.byte() as usize..).unwrap_or_default();
    let skipped = &rest[..rest.len() - rest.trim_start_matches(['\r', '\n']).len()];
    position.line() + skipped.matches('\n').count() as u64
}

/// Where the seven columns are, and what the file calls them.
pub(crate) struct Columns {
    at: [usize; 7],
    names: [String; 7],
}

impl Columns {
    /// Finds them in a header; the first may be called as `first` says.
    pub(crate) fn find(header: &StringRecord, first: &[String], name: &str) -> Result<Self, ReportError> {
        let error = |what| ReportError::Header { name: name.to_owned(), line: 1, what };
        let mut at = [0; 7];
        let mut names = [const { String::new() }; 7];
        for (i, (at, found)) in at.iter_mut().zip(&mut names).enumerate() {
            let allowed = if i == 0 { first.to_vec() } else { allowed_names(i) };
            let mut fits =
                header.iter().enumerate().filter(|(_, column)| allowed.contains(&plain_name(column)));
            let Some((position, column)) = fits.next() else {
                let has = printable(&header.iter().collect::<Vec<_>>().join(", "));
                let wanted = allowed.join(" or ");
                return Err(error(format!("the column {wanted} is missing; the header has: {has}")));
            };
            if let Some((_, second)) = fits.next() {
                return Err(error(format!("the columns {column} and {second} mean the same; take one out")));
            }
            (*at, *found) = (position, column.to_owned());
        }
        Ok(Self { at, names })
    }

    /// What the file calls column `i`.
    pub(crate) fn name(&self, i: usize) -> &str {
        &self.names[i]
    }

    /// Column `i` of a row.
    pub(crate) fn cell<'r>(
        &self,
        row: &'r StringRecord,
        i: usize,
        line: u64,
        name: &str,
    ) -> Result<&'r str, ReportError> {
        row.get(self.at[i]).ok_or_else(|| {
            let what = format!("the line ends before it, after {} of its cells", row.len());
            self.cell_error(i, line, name, what)
        })
    }

    /// The six degrees of freedom of a row, `None` where all six are empty.
    pub(crate) fn motion(
        &self,
        row: &StringRecord,
        line: u64,
        name: &str,
    ) -> Result<Option<[f64; 6]>, ReportError> {
        let mut values = [0.0; 6];
        let mut empty = None;
        let mut count = 0;
        for (i, value) in values.iter_mut().enumerate() {
            let text = self.cell(row, i + 1, line, name)?;
            if text.is_empty() {
                empty.get_or_insert(i + 1);
                count += 1;
                continue;
            }
            *value = text.parse::<f64>().ok().filter(|v| v.is_finite()).ok_or_else(|| {
                let unit = DEGREES_OF_FREEDOM[i].unit;
                let what = format!("\"{text}\" is not a number in {unit}; expected is one such as -12.5");
                self.cell_error(i + 1, line, name, what)
            })?;
        }
        match empty {
            None => Ok(Some(values)),
            Some(_) if count == 6 => Ok(None),
            Some(i) => {
                let what = "the cell is empty; a row has all six values or none of them".to_owned();
                Err(self.cell_error(i, line, name, what))
            }
        }
    }

    /// What is wrong with a cell.
    pub(crate) fn cell_error(&self, i: usize, line: u64, name: &str, what: String) -> ReportError {
        ReportError::Cell { name: name.to_owned(), line, column: self.names[i].clone(), what }
    }
}

/// Of a file that is no table at all, enough to recognise it by.
fn printable(text: &str) -> String {
    const MOST: usize = 160;
    let mut short: String = text.chars().filter(|c| !c.is_control()).take(MOST).collect();
    if text.chars().count() > MOST {
        short.push_str(" ...");
    }
    short
}
