//! How the loop is doing: a small histogram of loop times and the counts since start.

use gangway_device::Reading;
use gangway_wire::{Health, Histogram, Latency, WAKE_UP_BITS};

/// Bucket 0 of the loop times begins at 2^9 ns.
const LOOP_TIME_BITS: u32 = 9;
/// `Health` is sent once in this much frame time, ns.
const PERIOD_NS: u64 = 1_000_000_000;

#[derive(Debug, Default)]
pub(crate) struct Pulse {
    frames: u32,
    missed: u32,
    loop_times: Histogram,
    latency: Latency,
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
        self.loop_times.note(loop_ns, LOOP_TIME_BITS);
    }

    /// Counts a frame that the loop had so long after the end of its readout, where that is known.
    pub(crate) fn woken(&mut self, late_ns: Option<u64>) {
        if let Some(late_ns) = late_ns {
            self.latency.wake_up.note(late_ns, WAKE_UP_BITS);
        }
    }

    /// Counts poses that the link has handed to the line.
    pub(crate) fn delivered(&mut self, times: &Histogram) {
        self.latency.exposure_to_line.merge(times);
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

    /// The record; the histograms start anew.
    pub(crate) fn take(&mut self, time_ns: u64, reading: Reading, lost: u32, high_water: u16) -> Health {
        let loop_times = core::mem::take(&mut self.loop_times);
        Health {
            time_ns,
            frames: self.frames,
            frames_missed: self.missed,
            records_lost: lost,
            queue_high_water: high_water,
            loop_time: loop_times.counts,
            loop_time_max_ns: loop_times.longest_ns,
            temperature_centi_c: reading
                .temperature_c
                .filter(|c| c.is_finite())
                .map(|c| libm::roundf(c * 100.0).clamp(f32::from(i16::MIN), f32::from(i16::MAX)) as i16),
            free_bytes: reading.free_bytes,
            latency: Some(core::mem::take(&mut self.latency)),
        }
    }
}

#[cfg(test)]
mod tests {
    use gangway_wire::{EXPOSURE_TO_LINE_BITS, LOOP_TIME_BUCKETS};

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
    fn latencies_are_those_of_their_own_second() {
        let mut pulse = Pulse::default();
        pulse.woken(None);
        pulse.woken(Some(600));
        pulse.woken(Some(70_000));
        let mut times = Histogram::default();
        times.note(30_000_000, EXPOSURE_TO_LINE_BITS);
        pulse.delivered(&times);
        pulse.delivered(&times);
        let Some(latency) = pulse.take(0, Reading::default(), 0, 0).latency else { panic!("latencies") };
        assert_eq!((latency.wake_up.counts[0], latency.wake_up.counts[7]), (1, 1));
        assert_eq!((latency.wake_up.total(), latency.wake_up.longest_ns), (2, 70_000));
        assert_eq!((latency.exposure_to_line.counts[8], latency.exposure_to_line.total()), (2, 2));
        assert_eq!(pulse.take(0, Reading::default(), 0, 0).latency, Some(Latency::default()));
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
