//! Times the loop alone: frames from memory, records to nowhere, one thread.

use std::fmt;
use std::time::Duration;

use gangway_device::{Camera, CameraErrorKind, Frame};
use gangway_engine::{Board, Identity, Inbox, Outbox, Settings, Step};

use crate::clock::RecordingClock;
use crate::lamp::FakeLamp;
use crate::loop_times::LoopTimes;
use crate::recording::Pace;
use crate::run::{BenchError, Stamped, prepare};
use crate::source::{FrameSource, Shape};

/// Most that is kept in memory.
const MAX_GIB: u64 = 4;

/// What the loop took.
#[derive(Clone, Debug)]
pub struct Measured {
    /// Frames in memory.
    pub frames: usize,
    /// Passes over them, to and fro.
    pub passes: u32,
    /// Frames that gave a motion, in all passes.
    pub poses: u64,
    /// Circles of the setup.
    pub circles: usize,
    /// From a frame's arrival to the end of its step.
    pub times: LoopTimes,
}

impl fmt::Display for Measured {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let us = |time: Duration| time.as_secs_f64() * 1e6;
        let times = &self.times;
        writeln!(
            f,
            "{} frames x {} passes, {} circles, {} poses",
            self.frames, self.passes, self.circles, self.poses
        )?;
        writeln!(
            f,
            "step: median {:.1} us, least {:.1} us, 90 % {:.1} us, 99 % {:.1} us, most {:.1} us",
            us(times.median()),
            us(times.least()),
            us(times.quantile(0.9)),
            us(times.quantile(0.99)),
            us(times.most())
        )?;
        let a_circle = us(times.median()) / self.circles.max(1) as f64;
        write!(f, "median a circle: {a_circle:.2} us, pose and records included")
    }
}

/// Frames in memory as a camera: every other pass goes backwards, so that no pass begins with a jump.
struct Loaded {
    frames: Vec<Vec<u8>>,
    shape: Shape,
    rate_hz: f64,
    played: usize,
    passes: u32,
}

impl Camera for Loaded {
    type Error = CameraErrorKind;

    fn next_frame(&mut self) -> Result<Frame<'_>, CameraErrorKind> {
        if self.played >= self.frames.len() * self.passes as usize {
            return Err(CameraErrorKind::Ended);
        }
        let frame = self.frames.get(place(self.played, self.frames.len())).ok_or(CameraErrorKind::Ended)?;
        let number = self.played;
        self.played += 1;
        let time_ns = (number as f64 * 1e9 / self.rate_hz).round() as u64;
        let size = (self.shape.width, self.shape.height);
        Frame::new(frame, size, self.shape.stride(), self.shape.layout, number as u32, time_ns)
            .map_err(|_| CameraErrorKind::Corrupt)
    }
}

/// The frame that is played as the `played`th of `count` frames that go to and fro.
fn place(played: usize, count: usize) -> usize {
    match (played / count, played % count) {
        (pass, place) if pass.is_multiple_of(2) => place,
        (_, place) => count - 1 - place,
    }
}

/// Reads up to `limit` frames into memory and measures `passes` passes over them.
///
/// # Errors
/// Those of the source and the setup, and too many frames for the memory.
pub fn measure(
    settings: &Settings,
    mut source: Box<dyn FrameSource>,
    identity: Identity,
    limit: Option<u64>,
    passes: u32,
) -> Result<Measured, BenchError> {
    let shape = source.shape();
    let mut engine = prepare(settings, shape, identity)?;
    let mut frames = Vec::new();
    let mut frame = Vec::new();
    while (frames.len() as u64) < limit.unwrap_or(u64::MAX) && source.read(&mut frame)? {
        frames.push(std::mem::take(&mut frame));
        if frames.len() as u64 * shape.bytes() as u64 > MAX_GIB << 30 {
            return Err(BenchError::Memory { frames: frames.len(), gib: MAX_GIB });
        }
    }
    let count = frames.len();
    let rate_hz = source.rate_hz().unwrap_or(settings.rate_hz);
    let passes = passes.max(1);
    let camera = Loaded { frames, shape, rate_hz, played: 0, passes };
    let clock = RecordingClock::new(Pace::AsFast);
    let mut camera = Stamped { camera, clock: &clock };
    let (mut outbox, mut inbox) = (Box::new(Outbox::new()), Inbox::new());
    let ((mut outbox, mut taken), (_, mut inbox)) = (outbox.split(), inbox.split());
    let mut vitals = gangway_device::Reading::default();
    let mut lamps: [FakeLamp; 0] = [];
    let mut board = Board { camera: &mut camera, clock: &clock, vitals: &mut vitals, lamps: &mut lamps };
    let (mut times, mut poses) = (LoopTimes::default(), 0);
    loop {
        let step = engine.step(&mut board, &mut inbox, &mut outbox);
        if step == Step::NoFrame(CameraErrorKind::Ended) {
            break;
        }
        times.note(clock.since_arrival());
        poses += u64::from(step == Step::Measured);
        while taken.dequeue().is_some() {}
    }
    Ok(Measured { frames: count, passes, poses, circles: settings.circles.len(), times })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_pass_begins_with_a_jump() {
        let places: Vec<usize> = (0..9).map(|played| place(played, 3)).collect();
        assert_eq!(places, [0, 1, 2, 2, 1, 0, 0, 1, 2]);
    }
}
