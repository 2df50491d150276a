//! Any video through an installed `ffmpeg`, which decodes it to grey Y4M on a pipe.

use std::ffi::OsString;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::thread::JoinHandle;

use super::{FrameSource, Shape, SourceError, Y4m};

/// A video that `ffmpeg` decodes; the process is ended and reaped with this value.
pub struct Ffmpeg {
    path: PathBuf,
    program: String,
    pixels: &'static str,
    decoding: Decoding,
}

impl Ffmpeg {
    /// Asks `program` what the file is and starts decoding: 8 bit, or deeper where the video is.
    ///
    /// # Errors
    /// [`SourceError::NoFfmpeg`] and [`SourceError::Ffmpeg`].
    pub fn open(path: &Path, program: &str) -> Result<Self, SourceError> {
        let pixels = pixel_format(path, program)?;
        let decoding = Decoding::start(path, program, pixels)?;
        Ok(Self { path: path.to_owned(), program: program.to_owned(), pixels, decoding })
    }
}

impl FrameSource for Ffmpeg {
    fn shape(&self) -> Shape {
        self.decoding.y4m.shape()
    }

    fn rate_hz(&self) -> Option<f64> {
        self.decoding.y4m.rate_hz()
    }

    fn read(&mut self, into: &mut Vec<u8>) -> Result<bool, SourceError> {
        let read = self.decoding.y4m.read(into);
        if matches!(read, Ok(true)) {
            return read;
        }
        // The end, or cut off: the process says whether it was meant.
        let (name, frames) = (self.path.display().to_string(), self.decoding.y4m.frames());
        match self.decoding.running.end() {
            End::Failed(line) => Err(SourceError::Ffmpeg { name, line }),
            _ if frames == 0 => Err(SourceError::Empty { name }),
            End::Complained(line) if matches!(read, Ok(false)) => {
                Err(SourceError::Damaged { name, line, frames })
            }
            _ => read,
        }
    }

    fn rewind(&mut self) -> Result<(), SourceError> {
        self.decoding = Decoding::start(&self.path, &self.program, self.pixels)?;
        Ok(())
    }
}

struct Decoding {
    y4m: Y4m,
    running: Running,
}

impl Decoding {
    fn start(path: &Path, program: &str, pixels: &str) -> Result<Self, SourceError> {
        let name = path.display().to_string();
        // Every frame once, as recorded: without this, frames are repeated or dropped to keep a rate.
        let passthrough = [&["-fps_mode", "passthrough"], &["-vsync", "0"]];
        let mut last = String::new();
        for mode in passthrough {
            let mut command = Command::new(program);
            command.args(["-hide_banner", "-nostdin", "-loglevel", "error", "-i"]).arg(local(path));
            command.args(["-map", "0:v:0"]).args(mode).args(["-pix_fmt", pixels]);
            command.args(["-strict", "-1", "-f", "yuv4mpegpipe", "-"]);
            let mut running = Running::start(&mut command, &name, program)?;
            let Some(pixels) = running.child.stdout.take() else { continue };
            match Y4m::stream(&name, Box::new(pixels)) {
                Ok(y4m) => return Ok(Self { y4m, running }),
                Err(error) => {
                    last = match running.end() {
                        End::Failed(line) | End::Complained(line) => line,
                        End::Good => error.to_string(),
                    }
                }
            }
            if !last.contains("fps_mode") {
                break;
            }
        }
        Err(SourceError::Ffmpeg { name, line: last })
    }
}

/// The process, and a thread that remembers the last line it complains with.
struct Running {
    child: Child,
    complaint: Option<JoinHandle<String>>,
}

impl Running {
    fn start(command: &mut Command, name: &str, program: &str) -> Result<Self, SourceError> {
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command
            .spawn()
            .map_err(|_| SourceError::NoFfmpeg { name: name.to_owned(), program: program.to_owned() })?;
        let errors = child.stderr.take();
        let complaint = std::thread::spawn(move || errors.map(last_line).unwrap_or_default());
        Ok(Self { child, complaint: Some(complaint) })
    }

    /// Waits for the end.
    fn end(&mut self) -> End {
        let status = self.child.wait();
        let complaint = self.complaint.take().and_then(|thread| thread.join().ok()).unwrap_or_default();
        match status {
            // A damaged video is patched up, and all but its complaints looks well.
            Ok(status) if status.success() && complaint.is_empty() => End::Good,
            Ok(status) if status.success() => End::Complained(complaint),
            Ok(status) if complaint.is_empty() => End::Failed(format!("it ended with {status}")),
            Ok(_) => End::Failed(complaint),
            Err(error) => End::Failed(error.to_string()),
        }
    }
}

/// How the process ended.
enum End {
    Good,
    /// At the end of the video, with something to say of it.
    Complained(String),
    Failed(String),
}

