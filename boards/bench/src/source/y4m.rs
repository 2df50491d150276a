//! YUV4MPEG2 (Y4M): a line of parameters, then frames of raw planes, luma first. Only luma is kept.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read, Seek, SeekFrom};
use std::path::Path;

use gangway_device::Layout;

use super::{FrameSource, Shape, SourceError};

const MAGIC: &[u8] = b"YUV4MPEG2";
/// Longest line of parameters that is read, bytes.
const MAX_LINE: u64 = 1_024;

enum Input {
    File(File),
    Stream(Box<dyn Read + Send>),
}

impl Read for Input {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        match self {
            Self::File(file) => file.read(into),
            Self::Stream(stream) => stream.read(into),
        }
    }
}

impl Seek for Input {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        match self {
            Self::File(file) => file.seek(to),
            Self::Stream(_) => Err(io::ErrorKind::NotSeekable.into()),
        }
    }
}

/// Whether a file begins as Y4M does.
pub(super) fn is_y4m(path: &Path) -> bool {
    let mut head = Vec::new();
    let read = File::open(path).and_then(|file| file.take(MAGIC.len() as u64).read_to_end(&mut head));
    read.is_ok() && head == MAGIC
}

/// A Y4M file or stream.
///
/// Mono, 4:1:1, 4:2:0, 4:2:2 and 4:4:4 (with or without alpha), 8 bit, and 9 to 16 bit in little-endian
/// words. Parameters of single frames are passed over.
pub struct Y4m {
    name: String,
    input: BufReader<Input>,
    shape: Shape,
    rate_hz: Option<f64>,
    /// Bytes of the planes behind luma.
    chroma: u64,
    header_bytes: u64,
    frames: u64,
}

impl Y4m {
    /// Opens a file.
    ///
    /// # Errors
    /// The file cannot be opened, its head makes no sense, or it has not one whole frame.
    pub fn open(path: &Path) -> Result<Self, SourceError> {
        let name = path.display().to_string();
        let io = |source| SourceError::Io { name: name.clone(), source };
        let file = File::open(path).map_err(io)?;
        let kind = file.metadata().map_err(io)?;
        let y4m = Self::new(&name, Input::File(file))?;
        // The length of a pipe is not known before its end.
        let behind_head = if kind.is_file() { kind.len().saturating_sub(y4m.header_bytes) } else { u64::MAX };
        if behind_head == 0 {
            return Err(SourceError::Empty { name });
        }
        if behind_head < y4m.shape.bytes() as u64 + y4m.chroma {
            return Err(SourceError::NoWholeFrame { name });
        }
        Ok(y4m)
    }

    /// Reads a stream, which can be read once.
    ///
    /// # Errors
    /// Its head makes no sense.
    pub fn stream(name: &str, stream: Box<dyn Read + Send>) -> Result<Self, SourceError> {
        Self::new(name, Input::Stream(stream))
    }

    fn new(name: &str, input: Input) -> Result<Self, SourceError> {
        let mut input = BufReader::with_capacity(64 * 1024, input);
        let wrong =
            |why: &str| SourceError::Header { name: name.to_owned(), form: "Y4M", why: why.to_owned() };
        let line = line(&mut input)
            .map_err(|source| SourceError::Io { name: name.to_owned(), source })?
            .ok_or_else(|| wrong("its first line does not end"))?;
        let header_bytes = line.len() as u64 + 1;
        let text = std::str::from_utf8(&line).map_err(|_| wrong("its first line is no text"))?;
        let mut words = text.split(' ').filter(|word| !word.is_empty());
        if words.next().map(str::as_bytes) != Some(MAGIC) {
            return Err(wrong("it does not begin with YUV4MPEG2"));
        }
        let (mut width, mut height, mut rate, mut colour) = (None, None, None, "420");
        for word in words {
            let (tag, value) = word.split_at_checked(1).unwrap_or(("", word));
            match tag {
                "W" => width = value.parse().ok().filter(|&width: &u16| width > 0),
                "H" => height = value.parse().ok().filter(|&height: &u16| height > 0),
                "F" => rate = ratio(value),
                "I" if !matches!(value, "p" | "?") => {
                    return Err(wrong("it is interlaced; a frame must have been exposed at once"));
                }
                "C" => colour = value,
                _ => {}
            }
        }
        let width = width.ok_or_else(|| wrong("its width (W) is missing or not from 1 to 65535"))?;
        let height = height.ok_or_else(|| wrong("its height (H) is missing or not from 1 to 65535"))?;
        let (layout, chroma) = colour_space(colour, u64::from(width), u64::from(height))
            .ok_or_else(|| SourceError::ColourSpace { name: name.to_owned(), found: colour.to_owned() })?;
        let shape = Shape { width, height, layout };
        Ok(Self { name: name.to_owned(), input, shape, rate_hz: rate, chroma, header_bytes, frames: 0 })
    }

