//! The lamps of lit targets: when they shine. The scene says it, since a recording cannot follow the box.

use crate::file::Drive;

/// The lamps, all together.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Lamp {
    /// Level of a lit disc, share of full scale at a gain of 1.
    pub(crate) level: f64,
    pub(crate) drive: LampDrive,
    /// Seconds at which they are switched over beside that.
    pub(crate) switches_s: Vec<f64>,
}

/// How they are driven.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum LampDrive {
    Steady {
        lit: bool,
    },
    /// Every other frame from the first or the second on, switched midway between two frames and so much
    /// later.
    Alternate {
        starts_dark: bool,
        delay_s: f64,
        rate_hz: f64,
    },
}

impl LampDrive {
    pub(crate) fn new(drive: Drive, starts_dark: bool, delay_s: f64, rate_hz: f64) -> Self {
        match drive {
            Drive::On => Self::Steady { lit: true },
            Drive::Off => Self::Steady { lit: false },
            Drive::Alternate => Self::Alternate { starts_dark, delay_s, rate_hz },
        }
    }
}

impl Lamp {
    /// Share of the time from `from` to `to`, seconds, in which they shine; at one moment where both are the
    /// same.
    pub(crate) fn lit_share(&self, from: f64, to: f64) -> f64 {
        let mut times: Vec<f64> = self.switches_s.clone();
        if let LampDrive::Alternate { delay_s, rate_hz, .. } = self.drive {
            let first = ((from - delay_s) * rate_hz - 0.5).floor() as i64;
            let last = ((to - delay_s) * rate_hz - 0.5).ceil() as i64;
            times.extend((first..=last).map(|k| (k as f64 + 0.5) / rate_hz + delay_s));
        }
        times.retain(|t| *t > from && *t < to);
        times.extend([from, to]);
        times.sort_by(f64::total_cmp);
        let lit = |a: f64, b: f64| f64::from(u8::from(self.is_lit(0.5 * (a + b))));
        if to <= from {
            return lit(from, from);
        }
        times.windows(2).map(|pair| (pair[1] - pair[0]) * lit(pair[0], pair[1])).sum::<f64>() / (to - from)
    }

    fn is_lit(&self, t: f64) -> bool {
        let driven = match self.drive {
            LampDrive::Steady { lit } => lit,
            LampDrive::Alternate { starts_dark, delay_s, rate_hz } => {
                let frame = ((t - delay_s) * rate_hz + 0.5).floor() as i64;
                (frame % 2 == 0) != starts_dark
            }
        };
        let switched = self.switches_s.iter().filter(|at| **at <= t).count();
        driven != (switched % 2 == 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn alternating(delay_s: f64) -> Lamp {
        let drive = LampDrive::Alternate { starts_dark: false, delay_s, rate_hz: 50.0 };
        Lamp { level: 0.7, drive, switches_s: Vec::new() }
    }

    #[test]
    fn alternate_lamps_shine_over_every_other_exposure() {
        let lamp = alternating(0.0);
        let shares: Vec<f64> = (0..6)
            .map(|frame| f64::from(frame) / 50.0)
            .map(|t| lamp.lit_share(t - 0.004, t + 0.004))
            .collect();
        assert_eq!(shares, [1.0, 0.0, 1.0, 0.0, 1.0, 0.0]);
    }

    #[test]
    fn a_late_switch_falls_into_the_exposure() {
        // 10 ms after the frame's middle and 8 later: 2 ms before the end of the next one's exposure of 8 ms
        // less 4.
        let lamp = alternating(0.012);
        let share = lamp.lit_share(0.020 - 0.004, 0.020 + 0.004);
        assert!((share - 0.75).abs() < 1e-9, "{share}");
    }

    #[test]
    fn a_switch_turns_the_state_over() {
        let lamp = Lamp { level: 1.0, drive: LampDrive::Steady { lit: true }, switches_s: vec![1.0, 2.0] };
        assert_eq!([0.5, 1.5, 2.5].map(|t| lamp.lit_share(t, t)), [1.0, 0.0, 1.0]);
        assert!((lamp.lit_share(0.9, 1.1) - 0.5).abs() < 1e-9);
    }
}
