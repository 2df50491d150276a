//! How CB_02 moves against CB_01: rest, then a sum of oscillations, steps and ramps a degree of freedom, or
//! six columns of a table (thesis 1.2 names the degrees, 5.4.3 and 5.5 the motions).

use std::f64::consts::{PI, TAU};

/// The six degrees of freedom in the order x, y, z (mm), roll, pitch, yaw (degrees).
pub(crate) type Motions = [f64; 6];

/// One contribution to one degree of freedom; times in seconds from the start of the recording.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Term {
    /// `amplitude sin(2 pi frequency (t - start) + phase)` between start and end, faded in and out.
    Sine {
        /// mm or degrees.
        amplitude: f64,
        /// Hz.
        frequency: f64,
        /// Radians.
        phase: f64,
        /// Seconds.
        start: f64,
        /// Seconds.
        end: f64,
        /// Seconds over which it grows after the start and shrinks before the end.
        fade: f64,
    },
    /// A change by `size` that stays, on a raised cosine over `rise` seconds; at once for 0.
    Step {
        /// mm or degrees.
        size: f64,
        /// Seconds.
        at: f64,
        /// Seconds.
        rise: f64,
    },
    /// A change by `size` at constant speed between two times.
    Ramp {
        /// mm or degrees.
        size: f64,
        /// Seconds.
        from: f64,
        /// Seconds.
        to: f64,
    },
    /// Stop and go: a change by `size` at once at the start and after every `every` seconds, `steps` times
    /// (the photographs at standstill of thesis 5.3).
    Stairs {
        /// One step, mm or degrees.
        size: f64,
        /// Number of steps.
        steps: f64,
        /// Seconds.
        start: f64,
        /// Seconds.
        every: f64,
    },
}

/// 0 before 0, 1 after 1, a raised cosine between.
fn rise(share: f64) -> f64 {
    0.5 - 0.5 * (PI * share.clamp(0.0, 1.0)).cos()
}

impl Term {
    /// Its value at a time, mm or degrees.
    pub(crate) fn at(&self, t: f64) -> f64 {
        match *self {
            Term::Sine { amplitude, frequency, phase, start, end, fade } => {
                if t < start || t >= end {
                    return 0.0;
                }
                let faded = if fade > 0.0 { rise((t - start) / fade) * rise((end - t) / fade) } else { 1.0 };
                faded * amplitude * (TAU * frequency * (t - start) + phase).sin()
            }
            Term::Step { size, at, rise: over } => {
                if t < at {
                    0.0
                } else if over > 0.0 {
                    size * rise((t - at) / over)
                } else {
                    size
                }
            }
            Term::Ramp { size, from, to } => size * ((t - from) / (to - from)).clamp(0.0, 1.0),
            Term::Stairs { size, steps, start, every } => {
                // A frame on the edge belongs to the step: times are sums of rounded numbers.
                size * (((t - start) / every + 1e-9).floor() + 1.0).clamp(0.0, steps)
            }
        }
    }
}

/// The whole motion.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Motion {
    /// Seconds of rest at the start.
    pub(crate) rest_s: f64,
    /// Contributions with the index of their degree of freedom.
    pub(crate) terms: Vec<(usize, Term)>,
    /// One row a frame; between the rows the motion is linear. Empty: there is no table.
    pub(crate) table: Vec<Motions>,
    /// Frames a second of the table.
    pub(crate) rate_hz: f64,
}

impl Motion {
    /// The six motions at a time, seconds.
    pub(crate) fn at(&self, t: f64) -> Motions {
        let mut sum = self.tabled(t);
        if t >= self.rest_s {
            for (degree, term) in &self.terms {
                sum[*degree] += term.at(t);
            }
        }
        sum
    }

