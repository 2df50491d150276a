//! When the lamps of lit targets are switched: between two exposures. A free-running camera is already
//! exposing the next frame when one arrives, so the switch waits for the end of that exposure, which is
//! before that frame can come.

use gangway_device::{Clock, Lamp};

use crate::Settings;

/// How the lamps are driven.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LampMode {
    /// They shine as long as the loop runs.
    #[default]
    On,
    /// They stay dark.
    Off,
    /// They shine in every other frame, and in all of them while the targets are being found: that takes some
    /// frames.
    Alternate,
}

/// What must be left between two exposures for a switch, s: the lamps' own rise and what the frames' times
/// are off.
pub const LAMP_MARGIN_S: f64 = 1e-3;

/// Drives the lamps.
#[derive(Debug, Default)]
pub(crate) struct Lamps {
    lit: Option<bool>,
}

impl Lamps {
    /// Switches the lamps as the mode asks, after the frame of this time (mid-exposure); `seeking` while
    /// nothing is known of the targets' place.
    ///
    /// Waits at most for the end of the exposure that is going on.
    pub(crate) fn drive<L: Lamp>(
        &mut self,
        settings: &Settings,
        seeking: bool,
        frame_time_ns: u64,
        clock: &impl Clock,
        lamps: &mut [L],
    ) {
        if lamps.is_empty() {
            return;
        }
        let lit = match settings.lamps {
            LampMode::On => true,
            LampMode::Off => false,
            LampMode::Alternate => seeking || !self.lit.unwrap_or(false),
        };
        if self.lit == Some(lit) {
            return;
        }
        let gap = Gap::of(settings);
        let at = gap.next(frame_time_ns, clock.now_ns());
        clock.wait_until_ns(at);
        // Read once: a clock goes on.
        let now_ns = at.max(clock.now_ns());
        if gap.next(frame_time_ns, now_ns) != now_ns {
            // Woken too late for this gap; the next frame has another.
            return;
        }
        for lamp in lamps {
            // A lamp that fails shows in the frames: what they show is measured.
            let _ = lamp.set_lit(lit);
        }
        self.lit = Some(lit);
    }
}

/// The gaps between exposures, by the time since a frame's middle, ns.
#[derive(Clone, Copy, Debug)]
struct Gap {
    period: u64,
    /// From the middle of the exposure to when the switch may come, and to when it may not come any more.
    from: u64,
    to: u64,
}

impl Gap {
    fn of(settings: &Settings) -> Self {
        let ns = |s: f64| (s * 1e9).max(0.0) as u64;
        let rows = libm::fabs(settings.shutter.line_time_s) * f64::from(settings.picture.1);
        // Of exposures that change the longest one is kept clear.
        let exposure_s = settings.exposure.map_or(settings.shutter.exposure_s, |auto| auto.longest_s);
        let half = 0.5 * (exposure_s + rows + LAMP_MARGIN_S);
        let period = ns(1.0 / settings.rate_hz).max(1);
        // Where nothing is left, which the setup refuses for lamps that alternate, the middle between two
        // frames.
        let from = ns(half).min(period / 2);
        Self { period, from, to: period - from }
    }

    /// The first moment from `now` on that lies in a gap after the frame of this time.
    fn next(&self, frame_time_ns: u64, now: u64) -> u64 {
        let since = now.saturating_sub(frame_time_ns);
        let into = since % self.period;
        let wait = if into < self.from {
            self.from - into
        } else if into <= self.to {
            0
        } else {
            self.period - into + self.from
        };
        now.saturating_add(wait)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_switch_waits_for_the_end_of_the_exposure_that_is_going_on() {
        // 50 frames a second of 8 ms: from 4.5 to 15.5 ms after a frame's middle nothing is exposed.
        let gap = Gap { period: 20_000_000, from: 4_500_000, to: 15_500_000 };
        let after = |ms: u64| gap.next(1_000_000_000, 1_000_000_000 + ms * 1_000_000) - 1_000_000_000;
        assert_eq!(after(10), 10_000_000, "in the gap: at once");
        assert_eq!(after(16), 24_500_000, "the next frame's exposure is about to begin");
        assert_eq!(after(21), 24_500_000, "the next frame is being exposed");
        assert_eq!(after(25), 25_000_000);
    }
}
