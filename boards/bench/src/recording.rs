//! A camera that plays a recording: numbers, times and pace of its frames.

use std::sync::atomic::AtomicBool;
use std::thread;
use std::time::{Duration, Instant};

use gangway_device::{Camera, CameraErrorKind, Frame};

use crate::read_ahead::{Picture, ReadAhead};
use crate::run::BenchError;
use crate::source::{FrameSource, Shape};
use crate::times::Times;

/// How fast a recording is played.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Pace {
    /// As fast as it goes, and never faster than the outbox is emptied: nothing is lost.
    #[default]
    AsFast,
    /// At the times of the frames, never waiting for the outbox.
    RealTime,
}

/// Where a frame's number and time come from.
#[derive(Clone, Debug)]
pub enum Timing {
    /// Numbers count from 0; time is number over rate, in Hz.
    Rate(f64),
    /// A file says both.
    Times(Times),
}

impl Timing {
    fn at(&self, picture: &Picture, played: u64) -> Result<(u32, u64), BenchError> {
        match self {
            // Numbers wrap after 2^32 frames, as a camera's do.
            Self::Rate(rate) => Ok((played as u32, (played as f64 * 1e9 / rate).round() as u64)),
            Self::Times(times) => {
                Ok(times.at(usize::try_from(picture.index).unwrap_or(usize::MAX), picture.pass)?)
            }
        }
    }
}

/// Plays a source as a camera.
pub struct Recording<'s> {
    pictures: ReadAhead,
    shape: Shape,
    picture: Vec<u8>,
    timing: Timing,
    pace: Pace,
    /// Frames to play at most.
    limit: u64,
    played: u64,
    late: u64,
    /// When the first frame was delivered, and its time.
    begun: Option<(Instant, u64)>,
    stop: &'s AtomicBool,
    failure: Option<BenchError>,
}

impl<'s> Recording<'s> {
    /// Plays `source` `passes` times, `limit` frames at most, until `stop` is set.
    pub fn new(
        source: Box<dyn FrameSource>,
        passes: u32,
        limit: Option<u64>,
        timing: Timing,
        pace: Pace,
        stop: &'s AtomicBool,
    ) -> Self {
        let pictures = ReadAhead::start(source, passes);
        let shape = pictures.shape;
        let limit = limit.unwrap_or(u64::MAX);
        let picture = Vec::new();
        Self {
            pictures,
            shape,
            picture,
            timing,
            pace,
            limit,
            played: 0,
            late: 0,
            begun: None,
            stop,
            failure: None,
        }
    }

    /// Why the recording ended before its end; [`CameraErrorKind::Ended`] is all that the loop is told.
    pub fn take_failure(&mut self) -> Option<BenchError> {
        self.failure.take()
    }

    /// Frames that were delivered later than their time, by more than a millisecond.
    pub fn late(&self) -> u64 {
        self.late
    }

    fn advance(&mut self) -> Result<Option<(u32, u64)>, BenchError> {
        if self.played >= self.limit {
            return Ok(None);
        }
        let used = std::mem::take(&mut self.picture);
        let Some(picture) = self.pictures.next(used, self.stop) else { return Ok(None) };
        let picture = picture?;
        let stamp = self.timing.at(&picture, self.played)?;
        self.picture = picture.bytes;
        self.played += 1;
        Ok(Some(stamp))
    }

    /// Waits for the time of a frame.
    fn keep_pace(&mut self, time_ns: u64) {
        let &mut (start, first) = self.begun.get_or_insert((Instant::now(), time_ns));
        let due = start + Duration::from_nanos(time_ns.saturating_sub(first));
        match due.checked_duration_since(Instant::now()) {
            Some(wait) => thread::sleep(wait),
            // A millisecond is within what a machine that does other things needs to wake up.
            None if due.elapsed() > Duration::from_millis(1) => self.late += 1,
            None => {}
        }
    }
}

impl Camera for Recording<'_> {
    type Error = CameraErrorKind;

    fn next_frame(&mut self) -> Result<Frame<'_>, CameraErrorKind> {
        let (number, time_ns) = match self.advance() {
            Ok(Some(stamp)) => stamp,
            Ok(None) => return Err(CameraErrorKind::Ended),
            Err(error) => {
                self.failure = Some(error);
                return Err(CameraErrorKind::Ended);
            }
        };
        if self.pace == Pace::RealTime {
            self.keep_pace(time_ns);
        }
        let size = (self.shape.width, self.shape.height);
        let stride = self.shape.stride();
        // A source that does not keep its word about its shape is a torn frame.
        Frame::new(&self.picture, size, stride, self.shape.layout, number, time_ns)
            .map_err(|_| CameraErrorKind::Corrupt)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::source::Y4m;

    fn source(frames: u8) -> Box<dyn FrameSource> {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("ride.y4m");
        let mut bytes = b"YUV4MPEG2 W2 H1 F50:1 Cmono\n".to_vec();
        for frame in 0..frames {
            bytes.extend_from_slice(b"FRAME\n");
            bytes.extend_from_slice(&[frame, frame + 100]);
        }
        std::fs::write(&path, bytes).unwrap();
        // The file stays readable after its directory is gone.
        Box::new(Y4m::open(&path).unwrap())
    }

    fn play(camera: &mut Recording<'_>) -> Vec<(u32, u64, u8)> {
        let mut played = Vec::new();
        while let Ok(frame) = camera.next_frame() {
            played.push((frame.number(), frame.time_ns(), frame.row(0).unwrap()[0]));
        }
        played
    }

    #[test]
    fn numbers_and_times_run_on_through_the_passes_up_to_the_limit() {
        let stop = AtomicBool::new(false);
        let timing = Timing::Rate(50.0);
        let mut camera = Recording::new(source(2), 3, Some(5), timing, Pace::AsFast, &stop);
        let ms = 1_000_000;
        assert_eq!(
            play(&mut camera),
            [(0, 0, 0), (1, 20 * ms, 1), (2, 40 * ms, 0), (3, 60 * ms, 1), (4, 80 * ms, 0)]
        );
        assert!(camera.take_failure().is_none());
    }

    #[test]
    fn times_of_a_file_are_taken_and_their_end_is_told() {
        let stop = AtomicBool::new(false);
        let times = Times::parse("frame,time_ns\n5,50\n7,70\n", "times.csv").unwrap();
        let mut camera = Recording::new(source(3), 1, None, Timing::Times(times), Pace::AsFast, &stop);
        assert_eq!(play(&mut camera), [(5, 50, 0), (7, 70, 1)]);
        let said = camera.take_failure().unwrap().to_string();
        assert!(said.contains("times.csv has rows for 2 frames only"), "{said}");
    }

    #[test]
    fn at_the_recorded_rate_frames_are_waited_for() {
        let stop = AtomicBool::new(false);
        let mut camera = Recording::new(source(3), 1, None, Timing::Rate(100.0), Pace::RealTime, &stop);
        let start = Instant::now();
        assert_eq!(play(&mut camera).len(), 3);
        // Two periods lie between three frames; sleeping never ends early.
        assert!(start.elapsed() >= Duration::from_millis(20));
    }

    #[test]
    fn a_stop_ends_the_recording() {
        let stop = AtomicBool::new(true);
        let mut camera = Recording::new(source(3), 1, None, Timing::Rate(50.0), Pace::AsFast, &stop);
        assert_eq!(camera.next_frame().unwrap_err(), CameraErrorKind::Ended);
        assert!(camera.take_failure().is_none());
    }
}