    fn tabled(&self, t: f64) -> Motions {
        let Some(last) = self.table.len().checked_sub(1) else { return [0.0; 6] };
        let row = (t * self.rate_hz).clamp(0.0, last as f64);
        let before = (row.floor() as usize).min(last);
        let share = row - row.floor();
        let (a, b) = (&self.table[before], &self.table[(before + 1).min(last)]);
        std::array::from_fn(|i| a[i] + share * (b[i] - a[i]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn motion(terms: Vec<(usize, Term)>) -> Motion {
        Motion { rest_s: 0.5, terms, table: Vec::new(), rate_hz: 50.0 }
    }

    #[test]
    fn nothing_moves_during_rest() {
        let sine = Term::Sine { amplitude: 5.0, frequency: 1.0, phase: 1.0, start: 0.0, end: 9.0, fade: 0.0 };
        let motion = motion(vec![(1, sine), (5, Term::Step { size: 1.0, at: 0.5, rise: 0.0 })]);
        assert_eq!(motion.at(0.0), [0.0; 6]);
        assert_eq!(motion.at(0.499), [0.0; 6]);
        assert_eq!(motion.at(0.5)[5], 1.0);
    }

    #[test]
    fn terms_add_up_on_their_own_degree_of_freedom() {
        let sine = Term::Sine { amplitude: 4.0, frequency: 0.5, phase: 0.0, start: 0.5, end: 9.0, fade: 0.0 };
        let motion = motion(vec![
            (1, sine),
            (1, Term::Ramp { size: 2.0, from: 0.5, to: 1.5 }),
            (4, Term::Step { size: 3.0, at: 1.0, rise: 0.5 }),
        ]);
        let at = motion.at(1.0);
        // sin(2 pi 0.5 0.5) = 1; the ramp is half way; the step begins.
        assert!((at[1] - 5.0).abs() < 1e-12);
        assert_eq!(at[4], 0.0);
        assert!((motion.at(1.25)[4] - 1.5).abs() < 1e-12);
        assert_eq!(motion.at(2.0)[4], 3.0);
        assert_eq!([at[0], at[2], at[3], at[5]], [0.0; 4]);
    }

    #[test]
    fn a_faded_oscillation_starts_and_ends_at_zero() {
        let sine =
            Term::Sine { amplitude: 4.0, frequency: 3.0, phase: PI / 2.0, start: 1.0, end: 3.0, fade: 0.5 };
        assert!(sine.at(1.0).abs() < 1e-12 && sine.at(2.999_999).abs() < 1e-9);
        assert!((sine.at(2.0) - 4.0).abs() < 1e-12);
        assert_eq!(sine.at(3.0), 0.0);
    }

    #[test]
    fn stairs_stand_still_between_their_steps_and_at_their_top() {
        let stairs = Term::Stairs { size: 10.0, steps: 3.0, start: 0.6, every: 0.2 };
        let at = [0.5, 0.6, 0.79, 0.8, 1.0, 9.0].map(|t| stairs.at(t));
        assert_eq!(at, [0.0, 10.0, 10.0, 20.0, 30.0, 30.0]);
        // The frames of a camera, two a step.
        let heights: Vec<f64> = (5..12).map(|frame| stairs.at(f64::from(frame) / 10.0)).collect();
        assert_eq!(heights, [0.0, 10.0, 10.0, 20.0, 20.0, 30.0, 30.0]);
    }

    #[test]
    fn a_table_is_met_at_its_rows_and_linear_between() {
        let mut rows = vec![[0.0; 6], [0.0; 6], [0.0; 6]];
        rows[1][1] = 10.0;
        let motion = Motion { rest_s: 0.0, terms: Vec::new(), table: rows, rate_hz: 50.0 };
        assert_eq!(motion.at(0.02)[1], 10.0);
        assert!((motion.at(0.01)[1] - 5.0).abs() < 1e-12);
        assert_eq!(motion.at(9.0)[1], 0.0);
        assert_eq!(motion.at(-1.0)[1], 0.0);
    }
}
