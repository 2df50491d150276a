//! What can be wrong with a recording, each in one sentence.

use std::io;

/// An error of a source of pictures.
#[derive(Debug, thiserror::Error)]
pub enum SourceError {
    /// No such file or directory.
    #[error(
        "{name} does not exist; give a Y4M file, a directory of PNG or PGM files, a video, or - for standard input"
    )]
    Missing {
        /// What was named.
        name: String,
    },
    /// The head of a file makes no sense.
    #[error("{name} is no {form} file that can be read: {why}")]
    Header {
        /// The file.
        name: String,
        /// Its form.
        form: &'static str,
        /// What is wrong.
        why: String,
    },
    /// A colour space without a luma plane that this version knows.
    #[error(
        "{name} has the colour space '{found}', which is not known; mono, 4:2:0, 4:2:2 and 4:4:4 with 8 to 16 bit are"
    )]
    ColourSpace {
        /// The file.
        name: String,
        /// The colour space as the file names it.
        found: String,
    },
    /// The file ends within a picture.
    #[error("{name} is cut off: it ends within frame {frame}; the {frame} frames before it are good")]
    CutOff {
        /// The file.
        name: String,
        /// Number of the frame, from 0.
        frame: u64,
    },
    /// Something else lies where a picture should begin.
    #[error("{name} is damaged: no frame begins behind frame {before}")]
    NoFrame {
        /// The file.
        name: String,
        /// Frames before that place.
        before: u64,
    },
    /// The file ends within its first picture.
    #[error("{name} is cut off: it ends within its first frame; there is nothing to measure")]
    NoWholeFrame {
        /// The file.
        name: String,
    },
    /// No picture at all.
    #[error("{name} holds no frame")]
    Empty {
        /// The file.
        name: String,
    },
    /// A directory without pictures.
    #[error("the directory {name} holds no PNG or PGM file; give one that does")]
    EmptyDirectory {
        /// The directory.
        name: String,
    },
    /// A picture of another size or depth than those before.
    #[error("{name} is {found}, but the pictures before it are {expected}; all must be alike")]
    Unlike {
        /// The file.
        name: String,
        /// What it is.
        found: String,
        /// What the others are.
        expected: String,
    },
    /// There is no `ffmpeg`.
    #[error(
        "{name} is no Y4M file, and other videos need the program {program}, which is not installed; install it or convert the video to Y4M"
    )]
    NoFfmpeg {
        /// The video.
        name: String,
        /// The program that was looked for.
        program: String,
    },
    /// `ffmpeg` failed.
    #[error("ffmpeg cannot read {name}: {line}")]
    Ffmpeg {
        /// The video.
        name: String,
        /// The last line that it wrote.
        line: String,
    },
    /// `ffmpeg` came to the end, but not unharmed.
    #[error(
        "{name} is damaged or cut off, as ffmpeg says ({line}); of the {frames} frames that it gave some may be wrong, and others missing"
    )]
    Damaged {
        /// The video.
        name: String,
        /// The last line that it wrote.
        line: String,
        /// Frames that it gave.
        frames: u64,
    },
    /// The source can be read once only.
    #[error("{name} can be read once only; to repeat it, give a file")]
    Once {
        /// The source.
        name: String,
    },
    /// Anything else that the system reports.
    #[error("cannot read {name}: {source}")]
    Io {
        /// The file.
        name: String,
        /// What the system said.
        source: io::Error,
    },
}
