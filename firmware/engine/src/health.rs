//! How the loop is doing: a small histogram of loop times and the counts since start.

use gangway_device::Reading;
use gangway_wire::{Health, LOOP_TIME_BUCKETS};

/// `Health` is sent once in this much frame time, ns.
const PERIOD_NS: u64 = 1_000_000_000;

#[derive(Debug, Default)]
pub(crate) struct Pulse {
    frames: u32,
    missed: u32,
    histogram: [u16; LOOP_TIME_BUCKETS],
    longest_ns: u32,
    due_ns: Option<u64>,
}

impl Pulse {
    /// Frames since start.
    pub(crate) fn frames(&self) -> u32 {
        self.frames
    }

    pub(crate) fn missed(&mut self, count: u32) {
        self.missed = self.missed.saturating_add(count);
    }

    /// Counts a frame whose work took `loop_ns`.
    pub(crate) fn beat(&mut self, loop_ns: u64) {
        self.frames = self.frames.saturating_add(1);
        let loop_ns = u32::try_from(loop_ns).unwrap_or(u32::MAX);
        self.longest_ns = self.longest_ns.max(loop_ns);
        // Bucket i counts 2^(i+9) up to 2^(i+10) ns.
        let bucket = (loop_ns | 1).ilog2().saturating_sub(9) as usize;
        if let Some(count) = self.histogram.get_mut(bucket.min(LOOP_TIME_BUCKETS - 1)) {
            *count = count.saturating_add(1);
        }
    }

    /// Whether a `Health` record is due at this frame time.
    pub(crate) fn due(&mut self, frame_time_ns: u64) -> bool {
        let due = self.due_ns.get_or_insert(frame_time_ns.saturating_add(PERIOD_NS));
        if frame_time_ns < *due {
            return false;
        }
        *due = frame_time_ns.saturating_add(PERIOD_NS);
        true
    }

    /// The record; the histogram starts anew.
    pub(crate) fn take(&mut self, time_ns: u64, reading: Reading, lost: u32, high_water: u16) -> Health {
        Health {
            time_ns,
            frames: self.frames,
            frames_missed: self.missed,
            records_lost: lost,
            queue_high_water: high_water,
            loop_time: core::mem::take(&mut self.histogram),
            loop_time_max_ns: core::mem::take(&mut self.longest_ns),
            temperature_centi_c: reading
                .temperature_c
                .filter(|c| c.is_finite())
                .map(|c| libm::roundf(c * 100.0).clamp(f32::from(i16::MIN), f32::from(i16::MAX)) as i16),
            free_bytes: reading.free_bytes,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn loop_times_fall_into_their_buckets() {
        let mut pulse = Pulse::default();
        for ns in [0, 511, 512, 1023, 1024, 100_000, u64::MAX] {
            pulse.beat(ns);
        }
        let health = pulse.take(0, Reading::default(), 0, 0);
        assert_eq!(health.loop_time[0], 4, "below 1,024 ns");
        assert_eq!(health.loop_time[1], 1);
        assert_eq!(health.loop_time[7], 1, "65,536 to 131,072 ns");
        assert_eq!(health.loop_time[LOOP_TIME_BUCKETS - 1], 1);
        assert_eq!(health.loop_time_max_ns, u32::MAX);
        assert_eq!(health.frames, 7);
    }

    #[test]
    fn health_is_due_once_a_second_of_frame_time() {
        let mut pulse = Pulse::default();
        let due = (0..250u64).filter(|i| pulse.due(i * 20_000_000)).count();
        assert_eq!(due, 4);
    }

    #[test]
    fn each_health_counts_its_own_second() {
        let mut pulse = Pulse::default();
        pulse.beat(5_000);
        assert_eq!(pulse.take(0, Reading::default(), 0, 0).loop_time_max_ns, 5_000);
        let second = pulse.take(0, Reading::default(), 0, 0);
        assert_eq!((second.loop_time_max_ns, second.frames), (0, 1));
    }
}
