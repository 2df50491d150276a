//! A motion as a table of six columns (x, y, z in mm, roll, pitch, yaw in degrees), a line a frame; a header
//! and a first column `frame` may be there, so that a truth file moves a scene again.

use std::path::Path;

use crate::error::{Mistake, SceneError};
use crate::motion::Motions;

/// Reads the table's text; `file` is its name for messages.
pub(crate) fn parse(text: &str, file: &Path) -> Result<Vec<Motions>, SceneError> {
    let mut rows = Vec::new();
    for (i, line) in text.lines().enumerate() {
        let wrong = |message: String| SceneError::Value {
            file: file.display().to_string(),
            line: i + 1,
            key: String::new(),
            message,
        };
        let line = line.trim();
        let header = i == 0 && line.starts_with(|c: char| c.is_ascii_alphabetic());
        if line.is_empty() || header {
            continue;
        }
        let mut fields: Vec<&str> = line.split(',').map(str::trim).collect();
        if fields.len() == 7 {
            fields.remove(0);
        }
        let fields: [&str; 6] = fields.try_into().map_err(|fields: Vec<&str>| {
            wrong(format!(
                "{} columns, allowed are six (x y z roll pitch yaw), or seven with `frame`",
                fields.len()
            ))
        })?;
        let mut row = [0.0; 6];
        for (value, field) in row.iter_mut().zip(fields) {
            *value = field.parse().ok().filter(|value: &f64| value.abs() <= 1e5).ok_or_else(|| {
                wrong(format!("`{field}`, allowed are numbers of at most 100000 mm or degrees"))
            })?;
        }
        rows.push(row);
    }
    Ok(rows)
}

/// Refuses an empty table.
pub(crate) fn some_rows(rows: Vec<Motions>, file: &Path) -> Result<Vec<Motions>, Mistake> {
    if rows.is_empty() {
        return Err(Mistake::new("motion.csv", format!("{} holds no line of numbers", file.display())));
    }
    Ok(rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_is_read_with_and_without_header_and_frame_numbers() {
        let want = vec![[1.0, 2.0, 3.0, 0.1, 0.2, 0.3], [-1.0, 0.0, 0.0, 0.0, 0.0, 0.0]];
        let path = Path::new("m.csv");
        assert_eq!(parse("1,2,3,0.1,0.2,0.3\n-1,0,0,0,0,0\n", path).unwrap(), want);
        let text = "frame,dx_mm,dy_mm,dz_mm,roll_deg,pitch_deg,yaw_deg\n0, 1,2,3,0.1,0.2,0.3\n1,-1,0,0,0,0,0";
        assert_eq!(parse(text, path).unwrap(), want);
    }

    #[test]
    fn a_bad_line_of_a_table_is_named() {
        let path = Path::new("m.csv");
        let error = parse("x,y\n1,2,3,4,5,six\n", path).unwrap_err().to_string();
        assert!(error.starts_with("m.csv:2: `six`"), "{error}");
        let error = parse("1,2\n", path).unwrap_err().to_string();
        assert!(error.starts_with("m.csv:1: 2 columns"), "{error}");
        assert!(parse("1,2,3,4,5,NaN\n", path).is_err());
    }
}
