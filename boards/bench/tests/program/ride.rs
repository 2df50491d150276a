//! A ride of the tests' own: five rings seen head-on, a few small frames, and what is read back of it.

use std::io::Write;
use std::path::{Path, PathBuf};

use gangway_wire::{Decoded, Decoder, Record, What, kind};
use tempfile::TempDir;

const WIDTH: usize = 160;
const HEIGHT: usize = 120;

/// Rings 2 m ahead at a focal length of 400 px: 5 mm a pixel, 20 px across.
const SETUP: &str = r#"
name = "small"
[camera]
width_px = 160
height_px = 120
rate_hz = 50.0
focal_px = [400.0, 400.0]
principal_px = [80.0, 60.0]
[[target]]
name = "ahead"
origin_mm = [2000.0, 0.0, 0.0]
outer_diameter_mm = 100.0
inner_diameter_mm = 50.0
circles_mm = [[-200.0, 150.0], [200.0, 150.0], [0.0, 0.0], [-200.0, -150.0], [200.0, -150.0]]
seeds_px = [[40.0, 30.0], [120.0, 30.0], [80.0, 60.0], [40.0, 90.0], [120.0, 90.0]]
"#;

const CENTRES: [[f64; 2]; 5] = [[40.0, 30.0], [120.0, 30.0], [80.0, 60.0], [40.0, 90.0], [120.0, 90.0]];

/// A directory with a setup and a recording.
pub(crate) struct Ride {
    place: TempDir,
}

impl Ride {
    /// A ride of so many frames. After ten at rest the rings move down, a quarter of a pixel a frame.
    pub(crate) fn new(frames: usize) -> Self {
        let place = tempfile::tempdir().unwrap();
        std::fs::write(place.path().join("setup.toml"), SETUP).unwrap();
        let mut file = std::fs::File::create(place.path().join("ride.y4m")).unwrap();
        writeln!(file, "YUV4MPEG2 W{WIDTH} H{HEIGHT} F50:1 Ip A1:1 Cmono").unwrap();
        for frame in 0..frames {
            file.write_all(b"FRAME\n").unwrap();
            file.write_all(&picture(0.25 * frame.saturating_sub(10) as f64)).unwrap();
        }
        Self { place }
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.place.path().join(name)
    }

    pub(crate) fn bytes(&self) -> Vec<u8> {
        std::fs::read(self.path("ride.y4m")).unwrap()
    }

    /// The program with the ride's setup.
    pub(crate) fn program(&self) -> assert_cmd::Command {
        let mut program = assert_cmd::Command::cargo_bin("gangway-bench").unwrap();
        program.current_dir(self.place.path()).args(["--setup", "setup.toml"]);
        program
    }

    /// The program as a process of its own, for tests that talk to it.
    pub(crate) fn spawn(&self, arguments: &[&str]) -> std::process::Child {
        std::process::Command::new(assert_cmd::cargo::cargo_bin("gangway-bench"))
            .current_dir(self.place.path())
            .args(["--setup", "setup.toml", "--frames", "ride.y4m"])
            .args(arguments)
            .stdout(std::process::Stdio::piped())
            .stderr(std::process::Stdio::piped())
            .spawn()
            .unwrap()
    }
}

/// Rings on white; edges soft over a pixel.
fn picture(down: f64) -> Vec<u8> {
    let mut samples = vec![200; WIDTH * HEIGHT];
    for (at, sample) in samples.iter_mut().enumerate() {
        let (x, y) = ((at % WIDTH) as f64, (at / WIDTH) as f64);
        for [u, v] in CENTRES {
            let radius = (x - u).hypot(y - v - down);
            let black = (10.5 - radius).clamp(0.0, 1.0) - (5.5 - radius).clamp(0.0, 1.0);
            *sample -= (170.0 * black) as u8;
        }
    }
    samples
}

/// What a capture holds.
#[derive(Debug, Default, PartialEq)]
pub(crate) struct Capture {
    /// Kind and body of every record that frames cause, in order.
    pub(crate) measured: Vec<(u8, Vec<u8>)>,
    /// Frame numbers of the poses.
    pub(crate) frames: Vec<u32>,
    /// Frame times of the poses, ns.
    pub(crate) times_ns: Vec<u64>,
    pub(crate) hellos: Vec<(u64, u64, u64)>,
    /// Kinds of the records with the sequence 0.
    pub(crate) firsts: Vec<u8>,
    /// Times on the box's clock: of the camera's stalls, of health and of the time records, ns.
    pub(crate) clock_ns: Vec<u64>,
    /// Debug names of the events.
    pub(crate) events: Vec<String>,
    pub(crate) missing: u64,
    pub(crate) damaged: u64,
}

impl Capture {
    pub(crate) fn read(path: &Path) -> Self {
        Self::of(&std::fs::read(path).unwrap())
    }

    pub(crate) fn of(bytes: &[u8]) -> Self {
        let mut capture = Self::default();
        let mut decoder = Decoder::new();
        let mut rest = bytes;
        while !rest.is_empty() {
            let (decoded, behind) = decoder.feed(rest);
            rest = behind;
            let Some(Decoded::Record { sequence, kind, body, record, .. }) = decoded else { continue };
            if sequence == 0 {
                capture.firsts.push(kind);
            }
            let entry = (kind, body.to_vec());
            // A rest pose comes again whenever somebody new listens.
            let again = kind == kind::REST && capture.measured.contains(&entry);
            if matches!(kind, kind::POSE | kind::MARKERS | kind::REST) && !again {
                capture.measured.push(entry);
            }
            match record {
                Record::Event(event) if event.what == What::CameraStalled => {
                    capture.clock_ns.push(event.time_ns);
                }
                Record::Health(health) => capture.clock_ns.push(health.time_ns),
                Record::TimeSync(sync) => capture.clock_ns.push(sync.time_ns),
                _ => {}
            }
            match record {
                Record::Pose(pose) => {
                    capture.frames.push(pose.frame);
                    capture.times_ns.push(pose.time_ns);
                }
                Record::Hello(hello) => {
                    capture.hellos.push((hello.box_id, hello.boot_id, hello.session_id));
                }
                Record::Event(event) => capture.events.push(format!("{:?}", event.what)),
                _ => {}
            }
        }
        capture.missing = decoder.counts().missing;
        capture.damaged = decoder.counts().damaged;
        capture
    }

    pub(crate) fn has(&self, event: &str) -> bool {
        self.events.iter().any(|found| found.starts_with(event))
    }
}
