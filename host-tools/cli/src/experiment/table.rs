//! The thesis' tables with ours beneath: MAX, RMSE, MEAN, STD of x / y / z and of roll / pitch / yaw.

use std::fmt::Write;

use gangway_report::{Deviation, Evaluation};

use super::thesis::{Published, Statistics};

/// A line of ours: one set of figures a seed.
pub(crate) struct Line {
    label: String,
    seeds: Vec<Statistics>,
    /// Why the box refused its setup.
    pub(crate) refused: Option<String>,
}

impl Line {
    pub(crate) fn new(label: &str) -> Self {
        Self { label: label.to_owned(), seeds: Vec::new(), refused: None }
    }

    pub(crate) fn add(&mut self, evaluation: &Evaluation) {
        self.seeds.extend(evaluation.deviation.as_ref().map(statistics));
    }

    /// Medians over the seeds; `None` of none.
    pub(crate) fn medians(&self) -> Option<Statistics> {
        let median = |of: fn(&Statistics) -> &[f64; 6]| -> Option<[f64; 6]> {
            let mut all = [0.0; 6];
            for (i, value) in all.iter_mut().enumerate() {
                *value = median(self.seeds.iter().map(|s| of(s)[i]).collect())?;
            }
            Some(all)
        };
        Some(Statistics {
            max: median(|s| &s.max)?,
            rmse: median(|s| &s.rmse)?,
            mean: median(|s| &s.mean)?,
            std: median(|s| &s.std)?,
        })
    }
}

/// The middle value, the mean of the two middle ones where their number is even.
pub(crate) fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let middle = values.len().checked_sub(1)?;
    Some(0.5 * (values[middle / 2] + values[middle.div_ceil(2)]))
}

/// The figures of an evaluation.
pub(crate) fn statistics(deviation: &[Deviation; 6]) -> Statistics {
    Statistics {
        max: deviation.each_ref().map(|d| d.max),
        rmse: deviation.each_ref().map(|d| d.rmse),
        mean: deviation.each_ref().map(|d| d.mean),
        std: deviation.each_ref().map(|d| d.std),
    }
}

/// The two blocks of the table, translations and rotations.
pub(crate) fn text(published: &[Published], lines: &[Line]) -> String {
    let rows: Vec<(String, Option<Statistics>, bool)> = published
        .iter()
        .map(|p| (format!("thesis {}", p.name), Some(p.statistics), true))
        .chain(lines.iter().map(|line| (line.label.clone(), line.medians(), false)))
        .collect();
    let width = rows.iter().map(|(label, ..)| label.chars().count()).max().unwrap_or(0).max(8);
    let mut text = String::new();
    for (block, unit, names, digits) in
        [(0, "(mm)", "x / y / z", [1, 2]), (3, "(degrees)", "roll / pitch / yaw", [2, 3])]
    {
        let mut block_rows =
            vec![(unit, Some([&format!("MAX {names}"), "RMSE", "MEAN", "STD"].map(str::to_owned)))];
        for (label, statistics, is_published) in &rows {
            let digits = digits[usize::from(!*is_published)];
            let cells = statistics.map(|of| of.all().map(|of| cell(&of[block..block + 3], digits)));
            block_rows.push((label, cells));
        }
        let longest = block_rows.iter().flat_map(|(_, cells)| cells.iter().flatten()).map(String::len).max();
        let column = longest.unwrap_or(0) + 2;
        for (label, cells) in block_rows {
            let cells = cells.map_or("not measured".to_owned(), |cells| {
                cells.map(|cell| format!("{cell:column$}")).concat()
            });
            let _ = writeln!(text, "{label:width$}  {}", cells.trim_end());
        }
    }
    for line in lines {
        if let Some(why) = &line.refused {
            let _ = writeln!(text, "{}: {why}", line.label);
        }
    }
    text
}

/// Rows as lines, each column as wide as its longest cell needs.
pub(crate) fn aligned(rows: &[Vec<String>]) -> String {
    let width = |i: usize| rows.iter().filter_map(|row| row.get(i)).map(String::len).max().unwrap_or(0);
    let widths: Vec<usize> = (0..rows.iter().map(Vec::len).max().unwrap_or(0)).map(width).collect();
    let line = |row: &Vec<String>| {
        let cells = row.iter().zip(&widths).map(|(cell, width)| format!("{cell:width$}  "));
        cells.collect::<String>().trim_end().to_owned() + "\n"
    };
    rows.iter().map(line).collect()
}

/// `0.51 / 0.02 / 0.03`, no minus before a zero.
pub(crate) fn cell(values: &[f64], digits: usize) -> String {
    let number = |value: &f64| {
        let text = format!("{value:.digits$}");
        let is_zero = text.bytes().all(|b| matches!(b, b'-' | b'0' | b'.'));
        if is_zero { text.trim_start_matches('-').to_owned() } else { text }
    };
    values.iter().map(number).collect::<Vec<_>>().join(" / ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn medians_are_taken_number_by_number() {
        let mut line = Line::new("ours");
        assert_eq!(line.medians(), None);
        for max in [3.0, 1.0, 2.0] {
            line.seeds.push(Statistics { max: [max, -max, 0.0, 0.0, 0.0, 0.0], ..Statistics::default() });
        }
        assert_eq!(line.medians().unwrap().max[..3], [2.0, -2.0, 0.0]);
        assert_eq!(median(vec![4.0, 1.0, 2.0, 9.0]), Some(3.0));
    }

    #[test]
    fn a_column_is_as_wide_as_its_longest_cell() {
        let rows = [["circles", "MAX"], ["4", "123.45 / 0.10"], ["28", "1"]];
        let text = aligned(&rows.map(|row| row.map(str::to_owned).to_vec()));
        assert_eq!(text, "circles  MAX\n4        123.45 / 0.10\n28       1\n");
    }

    #[test]
    fn columns_stay_apart_however_long_their_numbers_are() {
        let mut ours = Line::new("ours");
        ours.seeds.push(Statistics {
            mean: [-123.4, -0.002, -0.314, -0.083, -12.3, -4.0],
            ..Statistics::default()
        });
        let text = text(&[], &[ours]);
        assert!(text.contains("-123.40 / 0.00 / -0.31  0.00 / 0.00 / 0.00"), "{text}");
        assert!(text.contains("-0.083 / -12.300 / -4.000  0.000 / 0.000 / 0.000"), "{text}");
    }

    #[test]
    fn a_line_has_the_digits_of_its_source_and_a_refusal_its_reason() {
        let published = [Published {
            name: "DLT",
            statistics: Statistics { max: [1.5, 0.6, 0.3, 0.01, 0.59, 0.57], ..Statistics::default() },
        }];
        let mut ours = Line::new("ours DLT");
        ours.seeds
            .push(Statistics { max: [0.514, 0.02, -0.001, 0.0014, 0.02, 0.0], ..Statistics::default() });
        let mut refused = Line::new("ours EPnP");
        refused.refused = Some("nearly one plane".to_owned());
        let text = text(&published, &[ours, refused]);
        assert!(text.contains("thesis DLT  1.5 / 0.6 / 0.3 "), "{text}");
        assert!(text.contains("ours DLT    0.51 / 0.02 / 0.00 "), "{text}");
        assert!(text.contains("ours DLT    0.001 / 0.020 / 0.000 "), "{text}");
        assert!(text.contains("ours EPnP   not measured"), "{text}");
        assert!(text.ends_with("ours EPnP: nearly one plane\n"), "{text}");
    }
}