impl Drop for Running {
    fn drop(&mut self) {
        // Already gone is as good.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn last_line(errors: impl Read) -> String {
    let lines = BufReader::new(errors).split(b'\n').map_while(Result::ok);
    let last = lines.filter(|line| !line.trim_ascii().is_empty()).last().unwrap_or_default();
    String::from_utf8_lossy(&last).trim().to_owned()
}

/// A file whatever its name: in `12:30.mp4` ffmpeg would see a protocol.
fn local(path: &Path) -> OsString {
    let mut name = OsString::from("file:");
    name.push(path);
    name
}

/// The grey format that keeps the depth of the video.
fn pixel_format(path: &Path, program: &str) -> Result<&'static str, SourceError> {
    let name = path.display().to_string();
    let mut command = Command::new(program);
    command.args(["-hide_banner", "-nostdin", "-i"]).arg(local(path));
    // Without an output it says what the file is and ends with an error.
    let said = command
        .stdin(Stdio::null())
        .output()
        .map_err(|_| SourceError::NoFfmpeg { name: name.clone(), program: program.to_owned() })?;
    let said = String::from_utf8_lossy(&said.stderr);
    match said.lines().find_map(|line| line.split_once("Video: ")) {
        Some((_, stream)) => Ok(grey(stream)),
        None if said.contains("Input #0") => {
            Err(SourceError::Ffmpeg { name, line: "there is no video in it".into() })
        }
        None => {
            // It often begins with the name, which is said already.
            let line = last_line(said.as_bytes());
            let line = line.strip_prefix("file:").unwrap_or(&line);
            let line = line.strip_prefix(&format!("{name}: ")).unwrap_or(line).to_owned();
            Err(SourceError::Ffmpeg { name, line })
        }
    }
}

