//! Numbers and times of a recording's frames from a CSV file: `frame,time_ns`, one row a frame.

use std::path::Path;

/// Number and time, ns, of every frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Times {
    name: String,
    rows: Vec<(u32, u64)>,
}

/// What is wrong with a file of times.
#[derive(Debug, PartialEq, Eq, thiserror::Error)]
pub enum TimesError {
    /// The file cannot be read.
    #[error("cannot read {name}: {why}")]
    Read {
        /// The file.
        name: String,
        /// What the system said.
        why: String,
    },
    /// A row or the head makes no sense.
    #[error("{name}:{line}: {why}")]
    Row {
        /// The file.
        name: String,
        /// Line, from 1.
        line: u64,
        /// What is wrong and what is right.
        why: String,
    },
    /// There are more frames than rows.
    #[error("{name} has rows for {rows} frames only, but the recording has more; give a row for every frame")]
    Short {
        /// The file.
        name: String,
        /// Rows in it.
        rows: usize,
    },
}

impl Times {
    /// Reads a file. Numbers and times must rise.
    ///
    /// # Errors
    /// The line and what is wrong with it.
    pub fn read(path: &Path) -> Result<Self, TimesError> {
        let name = path.display().to_string();
        match std::fs::read_to_string(path) {
            Ok(text) => Self::parse(&text, &name),
            Err(error) => Err(TimesError::Read { name, why: error.to_string() }),
        }
    }

    /// As [`Times::read`], from text; `name` is what errors call it.
    ///
    /// # Errors
    /// As [`Times::read`].
    pub fn parse(text: &str, name: &str) -> Result<Self, TimesError> {
        let wrong = |line, why: String| TimesError::Row { name: name.to_owned(), line, why };
        let mut reader =
            csv::ReaderBuilder::new().trim(csv::Trim::All).comment(Some(b'#')).from_reader(text.as_bytes());
        let head = reader.headers().map_err(|error| wrong(1, error.to_string()))?.clone();
        let column = |title: &str| {
            head.iter().position(|found| found == title).ok_or_else(|| {
                wrong(1, format!("the column '{title}' is missing; the head is frame,time_ns"))
            })
        };
        let (frame, time) = (column("frame")?, column("time_ns")?);
        let mut rows: Vec<(u32, u64)> = Vec::new();
        for record in reader.records() {
            let record = record.map_err(|error| {
                wrong(
                    error.position().map_or(1, csv::Position::line),
                    "it has more or fewer fields than the head".into(),
                )
            })?;
            let line = record.position().map_or(1, csv::Position::line);
            let field = |at| record.get(at).unwrap_or_default();
            let number = field(frame)
                .parse()
                .map_err(|_| wrong(line, format!("'{}' is no frame number", field(frame))))?;
            let time = field(time)
                .parse()
                .map_err(|_| wrong(line, format!("'{}' is no time in whole ns", field(time))))?;
            if rows.last().is_some_and(|&(before, then)| number <= before || time <= then) {
                return Err(wrong(line, "frame and time_ns must be above those of the row before".into()));
            }
            rows.push((number, time));
        }
        if rows.is_empty() {
            return Err(wrong(1, "there is no row; give one for every frame".into()));
        }
        Ok(Self { name: name.to_owned(), rows })
    }

    /// Number and time of the frame with this index; in the passes of a repeated recording they run on.
    ///
    /// # Errors
    /// [`TimesError::Short`].
    pub fn at(&self, index: usize, pass: u32) -> Result<(u32, u64), TimesError> {
        let short = || TimesError::Short { name: self.name.clone(), rows: self.rows.len() };
        let &(number, time) = self.rows.get(index).ok_or_else(short)?;
        let (Some(first), Some(last)) = (self.rows.first(), self.rows.last()) else { return Err(short()) };
        let steps = (self.rows.len() as u64 - 1).max(1);
        let numbers = last.0 - first.0 + 1;
        let span = last.1 - first.1;
        // Between two passes lies one mean period.
        let period = span + (span / steps).max(1);
        Ok((
            number.wrapping_add(numbers.wrapping_mul(pass)),
            time.wrapping_add(period.wrapping_mul(u64::from(pass))),
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_and_times_are_read_and_run_on() {
        let times = Times::parse("time_ns, frame\n1000, 7\n1020, 8\n1060, 10\n", "times.csv").unwrap();
        assert_eq!(times.at(0, 0), Ok((7, 1_000)));
        assert_eq!(times.at(2, 0), Ok((10, 1_060)));
        // The mean period is 30 ns.
        assert_eq!(times.at(0, 1), Ok((11, 1_090)));
        assert_eq!(times.at(2, 2), Ok((18, 1_240)));
        assert_eq!(
            times.at(3, 0).unwrap_err().to_string(),
            "times.csv has rows for 3 frames only, but the recording has more; give a row for every frame"
        );
    }

    #[test]
    fn mistakes_are_named_with_their_line() {
        for (text, said) in [
            ("", "times.csv:1: the column 'frame' is missing; the head is frame,time_ns"),
            ("frame,time\n", "times.csv:1: the column 'time_ns' is missing; the head is frame,time_ns"),
            ("frame,time_ns\n", "times.csv:1: there is no row; give one for every frame"),
            ("frame,time_ns\n0,5\n-1,6\n", "times.csv:3: '-1' is no frame number"),
            ("frame,time_ns\n0,0.5\n", "times.csv:2: '0.5' is no time in whole ns"),
            (
                "frame,time_ns\n0,5\n1,5\n",
                "times.csv:3: frame and time_ns must be above those of the row before",
            ),
            ("frame,time_ns\n0\n", "times.csv:2: it has more or fewer fields than the head"),
        ] {
            assert_eq!(Times::parse(text, "times.csv").unwrap_err().to_string(), said);
        }
    }
}
