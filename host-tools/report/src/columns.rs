//! The columns of a reference in CSV: what each row is of (a frame, a time), then the six degrees of freedom.

use csv::StringRecord;

use crate::reference::{allowed_names, plain_name};
use crate::{DEGREES_OF_FREEDOM, ReportError};

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
