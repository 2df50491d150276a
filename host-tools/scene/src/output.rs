//! A scene on disk: frames as Y4M or PNG, `truth.csv`, `setup.toml`. Each is written under a temporary name
//! and renamed when all are complete; what fails on the way takes its temporary files with it.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use rayon::prelude::*;

use crate::{Scene, SceneError};

/// Most frames that are rendered at the same time, and so kept in memory.
const FRAMES_AT_ONCE: usize = 8;

/// How frames are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// `frames.y4m`: YUV4MPEG2 with luma alone, 8 to 16 bit.
    Y4m,
    /// `frames/000000.png` and on: grey, 8 or 16 bit (fewer bits stand at the top, as PNG has it).
    Png,
}

impl Format {
    fn file(self) -> &'static str {
        match self {
            Self::Y4m => "frames.y4m",
            Self::Png => "frames",
        }
    }
}

/// What was written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Written {
    /// The Y4M file or the directory of PNG files.
    pub frames: PathBuf,
    /// The truth.
    pub truth: PathBuf,
    /// The setup file.
    pub setup: PathBuf,
}

/// A file or directory under a temporary name; gone when it is dropped before `keep`.
struct Temporary {
    path: PathBuf,
    name: PathBuf,
    kept: bool,
}

impl Temporary {
    fn new(name: PathBuf) -> Self {
        let file = name.file_name().unwrap_or_default().to_string_lossy();
        Self { path: name.with_file_name(format!(".{file}.{}.part", std::process::id())), name, kept: false }
    }

    fn keep(mut self) -> Result<PathBuf, SceneError> {
        fs::rename(&self.path, &self.name).map_err(|source| self.error(source))?;
        self.kept = true;
        Ok(self.name.clone())
    }

    fn error(&self, why: io::Error) -> SceneError {
        SceneError::Write { path: self.name.clone(), why }
    }

    fn text(name: PathBuf, text: &str) -> Result<Self, SceneError> {
        let file = Self::new(name);
        fs::write(&file.path, text).map_err(|source| file.error(source))?;
        Ok(file)
    }
}

impl Drop for Temporary {
    fn drop(&mut self) {
        if !self.kept {
            // What cannot be removed either was never there or is not ours to mend.
            let _ =
                if self.path.is_dir() { fs::remove_dir_all(&self.path) } else { fs::remove_file(&self.path) };
        }
    }
}

impl Scene {
    /// Writes frames, truth and setup into a directory, which is made if need be. `done` is told after each
    /// frame how many are complete, and may break off.
    ///
    /// # Errors
    /// A file cannot be written, or `done` broke off; what was begun is taken away again.
    pub fn write(
        &self,
        into: &Path,
        format: Format,
        mut done: impl FnMut(u32) -> ControlFlow<()>,
    ) -> Result<Written, SceneError> {
        let failed = |why| SceneError::Write { path: into.to_owned(), why };
        fs::create_dir_all(into).map_err(failed)?;
        let frames = Temporary::new(into.join(format.file()));
        // A file is replaced in one step, a directory of pictures is not.
        let in_the_way = match format {
            Format::Y4m => frames.name.is_dir(),
            Format::Png => frames.name.exists(),
        };
        if in_the_way {
            return Err(SceneError::Exists { path: frames.name.clone() });
        }
        let truth = Temporary::text(into.join("truth.csv"), &self.truth_text())?;
        let setup = Temporary::text(into.join("setup.toml"), &self.setup_text())?;
        let written = match format {
            Format::Y4m => self.write_y4m(&frames.path, &mut done),
            Format::Png => self.write_pngs(&frames.path, &mut done),
        };
        if written.map_err(|source| frames.error(source))?.is_break() {
            return Err(SceneError::Stopped { path: into.to_owned() });
        }
        Ok(Written { truth: truth.keep()?, setup: setup.keep()?, frames: frames.keep()? })
    }

