//! From the kernel's time of a picture to the middle of its exposure (Linux userspace API, "V4L2 buffer
//! timestamps": the source flag says which instant the kernel noted).

use v4l::buffer::Flags;

/// What is known of the exposure.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Shutter {
    /// How long a line is exposed, ns; 0 where that is not known.
    pub exposure_ns: u64,
    /// From the first line to the last one, ns; 0 for a global shutter.
    pub readout_ns: u64,
}

/// What the kernel's time of a picture means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TimeSource {
    /// The first line begins to be exposed.
    StartOfExposure,
    /// The first line has been exposed and begins to be read.
    StartOfReadout,
    /// The last line has been read.
    EndOfFrame,
    /// A clock of its own or none: the time of arrival stands in for the end of the frame.
    Arrival,
}

/// Number and time of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stamp {
    /// The device's running number since it was started.
    pub sequence: u32,
    /// Monotonic clock at the middle of the middle line's exposure, ns.
    pub time_ns: u64,
    /// Monotonic clock at the end of the readout, ns; `None` where the device does not tell it.
    pub complete_ns: Option<u64>,
    /// Where that time comes from.
    pub source: TimeSource,
    /// The device says that the picture is damaged.
    pub is_damaged: bool,
}

impl Shutter {
    /// The middle of the middle line's exposure, ns.
    pub fn middle(&self, source: TimeSource, noted_ns: u64) -> u64 {
        let half = (self.exposure_ns + self.readout_ns) / 2;
        match source {
            TimeSource::StartOfExposure => noted_ns.saturating_add(half),
            TimeSource::StartOfReadout => {
                noted_ns.saturating_add(self.readout_ns / 2).saturating_sub(self.exposure_ns / 2)
            }
            TimeSource::EndOfFrame | TimeSource::Arrival => noted_ns.saturating_sub(half),
        }
    }

    /// The end of the readout, ns: not known from a start without the exposure, nor from the arrival.
    pub fn end(&self, source: TimeSource, noted_ns: u64) -> Option<u64> {
        match source {
            TimeSource::StartOfExposure if self.exposure_ns == 0 => None,
            TimeSource::StartOfExposure => {
                Some(noted_ns.saturating_add(self.exposure_ns).saturating_add(self.readout_ns))
            }
            TimeSource::StartOfReadout => Some(noted_ns.saturating_add(self.readout_ns)),
            TimeSource::EndOfFrame => Some(noted_ns),
            TimeSource::Arrival => None,
        }
    }
}

/// A picture noted longer ago than this was not noted by the monotonic clock, ns: nobody waits so long.
const OLDEST_NS: u64 = 10_000_000_000;

/// The source that the flags of a V4L2 buffer name, whatever driver set them, where its time can be one of
/// the monotonic clock (`uvcvideo` says so even where its module was told to take another clock).
///
/// `TSTAMP_SRC_SOE` is "when the exposure of the frame has begun", `TSTAMP_SRC_EOF`, no bit at all, "when the
/// last pixel of the frame has been received" (Linux userspace API, "Buffer Flags").
pub(crate) fn source(flags: Flags, noted_ns: u64, now_ns: u64) -> TimeSource {
    let is_monotonic = flags & Flags::TIMESTAMP_MASK == Flags::TIMESTAMP_MONOTONIC;
    let is_start = flags & Flags::TSTAMP_SRC_MASK == Flags::TSTAMP_SRC_SOE;
    if !is_monotonic || noted_ns == 0 || noted_ns > now_ns || now_ns - noted_ns > OLDEST_NS {
        TimeSource::Arrival
    } else if is_start {
        TimeSource::StartOfExposure
    } else {
        TimeSource::EndOfFrame
    }
}

/// libcamera's `SensorTimestamp`, ns, as a time of the monotonic clock, and what it is of; without one that
/// can be true the time of arrival.
///
/// libcamera (0.4 to 0.7, `control_ids_core.yaml`) documents it as "the time when the first row of the image
/// sensor active array is exposed", by CLOCK_BOOTTIME, and leaves open which end of the exposure that is. Its
/// pipelines of the Raspberry Pi (`rpi/vc4`, `rpi/pisp`) hand on the time of the receiver's V4L2 buffer,
/// which both drivers (`bcm2835-unicam`, `rp1-cfe`) note by CLOCK_MONOTONIC in the interrupt of the frame's
/// start on the wire, "when the first data byte was captured": the first row has been exposed and begins to
/// be read. That is what is taken; a time that only the boot clock can have noted is brought to the monotonic
/// one.
pub fn sensor_time(told: Option<i64>, monotonic_ns: u64, boottime_ns: u64) -> (u64, TimeSource) {
    let told = told.and_then(|ns| u64::try_from(ns).ok());
    match told.and_then(|ns| of_either_clock(ns, monotonic_ns, boottime_ns)) {
        Some(ns) => (ns, TimeSource::StartOfReadout),
        None => (monotonic_ns, TimeSource::Arrival),
    }
}

