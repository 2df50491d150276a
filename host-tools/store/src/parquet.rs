//! The tables as Parquet: the columns of the CSV, numbers as numbers, what does not exist as null.

use std::error::Error;
use std::io::{self, Write};
use std::sync::Arc;

use parquet::basic::Compression;
use parquet::data_type::{
    BoolType, ByteArray, ByteArrayType, DataType, DoubleType, FloatType, Int32Type, Int64Type,
};
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::parser::parse_message_type;

use crate::export::Rows;
use crate::rows::{MARKER_COLUMNS, MarkerRow, POSE_COLUMNS, PoseRow, flag_words, numbers};

/// Rows of a row group.
const GROUP: usize = 1 << 18;

/// Writes the table.
pub(crate) fn write(rows: &Rows, out: impl Write + Send) -> io::Result<()> {
    write_all(rows, out).map_err(|error| match error {
        ParquetError::External(inner) => io_error(inner),
        other => io::Error::other(other),
    })
}

/// The error of the file itself where there is one: a full disk is to be told apart.
fn io_error(inner: Box<dyn Error + Send + Sync>) -> io::Error {
    match inner.downcast::<io::Error>() {
        Ok(error) => *error,
        Err(inner) => io::Error::other(inner),
    }
}

fn write_all(rows: &Rows, out: impl Write + Send) -> Result<(), ParquetError> {
    let schema = Arc::new(parse_message_type(&schema(rows))?);
    let properties = WriterProperties::builder().set_compression(Compression::UNCOMPRESSED).build();
    let mut writer = SerializedFileWriter::new(out, schema, Arc::new(properties))?;
    match rows {
        Rows::Poses(rows) => {
            for rows in rows.chunks(GROUP) {
                let mut group = writer.next_row_group()?;
                poses(rows, &mut group)?;
                group.close()?;
            }
        }
        Rows::Markers(rows) => {
            for rows in rows.chunks(GROUP) {
                let mut group = writer.next_row_group()?;
                markers(rows, &mut group)?;
                group.close()?;
            }
        }
    }
    writer.close()?;
    Ok(())
}

/// The message type, from the names of the columns.
fn schema(rows: &Rows) -> String {
    let (name, columns) = match rows {
        Rows::Poses(_) => ("poses", &POSE_COLUMNS[..]),
        Rows::Markers(_) => ("markers", &MARKER_COLUMNS[..]),
    };
    let fields = columns.iter().map(|column| match (*column, rows) {
        ("frame" | "time_ns", _) => format!("REQUIRED INT64 {column};"),
        ("markers" | "circle", _) => format!("REQUIRED INT32 {column};"),
        ("flags", _) => format!("REQUIRED BYTE_ARRAY {column} (STRING);"),
        ("used", _) => format!("REQUIRED BOOLEAN {column};"),
        (_, Rows::Poses(_)) => format!("OPTIONAL FLOAT {column};"),
        (_, Rows::Markers(_)) => format!("REQUIRED DOUBLE {column};"),
    });
    format!("message {name} {{ {} }}", fields.collect::<String>())
}

/// Writes the next column; `present` has 1 for a row with a value and 0 for one without.
fn column<T: DataType>(
    group: &mut SerializedRowGroupWriter<'_, impl Write + Send>,
    values: impl Iterator<Item = T::T>,
    present: Option<&[i16]>,
) -> Result<(), ParquetError> {
    let Some(mut column) = group.next_column()? else {
        return Err(ParquetError::General("more columns than the schema has".to_owned()));
    };
    let values: Vec<_> = values.collect();
    column.typed::<T>().write_batch(&values, present, None)?;
    column.close()
}

fn poses(
    rows: &[PoseRow],
    group: &mut SerializedRowGroupWriter<'_, impl Write + Send>,
) -> Result<(), ParquetError> {
    let present: Vec<i16> = rows.iter().map(|row| i16::from(row.motion.is_some())).collect();
    column::<Int64Type>(group, rows.iter().map(|row| row.frame.into()), None)?;
    column::<Int64Type>(group, rows.iter().map(|row| row.time_ns as i64), None)?;
    let motions: Vec<[f32; 13]> = rows.iter().filter_map(numbers).collect();
    for number in 0..13 {
        column::<FloatType>(group, motions.iter().map(|motion| motion[number]), Some(&present))?;
    }
    column::<Int32Type>(group, rows.iter().map(|row| row.markers.into()), None)?;
    let words = rows.iter().map(|row| ByteArray::from(flag_words(row.flags).into_bytes()));
    column::<ByteArrayType>(group, words, None)
}

fn markers(
    rows: &[MarkerRow],
    group: &mut SerializedRowGroupWriter<'_, impl Write + Send>,
) -> Result<(), ParquetError> {
    column::<Int64Type>(group, rows.iter().map(|row| row.frame.into()), None)?;
    column::<Int32Type>(group, rows.iter().map(|row| row.circle.into()), None)?;
    for axis in 0..2 {
        column::<DoubleType>(group, rows.iter().map(|row| row.at_px[axis]), None)?;
    }
    for entry in 0..3 {
        column::<DoubleType>(group, rows.iter().map(|row| row.covariance_px2[entry]), None)?;
    }
    column::<BoolType>(group, rows.iter().map(|row| row.used), None)
}

#[cfg(test)]
mod tests {
    use std::fs::File;

    use parquet::file::reader::SerializedFileReader;
    use parquet::record::{Field, Row};

    use super::*;
    use crate::testing::pose;

    fn read(rows: &Rows) -> Vec<Row> {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("table.parquet");
        write(rows, File::create(&path).unwrap()).unwrap();
        let reader = SerializedFileReader::new(File::open(&path).unwrap()).unwrap();
        reader.into_iter().map(Result::unwrap).collect()
    }

    #[test]
    fn poses_read_back_with_nulls_where_there_is_no_pose() {
        let rows: Vec<_> = (0..6).map(pose).collect();
        let back = read(&Rows::Poses(rows.clone()));
        assert_eq!(back.len(), 6);
        for (row, pose) in back.iter().zip(&rows) {
            let fields: Vec<_> = row.get_column_iter().collect();
            assert!(fields.iter().map(|(name, _)| name.as_str()).eq(POSE_COLUMNS));
            assert_eq!(fields[0].1, &Field::Long(pose.frame.into()));
            assert_eq!(fields[1].1, &Field::Long(pose.time_ns as i64));
            for number in 0..13 {
                let expected = numbers(pose).map_or(Field::Null, |all| Field::Float(all[number]));
                assert_eq!(fields[2 + number].1, &expected);
            }
            assert_eq!(fields[15].1, &Field::Int(5));
            assert_eq!(fields[16].1, &Field::Str(flag_words(pose.flags)));
        }
    }

    #[test]
    fn centres_read_back_and_an_empty_table_has_its_columns() {
        let row = MarkerRow {
            frame: 7,
            circle: 3,
            at_px: [1.5, 2.25],
            covariance_px2: [0.25, -0.125, 0.5],
            used: true,
        };
        let back = read(&Rows::Markers(vec![row]));
        let fields: Vec<_> = back[0].get_column_iter().map(|(_, field)| field.clone()).collect();
        let doubles = [1.5, 2.25, 0.25, -0.125, 0.5].map(Field::Double);
        assert_eq!(fields[..2], [Field::Long(7), Field::Int(3)]);
        assert_eq!(fields[2..7], doubles);
        assert_eq!(fields[7], Field::Bool(true));
        assert_eq!(read(&Rows::Markers(vec![])).len(), 0);
    }
}