    fn io(&self, source: io::Error) -> SourceError {
        match source.kind() {
            io::ErrorKind::UnexpectedEof => {
                SourceError::CutOff { name: self.name.clone(), frame: self.frames }
            }
            _ => SourceError::Io { name: self.name.clone(), source },
        }
    }

    /// Frames read since the start.
    pub(super) fn frames(&self) -> u64 {
        self.frames
    }
}

impl FrameSource for Y4m {
    fn shape(&self) -> Shape {
        self.shape
    }

    fn rate_hz(&self) -> Option<f64> {
        self.rate_hz
    }

    fn read(&mut self, into: &mut Vec<u8>) -> Result<bool, SourceError> {
        let is_over = self.input.fill_buf().map(<[u8]>::is_empty);
        if is_over.map_err(|source| self.io(source))? {
            return match self.frames {
                0 => Err(SourceError::Empty { name: self.name.clone() }),
                _ => Ok(false),
            };
        }
        let head = line(&mut self.input);
        match head {
            Err(source) => return Err(self.io(source)),
            Ok(Some(line)) if line == b"FRAME" || line.starts_with(b"FRAME ") => {}
            // The start of a head, and nothing behind it.
            Ok(None) if self.input.fill_buf().is_ok_and(<[u8]>::is_empty) => {
                return Err(SourceError::CutOff { name: self.name.clone(), frame: self.frames });
            }
            Ok(_) => return Err(SourceError::NoFrame { name: self.name.clone(), before: self.frames }),
        }
        into.resize(self.shape.bytes(), 0);
        self.input.read_exact(into).map_err(|source| self.io(source))?;
        let passed = io::copy(&mut (&mut self.input).take(self.chroma), &mut io::sink());
        if passed.map_err(|source| self.io(source))? != self.chroma {
            return Err(SourceError::CutOff { name: self.name.clone(), frame: self.frames });
        }
        self.frames += 1;
        Ok(true)
    }

    fn rewind(&mut self) -> Result<(), SourceError> {
        let once = || SourceError::Once { name: self.name.clone() };
        // Through the buffer, which forgets what it holds.
        self.input.seek(SeekFrom::Start(self.header_bytes)).map_err(|_| once())?;
        self.frames = 0;
        Ok(())
    }
}

/// A line without its end; `None` where it is too long or the input is over before.
fn line(input: &mut impl BufRead) -> io::Result<Option<Vec<u8>>> {
    let mut line = Vec::new();
    input.take(MAX_LINE).read_until(b'\n', &mut line)?;
    Ok((line.pop() == Some(b'\n')).then_some(line))
}

/// `50:1` as a number; `0:0` is an unknown rate.
fn ratio(text: &str) -> Option<f64> {
    let (over, under) = text.split_once(':')?;
    let (over, under): (u32, u32) = (over.parse().ok()?, under.parse().ok()?);
    (over > 0 && under > 0).then(|| f64::from(over) / f64::from(under))
}

/// Layout of luma, and bytes of the planes behind it.
fn colour_space(name: &str, width: u64, height: u64) -> Option<(Layout, u64)> {
    let (sampling, rest) =
        if let Some(depth) = name.strip_prefix("mono") { ("mono", depth) } else { name.split_at_checked(3)? };
    let depth = match rest {
        "" => 8,
        "jpeg" | "mpeg2" | "paldv" if sampling == "420" => 8,
        "alpha" if sampling == "444" => return Some((Layout::GREY, 3 * width * height)),
        _ => rest.strip_prefix('p').unwrap_or(rest).parse().ok().filter(|depth| (9..=16).contains(depth))?,
    };
    let (across, down) = match sampling {
        "mono" => (0, 0),
        "420" => (width.div_ceil(2), height.div_ceil(2)),
        "422" => (width.div_ceil(2), height),
        "444" => (width, height),
        "411" => (width.div_ceil(4), height),
        _ => return None,
    };
    let (layout, bytes) = if depth == 8 { (Layout::GREY, 1) } else { (Layout::Word { bits: depth }, 2) };
    Some((layout, 2 * across * down * bytes))
}

#[cfg(test)]
mod tests;