/// From `h264 (High), yuv420p10le(tv), 1920x1080 ...`: the second field that is not in brackets.
fn grey(stream: &str) -> &'static str {
    let mut depth = 0;
    let outside: String = stream
        .chars()
        .filter(|&next| {
            depth += i32::from(next == '(') - i32::from(next == ')');
            depth == 0 && next != ')'
        })
        .collect();
    let format = outside.split(',').nth(1).unwrap_or_default().trim();
    let format = format.trim_end_matches("le").trim_end_matches("be");
    let is = |ends: &[&str]| ends.iter().any(|end| format.ends_with(end));
    // yuv410p and its like end with a letter; p010 and gbrp10 with their depth; rgb48 with that of a pixel.
    if is(&["p9", "p10", "p010", "p210", "p410", "gray9", "gray10"]) {
        "gray10le"
    } else if is(&["p12", "p012", "p212", "p412", "gray12"]) {
        "gray12le"
    } else if is(&["14", "16", "48", "64", "f32"]) {
        "gray16le"
    } else {
        "gray"
    }
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::PermissionsExt;
    use std::sync::{Mutex, MutexGuard, PoisonError};

    use gangway_device::Layout;

    use super::*;

    /// A program cannot be started while it is open for writing, and a process that another test is just
    /// starting holds everything open for a moment.
    fn alone() -> MutexGuard<'static, ()> {
        static ALONE: Mutex<()> = Mutex::new(());
        ALONE.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A program that behaves as `script` says; it knows its last arguments as `$@`.
    fn program(place: &Path, script: &str) -> String {
        let file = place.join("ffmpeg");
        std::fs::write(&file, format!("#!/bin/sh\n{script}\n")).unwrap();
        std::fs::set_permissions(&file, PermissionsExt::from_mode(0o755)).unwrap();
        file.display().to_string()
    }

    const PROBE: &str = r#"case "$*" in *yuv4mpegpipe*) ;; *) echo "Input #0, matroska" >&2
        echo "  Stream #0:0: Video: h264 (High), yuv420p10le(tv, bt709), 2x1, 50 fps" >&2; exit 1;; esac"#;

    #[test]
    fn without_the_program_there_is_one_clear_sentence() {
        let said = Ffmpeg::open(Path::new("ride.mp4"), "/no/ffmpeg").err().unwrap().to_string();
        assert_eq!(
            said,
            "ride.mp4 is no Y4M file, and other videos need the program /no/ffmpeg, which is not installed; \
             install it or convert the video to Y4M"
        );
    }

    #[test]
    fn frames_are_read_again_and_in_the_videos_depth() {
        let (_alone, place) = (alone(), tempfile::tempdir().unwrap());
        let script = format!(
            "{PROBE}\ncase \"$*\" in *gray10le*) ;; *) exit 3;; esac\n\
             printf 'YUV4MPEG2 W2 H1 F50:1 Cmono10\\nFRAME\\nabcdFRAME\\nefgh'"
        );
        let program = program(place.path(), &script);
        let mut source = Ffmpeg::open(Path::new("ride.mp4"), &program).unwrap();
        assert_eq!(source.shape().layout, Layout::Word { bits: 10 });
        assert_eq!(source.rate_hz(), Some(50.0));
        let mut picture = Vec::new();
        for _ in 0..2 {
            for bytes in [b"abcd", b"efgh"] {
                assert!(source.read(&mut picture).unwrap());
                assert_eq!(picture, bytes);
            }
            assert!(!source.read(&mut picture).unwrap());
            source.rewind().unwrap();
        }
    }

    #[test]
    fn a_failure_is_told_with_its_last_line() {
        let (_alone, place) = (alone(), tempfile::tempdir().unwrap());
        let script = format!(
            "{PROBE}\nprintf 'YUV4MPEG2 W2 H1 F50:1 Cmono\\nFRAME\\nab'\n\
             echo 'first complaint' >&2; echo 'moov atom not found' >&2; exit 1"
        );
        let mut source = Ffmpeg::open(Path::new("ride.mp4"), &program(place.path(), &script)).unwrap();
        let mut picture = Vec::new();
        assert!(source.read(&mut picture).unwrap());
        let said = source.read(&mut picture).unwrap_err().to_string();
        assert_eq!(said, "ffmpeg cannot read ride.mp4: moov atom not found");

        let silent = program(place.path(), "echo \"$4: Invalid data found\" >&2; exit 1");
        let said = Ffmpeg::open(Path::new("12:30.mp4"), &silent).err().unwrap().to_string();
        assert_eq!(said, "ffmpeg cannot read 12:30.mp4: Invalid data found");
        // What it is asked for is a file, not a protocol of that name.
        let echo = program(place.path(), "echo \"asked for $4\" >&2; exit 1");
        let said = Ffmpeg::open(Path::new("12:30.mp4"), &echo).err().unwrap().to_string();
        assert_eq!(said, "ffmpeg cannot read 12:30.mp4: asked for file:12:30.mp4");
    }

    #[test]
    fn a_damaged_video_is_told_behind_its_frames() {
        let (_alone, place) = (alone(), tempfile::tempdir().unwrap());
        let script = format!(
            "{PROBE}\nprintf 'YUV4MPEG2 W2 H1 F50:1 Cmono\\nFRAME\\nab'; echo 'stream 0: partial file' >&2"
        );
        let mut source = Ffmpeg::open(Path::new("ride.mp4"), &program(place.path(), &script)).unwrap();
        let mut picture = Vec::new();
        assert!(source.read(&mut picture).unwrap());
        assert_eq!(
            source.read(&mut picture).unwrap_err().to_string(),
            "ride.mp4 is damaged or cut off, as ffmpeg says (stream 0: partial file); of the 1 frames that it gave \
             some may be wrong, and others missing"
        );
    }

    #[test]
    fn an_older_program_is_asked_in_its_own_way() {
        let (_alone, place) = (alone(), tempfile::tempdir().unwrap());
        let script = format!(
            "{PROBE}\ncase \"$*\" in *fps_mode*) echo \"Unrecognized option 'fps_mode'.\" >&2; exit 1;; esac\n\
             printf 'YUV4MPEG2 W2 H1 F50:1 Cmono\\nFRAME\\nab'"
        );
        let mut source = Ffmpeg::open(Path::new("ride.mp4"), &program(place.path(), &script)).unwrap();
        assert!(source.read(&mut Vec::new()).unwrap());
    }

    #[test]
    fn the_process_is_ended_and_reaped_with_the_source() {
        let (_alone, place) = (alone(), tempfile::tempdir().unwrap());
        let script = format!("{PROBE}\nprintf 'YUV4MPEG2 W2 H1 F50:1 Cmono\\n'; exec sleep 600");
        let source = Ffmpeg::open(Path::new("ride.mp4"), &program(place.path(), &script)).unwrap();
        let id = source.decoding.running.child.id();
        assert!(Path::new(&format!("/proc/{id}")).exists());
        drop(source);
        assert!(!Path::new(&format!("/proc/{id}")).exists());
    }

    #[test]
    fn the_depth_of_a_video_is_kept() {
        for (stream, format) in [
            ("h264 (High) (avc1 / 0x31637661), yuv420p(progressive), 1920x1080", "gray"),
            ("ffv1 (FFV1 / 0x31564646), gray, 1920x1080", "gray"),
            ("cinepak, yuv410p, 320x240", "gray"),
            ("hevc (Main 10), yuv420p10le(tv, bt709), 1920x1080", "gray10le"),
            ("hevc, p010le, 1920x1080", "gray10le"),
            ("ffv1, gray12le, 8x8", "gray12le"),
            ("prores, yuva444p16be(bt709), 8x8", "gray16le"),
            ("png, rgb48be, 8x8", "gray16le"),
            ("rawvideo, rgb24, 8x8", "gray"),
            ("", "gray"),
        ] {
            assert_eq!(grey(stream), format, "{stream}");
        }
    }
}