    fn write_y4m(
        &self,
        path: &Path,
        done: &mut impl FnMut(u32) -> ControlFlow<()>,
    ) -> io::Result<ControlFlow<()>> {
        let mut file = BufWriter::new(File::create(path)?);
        file.write_all(self.y4m_header().as_bytes())?;
        let written = self.in_order(
            |frame| {
                let mut samples = Vec::new();
                self.render(frame, &mut samples);
                Ok(samples)
            },
            |frame, samples| {
                file.write_all(b"FRAME\n")?;
                file.write_all(&samples)?;
                Ok(done(frame + 1))
            },
        )?;
        file.flush()?;
        Ok(written)
    }

    fn write_pngs(
        &self,
        path: &Path,
        done: &mut impl FnMut(u32) -> ControlFlow<()>,
    ) -> io::Result<ControlFlow<()>> {
        fs::create_dir(path)?;
        self.in_order(
            |frame| self.png(frame),
            |frame, bytes| {
                fs::write(path.join(format!("{frame:06}.png")), bytes)?;
                Ok(done(frame + 1))
            },
        )
    }

    /// Makes a few frames at a time on all cores and hands them on in order, until `take` breaks off.
    fn in_order(
        &self,
        make: impl Fn(u32) -> io::Result<Vec<u8>> + Sync,
        mut take: impl FnMut(u32, Vec<u8>) -> io::Result<ControlFlow<()>>,
    ) -> io::Result<ControlFlow<()>> {
        let at_once = rayon::current_num_threads().clamp(1, FRAMES_AT_ONCE);
        for first in (0..self.frames()).step_by(at_once) {
            let last = self.frames().min(first.saturating_add(at_once as u32));
            let made: Vec<_> = (first..last).into_par_iter().map(&make).collect();
            for (frame, made) in (first..).zip(made) {
                if take(frame, made?)?.is_break() {
                    return Ok(ControlFlow::Break(()));
                }
            }
        }
        Ok(ControlFlow::Continue(()))
    }

    /// The first line of a Y4M file of this scene.
    pub fn y4m_header(&self) -> String {
        let (width, height) = self.size();
        let (num, den) = ratio(self.rate_hz());
        let depth = if self.bits() > 8 { self.bits().to_string() } else { String::new() };
        format!("YUV4MPEG2 W{width} H{height} F{num}:{den} Ip A1:1 Cmono{depth}\n")
    }

    /// A frame as a PNG file.
    ///
    /// # Errors
    /// The encoder's; there are none in memory.
    pub fn png(&self, frame: u32) -> io::Result<Vec<u8>> {
        let mut samples = Vec::new();
        self.render(frame, &mut samples);
        let (width, height) = self.size();
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, width, height);
        encoder.set_color(png::ColorType::Grayscale);
        encoder.set_compression(png::Compression::Fast);
        encoder.set_depth(png::BitDepth::Eight);
        if self.bits() > 8 {
            encoder.set_depth(png::BitDepth::Sixteen);
            // PNG is big-endian and has no 10 bit samples: they move to the top of 16.
            for sample in samples.chunks_exact_mut(2) {
                let value = u16::from_le_bytes([sample[0], sample[1]]) << (16 - self.bits());
                sample.copy_from_slice(&value.to_be_bytes());
            }
        }
        let mut writer = encoder.write_header()?;
        writer.write_image_data(&samples)?;
        writer.finish()?;
        Ok(bytes)
    }
}

/// A rate as a fraction: whole, n/1.001 as television has it, or to a thousandth.
fn ratio(rate_hz: f64) -> (u64, u64) {
    let ntsc = (rate_hz * 1.001).round();
    if rate_hz.fract() == 0.0 {
        (rate_hz as u64, 1)
    } else if ntsc >= 1.0 && (rate_hz - ntsc / 1.001).abs() < 1e-3 {
        (1000 * ntsc as u64, 1001)
    } else {
        ((1000.0 * rate_hz).round() as u64, 1000)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_become_fractions() {
        assert_eq!(ratio(50.0), (50, 1));
        assert_eq!(ratio(29.97), (30_000, 1001));
        assert_eq!(ratio(59.94006), (60_000, 1001));
        assert_eq!(ratio(12.5), (12_500, 1000));
        assert_eq!(ratio(0.1), (100, 1000));
    }
}
