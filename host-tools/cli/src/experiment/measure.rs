//! One rendering, several boxes: the frames go once through the frame loop of each job, in the process, and
//! each job's records into a capture of its own, from which the samples are read back.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use anyhow::Context;
use gangway_bench::link::FileLink;
use gangway_bench::{BenchError, Failure, FrameSource, Identity, Play, Shape, SourceError, Summary};
use gangway_report::Sample;
use gangway_report::sync::summed_absolute_difference;
use gangway_scene::Scene;
use gangway_setup::Setup;
use gangway_store::Session;
use indicatif::ProgressBar;
use rayon::prelude::*;

/// Frames that are rendered at a time, on all cores, and as many that wait for each job.
const FRAMES_AT_ONCE: u32 = 4;

/// A box that watches the scene.
pub(crate) struct Job {
    /// Its name in the folder of captures.
    pub(crate) name: String,
    /// Its setup file.
    pub(crate) setup: String,
}

/// What a job gave: its samples and the loop's summary, or the sentence with which the box refused its setup.
pub(crate) type Outcome = Result<(Vec<Sample>, Summary), String>;

/// What came of one rendering.
pub(crate) struct Watched {
    /// Of each job, in order.
    pub(crate) outcomes: Vec<Outcome>,
    /// Summed absolute difference of each frame to the first (thesis equation 5.1).
    pub(crate) differences: Vec<f64>,
}

/// A frame, shared by all jobs.
type Picture = Arc<Vec<u8>>;

/// Renders the scene once and runs all jobs on it at the same time; for a handful of them.
pub(crate) fn together(
    scene: &Scene,
    jobs: &[Job],
    folder: &Path,
    bar: &ProgressBar,
) -> anyhow::Result<Watched> {
    let stop = AtomicBool::new(false);
    thread::scope(|scope| {
        let mut lines: Vec<SyncSender<Picture>> = Vec::new();
        let mut runs = Vec::new();
        for job in jobs {
            let (line, frames) = sync_channel(FRAMES_AT_ONCE as usize);
            lines.push(line);
            let source = Box::new(Stream { shape: shape(scene), rate_hz: scene.rate_hz(), frames });
            let stop = &stop;
            runs.push(scope.spawn(move || {
                let outcome = run(job, source, folder);
                if outcome.is_err() {
                    stop.store(true, Ordering::Relaxed);
                }
                outcome
            }));
        }
        let mut first: Option<Picture> = None;
        let mut differences = Vec::new();
        render(scene, bar, |picture| {
            let first = first.get_or_insert_with(|| Arc::clone(&picture));
            differences.push(summed_absolute_difference(first, &picture) as f64);
            // A job that ended early takes no more; the others go on.
            lines.retain(|line| line.send(Arc::clone(&picture)).is_ok());
            !lines.is_empty() && !stop.load(Ordering::Relaxed)
        });
        drop(lines);
        let outcomes = runs
            .into_iter()
            .map(|run| run.join().unwrap_or_else(|_| Err(anyhow::anyhow!("a measuring thread failed"))))
            .collect::<anyhow::Result<_>>()?;
        Ok(Watched { outcomes, differences })
    })
}

/// Renders the scene once, keeps it in memory and runs any number of jobs on it, a few at a time.
pub(crate) fn one_by_one(
    scene: &Scene,
    jobs: &[Job],
    folder: &Path,
    bar: &ProgressBar,
) -> anyhow::Result<Vec<Outcome>> {
    let mut frames = Vec::new();
    render(scene, bar, |picture| {
        frames.push(picture);
        true
    });
    let frames = Arc::new(frames);
    bar.set_position(0);
    bar.set_length(jobs.len() as u64);
    jobs.par_iter()
        .map(|job| {
            let source =
                Kept { shape: shape(scene), rate_hz: scene.rate_hz(), frames: Arc::clone(&frames), next: 0 };
            let outcome = run(job, Box::new(source), folder);
            bar.inc(1);
            outcome
        })
        .collect()
}

/// Renders frame by frame, a few at a time on all cores, and hands them on in order until nobody wants more.
fn render(scene: &Scene, bar: &ProgressBar, mut take: impl FnMut(Picture) -> bool) {
    for first in (0..scene.frames()).step_by(FRAMES_AT_ONCE as usize) {
        let frames: Vec<Picture> = (first..scene.frames().min(first + FRAMES_AT_ONCE))
            .into_par_iter()
            .map(|frame| {
                let mut samples = Vec::new();
                scene.render(frame, &mut samples);
                Arc::new(samples)
            })
            .collect();
        for frame in frames {
            if !take(frame) {
                return;
            }
            bar.inc(1);
        }
    }
}

fn shape(scene: &Scene) -> Shape {
    let (width, height) = scene.size();
    // A scene's sides are at most 4096 px.
    Shape::grey(width as u16, height as u16, scene.bits() as u8)
}

