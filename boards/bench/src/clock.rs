//! The clock and the condition of the machine that plays the recording.

use std::path::PathBuf;

use gangway_device::{Clock, Reading, Vitals};
use rustix::time::{ClockId, clock_gettime};

/// The monotonic clock of this machine, for loop times and pings.
///
/// It gives no offset to UTC: frames of a recording carry the recording's own time, which has none.
#[derive(Clone, Copy, Debug, Default)]
pub struct MonotonicClock;

impl Clock for MonotonicClock {
    fn now_ns(&self) -> u64 {
        let now = clock_gettime(ClockId::Monotonic);
        now.tv_sec as u64 * 1_000_000_000 + now.tv_nsec as u64
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
    fn the_clock_never_goes_back() {
        let first = MonotonicClock.now_ns();
        assert!(first > 0 && MonotonicClock.now_ns() >= first);
    }

    #[test]
    fn free_space_is_that_of_the_directory_before_the_file_exists() {
        let place = tempfile::tempdir().unwrap();
        assert!(DiskVitals::new(place.path().join("ride.gw")).read().free_bytes.is_some());
        assert_eq!(DiskVitals::new(place.path().join("no/ride.gw")).read().free_bytes, None);
    }
}