/// A time that the boot clock or the monotonic one has noted, as one of the monotonic clock, ns: they differ
/// by the time that the board was suspended. `None` where neither can have noted it just now.
fn of_either_clock(noted_ns: u64, monotonic_ns: u64, boottime_ns: u64) -> Option<u64> {
    let is_recent = |now_ns: u64| noted_ns <= now_ns && now_ns - noted_ns <= OLDEST_NS;
    if noted_ns == 0 {
        None
    } else if is_recent(monotonic_ns) {
        Some(noted_ns)
    } else if is_recent(boottime_ns) {
        noted_ns.checked_sub(boottime_ns.saturating_sub(monotonic_ns))
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_ends_of_an_exposure_give_the_same_middle() {
        // The first line is exposed from 100,000 to 104,000, the last one, 6,000 later, to 110,000.
        let shutter = Shutter { exposure_ns: 4_000, readout_ns: 6_000 };
        assert_eq!(shutter.middle(TimeSource::StartOfExposure, 100_000), 105_000);
        assert_eq!(shutter.middle(TimeSource::StartOfReadout, 104_000), 105_000);
        assert_eq!(shutter.middle(TimeSource::EndOfFrame, 110_000), 105_000);
        assert_eq!(shutter.end(TimeSource::StartOfExposure, 100_000), Some(110_000));
        assert_eq!(shutter.end(TimeSource::StartOfReadout, 104_000), Some(110_000));
        assert_eq!(shutter.end(TimeSource::EndOfFrame, 110_000), Some(110_000));
        assert_eq!(shutter.end(TimeSource::Arrival, 110_000), None);
        assert_eq!(Shutter { exposure_ns: 0, ..shutter }.end(TimeSource::StartOfExposure, 1), None);
    }

    /// The numbers of linux/videodev2.h.
    fn of_flags(flags: u32, noted_ns: u64, now_ns: u64) -> TimeSource {
        source(Flags::from(flags), noted_ns, now_ns)
    }

    #[test]
    fn the_source_of_a_time_is_what_the_buffers_flags_say() {
        let (now, mapped_done_key) = (50_000_000_000, 0x0001 | 0x0004 | 0x0008);
        for (flags, source) in [
            (0x0000_2000, TimeSource::EndOfFrame),
            (0x0001_2000, TimeSource::StartOfExposure),
            // By no clock that is known, and copied from what was written into the device.
            (0x0000_0000, TimeSource::Arrival),
            (0x0001_0000, TimeSource::Arrival),
            (0x0000_4000, TimeSource::Arrival),
            (0x0001_4000, TimeSource::Arrival),
        ] {
            assert_eq!(of_flags(flags, now - 1, now), source, "{flags:#x}");
            assert_eq!(of_flags(flags | mapped_done_key, now - 1, now), source, "{flags:#x}");
        }
    }

    #[test]
    fn a_time_of_another_clock_is_not_taken() {
        let now = 50_000_000_000;
        // The last one is of the real-time clock.
        for noted in [0, now + 1, now - OLDEST_NS - 1, 1_790_000_000_000_000_000] {
            assert_eq!(of_flags(0x0001_2000, noted, now), TimeSource::Arrival, "{noted}");
        }
    }

    #[test]
    fn a_time_of_the_boot_clock_is_one_of_the_monotonic_clock_less_the_time_asleep() {
        let (monotonic, asleep) = (50_000_000_000, 20_000_000_000);
        let boottime = monotonic + asleep;
        assert_eq!(of_either_clock(monotonic - 5, monotonic, boottime), Some(monotonic - 5));
        assert_eq!(of_either_clock(boottime - 5, monotonic, boottime), Some(monotonic - 5));
        assert_eq!(of_either_clock(monotonic - 5, monotonic, monotonic), Some(monotonic - 5), "never asleep");
        for noted in [0, boottime + 1, monotonic - OLDEST_NS - 1] {
            assert_eq!(of_either_clock(noted, monotonic, boottime), None, "{noted}");
        }
    }

    #[test]
    fn a_sensor_timestamp_of_either_clock_gives_the_middle_of_the_exposure() {
        // Exposed for 4 ms, the last line 6 ms after the first: the first is read from 50 s on, and the
        // middle line was exposed from 49.999 s to 50.003 s. The board was asleep for 20 s before.
        let (ms, readout) = (1_000_000, 50_000_000_000);
        let shutter = Shutter { exposure_ns: 4 * ms, readout_ns: 6 * ms };
        let (now, asleep) = (readout + 12 * ms, 20_000_000_000);
        for told in [readout, readout + asleep] {
            let (noted, source) = sensor_time(Some(told as i64), now, now + asleep);
            assert_eq!(shutter.middle(source, noted), readout + ms, "{told}");
            assert_eq!(shutter.end(source, noted), Some(readout + 6 * ms), "{told}");
        }
        for told in [None, Some(-1), Some(0), Some((now + asleep + 1) as i64)] {
            assert_eq!(sensor_time(told, now, now + asleep), (now, TimeSource::Arrival), "{told:?}");
        }
    }
}
