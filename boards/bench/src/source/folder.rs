//! A directory of PNG or PGM files, in the order of the numbers in their names.

use std::cmp::Ordering;
use std::path::{Path, PathBuf};

use super::{FrameSource, Shape, SourceError, pgm, png};

/// The pictures of a directory; other files in it are passed over.
pub struct Folder {
    name: String,
    files: Vec<PathBuf>,
    next: usize,
    shape: Shape,
    is_colour: bool,
}

impl Folder {
    /// Lists the directory and reads its first picture.
    ///
    /// # Errors
    /// No picture in it, or the first cannot be read.
    pub fn open(path: &Path) -> Result<Self, SourceError> {
        let name = path.display().to_string();
        let io = |source| SourceError::Io { name: name.clone(), source };
        let mut files = Vec::new();
        for entry in std::fs::read_dir(path).map_err(io)? {
            let file = entry.map_err(io)?.path();
            let extension = file.extension().and_then(|text| text.to_str()).unwrap_or_default();
            if file.is_file()
                && (extension.eq_ignore_ascii_case("png") || extension.eq_ignore_ascii_case("pgm"))
            {
                files.push(file);
            }
        }
        files.sort_by(|a, b| natural(&a.to_string_lossy(), &b.to_string_lossy()));
        let first = files.first().ok_or_else(|| SourceError::EmptyDirectory { name: name.clone() })?;
        let (shape, is_colour) = read(first, &mut Vec::new())?;
        Ok(Self { name, files, next: 0, shape, is_colour })
    }
}

impl FrameSource for Folder {
    fn shape(&self) -> Shape {
        self.shape
    }

    fn rate_hz(&self) -> Option<f64> {
        None
    }

    fn read(&mut self, into: &mut Vec<u8>) -> Result<bool, SourceError> {
        let Some(file) = self.files.get(self.next) else { return Ok(false) };
        let (shape, _) = read(file, into)?;
        if shape != self.shape {
            let (name, found, expected) =
                (file.display().to_string(), describe(&shape), describe(&self.shape));
            return Err(SourceError::Unlike { name, found, expected });
        }
        self.next += 1;
        Ok(true)
    }

    fn rewind(&mut self) -> Result<(), SourceError> {
        self.next = 0;
        Ok(())
    }

    fn remark(&self) -> Option<String> {
        let colour = self
            .is_colour
            .then(|| format!("the pictures of {} are in colour; their luma is used", self.name));
        let gap = gap(&self.files).map(|(before, behind)| {
            format!(
                "numbers are missing in {}, as between {before} and {behind}; frames are counted on all the \
                 same: give their own numbers and times with --times",
                self.name
            )
        });
        let remarks: Vec<_> = colour.into_iter().chain(gap).collect();
        (!remarks.is_empty()).then(|| remarks.join("\n"))
    }
}

/// Names of the first two files between whose numbers others are missing. Names that rise by more than one
/// everywhere hold times or the like, not frame numbers.
fn gap(files: &[PathBuf]) -> Option<(String, String)> {
    let numbers: Option<Vec<u64>> = files.iter().map(|file| number(file)).collect();
    let numbers = numbers?;
    let steps = || numbers.windows(2).map(|pair| pair[1].checked_sub(pair[0]));
    let counts = steps().all(|step| step.is_some_and(|step| step > 0)) && steps().any(|step| step == Some(1));
    let at = steps().position(|step| step > Some(1)).filter(|_| counts)?;
    let name = |file: &PathBuf| file.file_name().unwrap_or_default().to_string_lossy().into_owned();
    Some((name(&files[at]), name(&files[at + 1])))
}

/// The last number in a file's name.
fn number(file: &Path) -> Option<u64> {
    let stem = file.file_stem()?.to_str()?;
    let stem = stem.trim_end_matches(|c: char| !c.is_ascii_digit());
    let before = stem.trim_end_matches(|c: char| c.is_ascii_digit());
    stem[before.len()..].parse().ok()
}

fn read(file: &Path, into: &mut Vec<u8>) -> Result<(Shape, bool), SourceError> {
    let name = || file.display().to_string();
    let bytes = std::fs::read(file).map_err(|source| SourceError::Io { name: name(), source })?;
    let is_png = file.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("png"));
    let form = if is_png { "PNG" } else { "PGM" };
    let read =
        if is_png { png::read(&bytes, into) } else { pgm::read(&bytes, into).map(|shape| (shape, false)) };
    read.map_err(|why| SourceError::Header { name: name(), form, why })
}

fn describe(shape: &Shape) -> String {
    format!("{} x {} with {} bit", shape.width, shape.height, shape.layout.bits())
}

