//! The coarse offset: near the difference of the two starts of motion where both show one, else anywhere that
//! the recordings overlap; by the largest correlation of the motions.

use super::start::track_start;
use super::track::{Six, Track};
use crate::DEGREES_OF_FREEDOM;

/// How far the start of motion may be off, s.
const START_REACH_S: f64 = 2.0;
/// Correlation from which on the start of motion is believed.
const BELIEVED: f64 = 0.9;
/// Samples of the measured motion that are compared.
const SAMPLES: usize = 4000;
/// Steps of the offset at most.
const OFFSETS: usize = 40_000;
/// Least share of the samples compared that must have a reference.
const LEAST_OVERLAP: f64 = 0.5;
/// A second offset is a rival from this share of the best correlation on ...
const RIVAL: f64 = 0.97;
/// ... if the correlation falls below this share between them.
const VALLEY: f64 = 0.9;

/// What was found.
pub(crate) struct Coarse {
    /// Box time less recorder time, s.
    pub(crate) offset: f64,
    pub(crate) correlation: f64,
    pub(crate) starts: Option<[f64; 2]>,
    pub(crate) rival: Option<f64>,
}

/// The coarse offset; `None` where nothing moves or nothing overlaps.
pub(crate) fn coarse(measured: &Track, recorder: &Track) -> Option<Coarse> {
    let starts = track_start(measured).zip(track_start(recorder)).map(|(a, b)| [a, b]);
    let grid = Grid::new(measured, recorder);
    if let Some([a, b]) = starts {
        let found = grid.best(a - b - START_REACH_S, a - b + START_REACH_S);
        if let Some((offset, correlation, rival)) = found.filter(|(_, c, _)| *c >= BELIEVED) {
            return Some(Coarse { offset, correlation, starts, rival });
        }
    }
    let ([m0, m1], [r0, r1]) = (measured.span(), recorder.span());
    let (offset, correlation, rival) = grid.best(m0 - r1, m1 - r0)?;
    // What the starts said was not believed.
    Some(Coarse { offset, correlation, starts: None, rival })
}

/// Correlation at one offset; `None` where too little overlaps.
pub(crate) fn correlation(measured: &Track, recorder: &Track, offset: f64) -> Option<f64> {
    Grid::new(measured, recorder).correlation(offset)
}

/// Samples of the measured motion, and the recorder they are compared with.
struct Grid<'a> {
    samples: Vec<(f64, Six)>,
    recorder: &'a Track,
    step: f64,
}

impl<'a> Grid<'a> {
    fn new(measured: &Track, recorder: &'a Track) -> Self {
        let count = measured.times().len();
        let every = count.div_ceil(SAMPLES);
        let samples = measured.times().iter().copied().zip(measured.values().iter().copied());
        let samples = samples.step_by(every).map(|(t, values)| (t, scaled(&values))).collect();
        // A sample of the slower one: the fine alignment starts within half of it.
        let step = measured.interval().max(recorder.interval());
        Self { samples, recorder, step }
    }

    /// Correlation of all degrees of freedom together, each about its own mean, in units of R(a).
    fn correlation(&self, offset: f64) -> Option<f64> {
        let pairs: Vec<(&Six, Six)> = self
            .samples
            .iter()
            .filter_map(|(t, m)| Some((m, scaled(&self.recorder.at(t - offset)?.0))))
            .collect();
        if (pairs.len() as f64) < LEAST_OVERLAP * self.samples.len() as f64 {
            return None;
        }
        let n = pairs.len() as f64;
        let (mut mm, mut mr, mut rr) = (0.0, 0.0, 0.0);
        for k in 0..6 {
            let mean = |of: &dyn Fn(&(&Six, Six)) -> f64| pairs.iter().map(of).sum::<f64>() / n;
            let (a, b) = (mean(&|p| p.0[k]), mean(&|p| p.1[k]));
            for (m, r) in &pairs {
                let (m, r) = (m[k] - a, r[k] - b);
                mm += m * m;
                mr += m * r;
                rr += r * r;
            }
        }
        let correlation = mr / (mm * rr).sqrt();
        correlation.is_finite().then_some(correlation)
    }

    /// The best offset in a range with its correlation, and a rival.
    fn best(&self, from: f64, to: f64) -> Option<(f64, f64, Option<f64>)> {
        let step = self.step.max((to - from) / OFFSETS as f64);
        let count = ((to - from) / step).ceil() as usize;
        let tried: Vec<(f64, f64)> = (0..=count)
            .map(|i| from + step * i as f64)
            .filter_map(|offset| Some((offset, self.correlation(offset)?)))
            .collect();
        let (best, &(offset, most)) = tried.iter().enumerate().max_by(|a, b| a.1.1.total_cmp(&b.1.1))?;
        let valley = |(_, c): &&(f64, f64)| *c < VALLEY * most;
        // On either side, what comes after the first valley.
        let after = tried[best..].iter().skip_while(|t| !valley(t));
        let before = tried[..best].iter().rev().skip_while(|t| !valley(t));
        let rival =
            after.chain(before).filter(|(_, c)| *c >= RIVAL * most).max_by(|a, b| a.1.total_cmp(&b.1));
        Some((offset, most, rival.map(|(offset, _)| *offset)))
    }
}

fn scaled(values: &Six) -> Six {
    std::array::from_fn(|k| values[k] / DEGREES_OF_FREEDOM[k].limit)
}
