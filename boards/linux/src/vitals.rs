//! The board's condition, read by a slow thread and looked up by the frame loop.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use gangway_device::{Reading, Vitals};

/// Where Linux tells the temperature of the processor, in thousandths of a degree.
const TEMPERATURE: &str = "/sys/class/thermal/thermal_zone0/temp";
/// Stands for a number that is not known.
const UNKNOWN: u64 = u64::MAX;

/// The latest readings; every clone sees the same ones.
#[derive(Clone, Debug)]
pub struct SystemVitals {
    disk: PathBuf,
    /// Temperature in thousandths of a degree above -273 degrees, and free bytes.
    latest: Arc<[AtomicU64; 2]>,
}

impl SystemVitals {
    /// Watches the temperature and the disk of a path; nothing is known before the first [`Self::refresh`].
    pub fn new(disk: &Path) -> Self {
        Self { disk: disk.to_owned(), latest: Arc::new([AtomicU64::new(UNKNOWN), AtomicU64::new(UNKNOWN)]) }
    }

    /// Reads anew; may wait for the disk.
    pub fn refresh(&self) {
        let milli: Option<i64> =
            std::fs::read_to_string(TEMPERATURE).ok().and_then(|text| text.trim().parse().ok());
        let kelvin = milli.and_then(|milli| u64::try_from(milli + 273_000).ok());
        let disk = rustix::fs::statvfs(&self.disk).ok();
        let free = disk.map(|disk| disk.f_bavail.saturating_mul(disk.f_frsize));
        let [temperature, space] = &*self.latest;
        temperature.store(kelvin.unwrap_or(UNKNOWN), Ordering::Relaxed);
        space.store(free.unwrap_or(UNKNOWN), Ordering::Relaxed);
    }
}

impl Vitals for SystemVitals {
    fn read(&mut self) -> Reading {
        let [temperature, space] =
            self.latest.each_ref().map(|latest| match latest.load(Ordering::Relaxed) {
                UNKNOWN => None,
                known => Some(known),
            });
        Reading {
            temperature_c: temperature.map(|kelvin| (kelvin as f64 / 1e3 - 273.0) as f32),
            free_bytes: space,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn free_space_is_known_after_the_first_reading() {
        let mut vitals = SystemVitals::new(Path::new("/"));
        assert_eq!(vitals.read(), Reading::default());
        vitals.clone().refresh();
        assert!(vitals.read().free_bytes.is_some());
    }
}