/// `frame9` before `frame10`: runs of digits compare as numbers.
fn natural(a: &str, b: &str) -> Ordering {
    let (mut a, mut b) = (a, b);
    while !a.is_empty() && !b.is_empty() {
        let (run_a, run_b) = (run(a), run(b));
        let order = match (run_a.trim_start_matches('0'), run_b.trim_start_matches('0')) {
            (x, y) if is_number(run_a) && is_number(run_b) => x.len().cmp(&y.len()).then(x.cmp(y)),
            _ => run_a.cmp(run_b),
        };
        if order.is_ne() {
            return order;
        }
        (a, b) = (a.get(run_a.len()..).unwrap_or_default(), b.get(run_b.len()..).unwrap_or_default());
    }
    a.len().cmp(&b.len())
}

fn is_number(run: &str) -> bool {
    run.starts_with(|first: char| first.is_ascii_digit())
}

/// The digits that a text starts with, or what stands before its first digit.
fn run(text: &str) -> &str {
    let is_digit = is_number(text);
    let end = text.find(|next: char| next.is_ascii_digit() != is_digit).unwrap_or(text.len());
    text.get(..end).unwrap_or(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_in_names_are_compared_as_numbers() {
        let mut names = ["f10", "f9", "f009a", "f1", "g", "f", "f100000000000000000000", "f2b3", "f2b20"];
        names.sort_by(|a, b| natural(a, b));
        assert_eq!(names, ["f", "f1", "f2b3", "f2b20", "f9", "f009a", "f10", "f100000000000000000000", "g"]);
    }

    #[test]
    fn pictures_come_in_order_and_again() {
        let place = tempfile::tempdir().unwrap();
        for number in [10, 9, 1] {
            let file = place.path().join(format!("frame{number}.pgm"));
            std::fs::write(file, [&b"P5 1 1 255 "[..], &[number]].concat()).unwrap();
        }
        std::fs::write(place.path().join("notes.txt"), "no picture").unwrap();
        let mut source = Folder::open(place.path()).unwrap();
        let mut picture = Vec::new();
        for _ in 0..2 {
            for number in [1, 9, 10] {
                assert!(source.read(&mut picture).unwrap());
                assert_eq!(picture, [number]);
            }
            assert!(!source.read(&mut picture).unwrap());
            source.rewind().unwrap();
        }
    }

    #[test]
    fn missing_numbers_are_told() {
        let told = |names: &[&str]| gap(&names.iter().map(PathBuf::from).collect::<Vec<_>>());
        let names = |a: &str, b: &str| Some((a.to_owned(), b.to_owned()));
        assert_eq!(told(&["d/f8.png", "d/f9.png", "d/f11.png", "d/f14.png"]), names("f9.png", "f11.png"));
        assert_eq!(told(&["a2_007c.pgm", "a2_008c.pgm", "a2_010c.pgm"]), names("a2_008c.pgm", "a2_010c.pgm"));
        for whole in [&["f8.png", "f9.png", "f10.png"][..], &["at20.png", "at40.png"], &["a.png", "b.png"]] {
            assert_eq!(told(whole), None);
        }
        assert_eq!(told(&["a1.png", "a2.png", "b1.png"]), None, "two series");
        assert_eq!(told(&["é1é.png", "é2é.png", "é4é.png"]), names("é2é.png", "é4é.png"));
    }

    #[test]
    fn an_empty_directory_is_one_sentence() {
        let place = tempfile::tempdir().unwrap();
        let said = Folder::open(place.path()).err().unwrap().to_string();
        let name = place.path().display();
        assert_eq!(said, format!("the directory {name} holds no PNG or PGM file; give one that does"));
    }

    #[test]
    fn a_picture_of_another_size_or_depth_is_named() {
        let place = tempfile::tempdir().unwrap();
        std::fs::write(place.path().join("1.pgm"), b"P5 1 1 255 a").unwrap();
        std::fs::write(place.path().join("2.pgm"), b"P5 2 1 1023 abcd").unwrap();
        let mut source = Folder::open(place.path()).unwrap();
        let mut picture = Vec::new();
        assert!(source.read(&mut picture).unwrap());
        let said = source.read(&mut picture).unwrap_err().to_string();
        assert!(said.contains("2.pgm is 2 x 1 with 10 bit, but the pictures before it are 1 x 1 with 8 bit"));
    }

    #[test]
    fn a_damaged_picture_is_named() {
        let place = tempfile::tempdir().unwrap();
        std::fs::write(place.path().join("1.png"), b"rubbish").unwrap();
        let said = Folder::open(place.path()).err().unwrap().to_string();
        assert!(said.contains("1.png is no PNG file that can be read: "), "{said}");
    }
}