/// The bench's loop from a source into a capture, and the samples out of it.
fn run(job: &Job, source: Box<dyn FrameSource>, folder: &Path) -> anyhow::Result<Outcome> {
    let settings = Setup::parse(&job.setup, "setup.toml")?.settings();
    let capture = folder.join(format!("{}.gw", job.name));
    // One of an earlier run is made again.
    match std::fs::remove_file(&capture) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => {
            return Err(error).with_context(|| format!("{}: cannot be replaced", capture.display()));
        }
        _ => {}
    }
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or(Duration::ZERO).as_millis() as u64;
    let identity = Identity { box_id: 0, boot_id: now, session_id: now, firmware: env!("CARGO_PKG_VERSION") };
    let link = FileLink::create(&capture)?;
    let play = Play::new(identity);
    let stop = AtomicBool::new(false);
    match gangway_bench::run(&settings, source, link, &play, &stop, &|_| {}) {
        Ok(summary) => Ok(Ok((samples(&capture)?, summary))),
        Err(Failure { error: error @ BenchError::Seeds { .. }, .. }) => {
            let _ = std::fs::remove_file(&capture);
            Ok(Err(error.to_string()))
        }
        Err(failure) => Err(failure.error).context("the frame loop stopped"),
    }
}

fn samples(capture: &PathBuf) -> anyhow::Result<Vec<Sample>> {
    let (session, _) = Session::open(capture)?;
    Ok(session.poses()?.iter().map(Sample::from).collect())
}

/// Frames as they are rendered.
struct Stream {
    shape: Shape,
    rate_hz: f64,
    frames: Receiver<Picture>,
}

impl FrameSource for Stream {
    fn shape(&self) -> Shape {
        self.shape
    }

    fn rate_hz(&self) -> Option<f64> {
        Some(self.rate_hz)
    }

    fn read(&mut self, into: &mut Vec<u8>) -> Result<bool, SourceError> {
        let Ok(picture) = self.frames.recv() else { return Ok(false) };
        into.clear();
        into.extend_from_slice(&picture);
        Ok(true)
    }

    // Each job plays once.
    fn rewind(&mut self) -> Result<(), SourceError> {
        Ok(())
    }
}

/// Frames from memory.
struct Kept {
    shape: Shape,
    rate_hz: f64,
    frames: Arc<Vec<Picture>>,
    next: usize,
}

impl FrameSource for Kept {
    fn shape(&self) -> Shape {
        self.shape
    }

    fn rate_hz(&self) -> Option<f64> {
        Some(self.rate_hz)
    }

    fn read(&mut self, into: &mut Vec<u8>) -> Result<bool, SourceError> {
        let Some(picture) = self.frames.get(self.next) else { return Ok(false) };
        self.next += 1;
        into.clear();
        into.extend_from_slice(picture);
        Ok(true)
    }

    fn rewind(&mut self) -> Result<(), SourceError> {
        self.next = 0;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use gangway_scene::TOLERANCE;

    use super::*;
    use crate::experiment::setup_text;

    /// Two targets of four rings, one set back, 2 m before a small camera.
    fn tiny() -> Scene {
        let text = r#"
            name = "tiny"
            frames = 24
            [camera]
            width_px = 320
            height_px = 240
            rate_hz = 50.0
            focal_px = [800.0, 800.0]
            principal_px = [160.3, 119.8]
            position_mm = [-2000.0, 0.0, 0.0]
            [[target]]
            name = "front"
            origin_mm = [0.0, 120.0, 0.0]
            outer_diameter_mm = 50.0
            inner_diameter_mm = 25.0
            circles_mm = [[-50.0, 90.0], [50.0, 90.0], [-50.0, -90.0], [50.0, -90.0]]
            [[target]]
            name = "back"
            origin_mm = [500.0, -180.0, 0.0]
            outer_diameter_mm = 50.0
            inner_diameter_mm = 25.0
            circles_mm = [[-50.0, 90.0], [50.0, 90.0], [-50.0, -90.0], [50.0, -90.0]]
            [motion]
            rest_s = 0.3
            [[motion.sine]]
            degree = "y"
            amplitude = 20.0
            frequency_hz = 2.0
        "#;
        Scene::parse(&format!("{text}{TOLERANCE}"), "tiny.toml").unwrap()
    }

    #[test]
    fn a_box_measures_the_same_alone_and_beside_others_and_a_refusal_is_told() {
        let scene = tiny();
        let job = |name: &str, solver: &str, all: bool| Job {
            name: name.to_owned(),
            setup: setup_text(&scene, solver, &|target, circle| all || target == 0 || circle == 0),
        };
        // Five circles, four of them in one plane, are too few for the general DLT.
        let jobs = [job("auto", "auto", true), job("refused", "dlt", false)];
        let folder = tempfile::tempdir().unwrap();
        let bar = ProgressBar::hidden();
        let beside = together(&scene, &jobs, folder.path(), &bar).unwrap();
        let alone = one_by_one(&scene, &jobs, folder.path(), &bar).unwrap();
        for outcomes in [&beside.outcomes, &alone] {
            let why = outcomes[1].as_ref().err().cloned().unwrap_or_default();
            assert!(
                why.contains("gives no pose, for 5 circles are fewer than the 6 that are needed"),
                "{why}"
            );
        }
        let samples = |outcome: &Outcome| outcome.as_ref().unwrap().0.clone();
        assert_eq!(samples(&beside.outcomes[0]).len(), 24);
        assert_eq!(samples(&beside.outcomes[0]), samples(&alone[0]));
        assert!(samples(&alone[0]).last().unwrap().measured.is_some());
        // Frame 16 is the first that has moved.
        assert_eq!(gangway_report::sync::motion_start(&beside.differences), Some(16));
    }
}
