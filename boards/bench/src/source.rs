//! Where recorded pictures come from: one trait, and a reader for every form in which they lie on disk.

mod error;
mod ffmpeg;
mod folder;
mod pgm;
mod png;
mod y4m;

use std::io;
use std::path::Path;

use gangway_device::Layout;

pub use error::SourceError;
pub use ffmpeg::Ffmpeg;
pub use folder::Folder;
pub use y4m::Y4m;

/// Size and samples of all pictures of a source. Rows lie one behind the other, without gaps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shape {
    /// Width, samples.
    pub width: u16,
    /// Height, rows.
    pub height: u16,
    /// [`Layout::GREY`] or [`Layout::Word`].
    pub layout: Layout,
}

impl Shape {
    /// Grey pictures of `bits` significant bits: a byte a sample up to 8, two little-endian bytes above.
    pub fn grey(width: u16, height: u16, bits: u8) -> Self {
        let layout = if bits <= 8 { Layout::GREY } else { Layout::Word { bits } };
        Self { width, height, layout }
    }

    /// Bytes from one row to the next.
    pub fn stride(&self) -> usize {
        self.layout.row_bytes(self.width).unwrap_or(0)
    }

    /// Bytes of a picture.
    pub fn bytes(&self) -> usize {
        self.stride() * usize::from(self.height)
    }
}

/// A row of pictures, read one after the other. A simulator can be one.
pub trait FrameSource: Send {
    /// Size and samples of the pictures.
    fn shape(&self) -> Shape;

    /// Pictures a second, where the source says so.
    fn rate_hz(&self) -> Option<f64>;

    /// Reads the next picture into `into`, whose content is replaced: [`Shape::bytes`] bytes. `false` at the
    /// end.
    ///
    /// # Errors
    /// The source is damaged or gone; the pictures before are good.
    fn read(&mut self, into: &mut Vec<u8>) -> Result<bool, SourceError>;

    /// Starts again with the first picture.
    ///
    /// # Errors
    /// [`SourceError::Once`] where a source can be read once only.
    fn rewind(&mut self) -> Result<(), SourceError>;

    /// What the user should know about how the pictures are read.
    fn remark(&self) -> Option<String> {
        None
    }
}

/// Opens what was named: `-` for standard input (Y4M), a directory of PNG or PGM files, a Y4M file, or any
/// other video through `ffmpeg`.
///
/// # Errors
/// A sentence for everything that can be wrong before the first picture.
pub fn open(path: &Path) -> Result<Box<dyn FrameSource>, SourceError> {
    let name = path.display().to_string();
    if name == "-" {
        return Ok(Box::new(Y4m::stream("standard input", Box::new(io::stdin()))?));
    }
    let kind = std::fs::metadata(path).map_err(|error| match error.kind() {
        io::ErrorKind::NotFound => SourceError::Missing { name: name.clone() },
        _ => SourceError::Io { name: name.clone(), source: error },
    })?;
    if kind.is_dir() {
        return Ok(Box::new(Folder::open(path)?));
    }
    if kind.is_file() && kind.len() == 0 {
        return Err(SourceError::Empty { name });
    }
    // A pipe cannot be looked into first: what comes through one is Y4M.
    if !kind.is_file() || y4m::is_y4m(path) {
        return Ok(Box::new(Y4m::open(path)?));
    }
    Ok(Box::new(Ffmpeg::open(path, "ffmpeg")?))
}

/// Big-endian words, as PNG and PGM hold them, to the frame's little-endian ones.
fn to_little_endian(words: &mut [u8]) {
    for word in words.chunks_exact_mut(2) {
        word.swap(0, 1);
    }
}
