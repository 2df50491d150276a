//! A session as a table for other programs: CSV, or Parquet with the same columns and nulls.

use std::fs;
use std::io::{self, BufWriter, Write};
use std::path::Path;

use crate::meta::replace;
use crate::rows::{MARKER_COLUMNS, MarkerRow, POSE_COLUMNS, PoseRow, flag_words, numbers};
use crate::{Session, StoreError, parquet};

/// Formats of an export.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Comma-separated, one line of names; an empty field is a value that does not exist.
    Csv,
    /// Parquet, uncompressed.
    Parquet,
}

/// The rows of an export.
#[derive(Clone, Debug, PartialEq)]
pub enum Rows {
    /// One a frame.
    Poses(Vec<PoseRow>),
    /// One a circle seen in a frame.
    Markers(Vec<MarkerRow>),
}

impl Rows {
    /// Rows in all.
    pub fn len(&self) -> usize {
        match self {
            Self::Poses(rows) => rows.len(),
            Self::Markers(rows) => rows.len(),
        }
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Reads the poses of a session, or its centres.
    ///
    /// # Errors
    /// The session cannot be read.
    pub fn read(session: &Session, markers: bool) -> Result<Self, StoreError> {
        Ok(if markers { Self::Markers(session.markers()?) } else { Self::Poses(session.poses()?) })
    }

    /// Writes the table.
    ///
    /// # Errors
    /// What `out` reports.
    pub fn write(&self, format: Format, out: impl Write + Send) -> io::Result<()> {
        match format {
            Format::Csv => self.write_csv(BufWriter::new(out)),
            Format::Parquet => parquet::write(self, out),
        }
    }

    /// Writes the table to a file, which appears only when it is complete.
    ///
    /// # Errors
    /// A full disk, no permission.
    pub fn save(&self, format: Format, path: &Path) -> Result<(), StoreError> {
        // A device or a pipe is written to; only a file can be replaced.
        if fs::metadata(path).is_ok_and(|about| !about.is_file()) {
            let open = fs::OpenOptions::new().write(true).open(path);
            return open
                .and_then(|file| self.write(format, file))
                .map_err(|e| StoreError::io("write", path, e));
        }
        replace(path, |file| self.write(format, file))
    }

    fn write_csv(&self, mut out: impl Write) -> io::Result<()> {
        match self {
            Self::Poses(rows) => {
                writeln!(out, "{}", POSE_COLUMNS.join(","))?;
                for pose in rows {
                    write!(out, "{},{},", pose.frame, pose.time_ns)?;
                    match numbers(pose) {
                        Some(numbers) => numbers.iter().try_for_each(|number| write!(out, "{number},"))?,
                        None => out.write_all(&[b','; 13])?,
                    }
                    writeln!(out, "{},{}", pose.markers, flag_words(pose.flags))?;
                }
            }
            Self::Markers(rows) => {
                writeln!(out, "{}", MARKER_COLUMNS.join(","))?;
                for MarkerRow { frame, circle, at_px: [u, v], covariance_px2: [uu, uv, vv], used } in rows {
                    // Centres have few digits (1/1024 px on the wire), covariances many zeros.
                    writeln!(out, "{frame},{circle},{u},{v},{uu:e},{uv:e},{vv:e},{}", u8::from(*used))?;
                }
            }
        }
        out.flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::ride;

    fn rows(dir: &Path, markers: bool) -> Rows {
        let file = dir.join("ride.gw");
        fs::write(&file, ride(1, 5)).unwrap();
        Rows::read(&Session::open(&file).unwrap().0, markers).unwrap()
    }

    #[test]
    fn a_frame_has_its_row_with_or_without_a_pose() {
        let dir = tempfile::tempdir().unwrap();
        let mut text = Vec::new();
        rows(dir.path(), false).write(Format::Csv, &mut text).unwrap();
        let text = String::from_utf8(text).unwrap();
        let lines: Vec<_> = text.lines().collect();
        assert_eq!(lines.len(), 1 + 5);
        assert_eq!(
            lines[0],
            "frame,time_ns,x_mm,y_mm,z_mm,roll_deg,pitch_deg,yaw_deg,x_sigma_mm,y_sigma_mm,z_sigma_mm,\
             roll_sigma_deg,pitch_sigma_deg,yaw_sigma_deg,residual_px,markers,flags"
        );
        assert_eq!(lines[1], "0,0,,,,,,,,,,,,,,5,waiting");
        assert!(lines[4].starts_with("3,60000000,1.5,-1.25,0.125,0.5,-0.25,0.0625,"), "{}", lines[4]);
        assert!(lines[4].ends_with(",5,"));
        assert!(lines.iter().all(|line| line.matches(',').count() == 16));
    }

    #[test]
    fn every_circle_that_was_seen_has_its_row() {
        let dir = tempfile::tempdir().unwrap();
        let rows = rows(dir.path(), true);
        assert_eq!(rows.len(), 25);
        let mut text = Vec::new();
        rows.write(Format::Csv, &mut text).unwrap();
        let text = String::from_utf8(text).unwrap();
        let line: Vec<_> = text.lines().nth(3).unwrap().split(',').collect();
        assert_eq!(line[..4], ["0", "2", "102.5", "200.25"]);
        let covariance: Vec<f64> = line[4..7].iter().map(|field| field.parse().unwrap()).collect();
        // Standard deviations and correlation have one byte each on the wire, to about 2 %.
        for (got, expected) in covariance.iter().zip([1.0 / 1024.0, 1.0 / 1024.0, 4.0 / 1024.0]) {
            assert!((got / expected - 1.0).abs() < 0.1, "{covariance:?}");
        }
        assert_eq!(line[7], "0", "seen, but not in the pose");
    }

    #[test]
    fn a_file_is_there_whole_or_not_at_all() {
        let dir = tempfile::tempdir().unwrap();
        let rows = rows(dir.path(), false);
        let path = dir.path().join("poses.csv");
        rows.save(Format::Csv, &path).unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap().lines().count(), 6);
        let said = rows.save(Format::Csv, &dir.path().join("none/poses.csv")).unwrap_err().to_string();
        assert!(said.contains("cannot write"), "{said}");
        let left: Vec<_> = fs::read_dir(dir.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
        assert_eq!(left.len(), 2, "nothing but the capture and the table: {left:?}");
    }

    #[test]
    fn a_full_device_is_said_and_not_replaced() {
        let dir = tempfile::tempdir().unwrap();
        for format in [Format::Csv, Format::Parquet] {
            let said = rows(dir.path(), false).save(format, Path::new("/dev/full")).unwrap_err();
            assert!(said.to_string().contains("disk is full"), "{said}");
        }
        assert!(!fs::metadata("/dev/full").unwrap().is_file());
    }
}
