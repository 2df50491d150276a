//! The recording's clock, and the condition of the machine that plays it.

use std::cell::Cell;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use gangway_device::{Clock, Reading, Vitals};

use crate::recording::Pace;

/// The recording's own time, running on from the frame that was delivered last.
///
/// Frames carry that time, so pings, marks and the camera's events have it too. As fast as it goes, it is set
/// anew with every frame; at the recorded rate with the first one only, and runs on at this machine's pace.
///
/// It gives no offset to UTC: the time of a recording has none.
#[derive(Debug)]
pub struct RecordingClock {
    pace: Pace,
    /// When time was set, and to what.
    set: Cell<Option<(Instant, u64)>>,
    arrived: Cell<Instant>,
}

impl RecordingClock {
    /// A clock at 0 until the first frame sets it.
    pub fn new(pace: Pace) -> Self {
        Self { pace, set: Cell::new(None), arrived: Cell::new(Instant::now()) }
    }

    /// A frame of this time was delivered just now.
    pub fn arrive(&self, time_ns: u64) {
        let now = Instant::now();
        self.arrived.set(now);
        if self.pace == Pace::AsFast || self.set.get().is_none() {
            self.set.set(Some((now, time_ns)));
        }
    }

    /// Since the last frame was delivered.
    pub fn since_arrival(&self) -> Duration {
        self.arrived.get().elapsed()
    }
}

impl Clock for RecordingClock {
    fn now_ns(&self) -> u64 {
        let Some((set, time_ns)) = self.set.get() else { return 0 };
        time_ns.saturating_add(u64::try_from(set.elapsed().as_nanos()).unwrap_or(u64::MAX))
    }

    fn utc_offset_ns(&self) -> Option<(i64, u64)> {
        None
    }
}

/// Free space of the disk that a path lies on.
#[derive(Clone, Debug)]
pub struct DiskVitals {
    path: PathBuf,
}

impl DiskVitals {
    /// Watches the disk of `path`: of its directory as long as it does not exist itself.
    pub fn new(path: PathBuf) -> Self {
        Self { path }
    }
}

impl Vitals for DiskVitals {
    fn read(&mut self) -> Reading {
        let parent = self.path.parent().filter(|parent| !parent.as_os_str().is_empty());
        let disk = [Some(self.path.as_path()), parent]
            .into_iter()
            .flatten()
            .find_map(|path| rustix::fs::statvfs(path).ok());
        Reading {
            temperature_c: None,
            free_bytes: disk.map(|disk| disk.f_bavail.saturating_mul(disk.f_frsize)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_runs_on_from_the_frames() {
        let second = 1_000_000_000;
        let clock = RecordingClock::new(Pace::AsFast);
        assert_eq!(clock.now_ns(), 0);
        clock.arrive(5 * second);
        let first = clock.now_ns();
        assert!(first >= 5 * second && clock.now_ns() >= first);
        clock.arrive(9_000 * second);
        assert!(clock.now_ns() >= 9_000 * second, "a frame sets it as fast as it goes");

        let clock = RecordingClock::new(Pace::RealTime);
        clock.arrive(5 * second);
        clock.arrive(9_000 * second);
        assert!(clock.now_ns() < 9_000 * second, "at the recorded rate only the first one does");
    }

    #[test]
    fn free_space_is_that_of_the_directory_before_the_file_exists() {
        let place = tempfile::tempdir().unwrap();
        assert!(DiskVitals::new(place.path().join("ride.gw")).read().free_bytes.is_some());
        assert_eq!(DiskVitals::new(place.path().join("no/ride.gw")).read().free_bytes, None);
    }
}
