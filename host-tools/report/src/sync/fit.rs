//! The fine offset and drift: generalised least squares of the deviation on the measured motion's slope, with
//! a constant and a small multiple of each degree of freedom as what may be systematic; covariance as it is
//! under correlated deviations (W. Newey and K. West, A simple, positive semi-definite, heteroskedasticity
//! and autocorrelation consistent covariance matrix, Econometrica 55, 1987).

use super::track::{Six, Track};
use crate::DEGREES_OF_FREEDOM;

/// What two crystals agree within before anything is measured, standard deviation.
const DRIFT_PRIOR: f64 = 100e-6;
/// What may be systematic, standard deviations: mm a mm and degrees a degree; mm a degree; degrees a mm.
const COUPLING: [f64; 3] = [0.02, 2.0, 0.01];
/// Iterations at most; three are usual.
const ITERATIONS: usize = 30;
/// Deviations further apart than so many seconds are taken to be independent, or so many of the recorder's
/// intervals.
const MEMORY_S: f64 = 0.1;
const MEMORY_INTERVALS: f64 = 2.0;
/// A constant and six multiples.
const NUISANCES: usize = 7;

/// What was found.
pub(crate) struct Fine {
    pub(crate) offset: f64,
    pub(crate) offset_sigma: f64,
    pub(crate) drift: f64,
    pub(crate) drift_sigma: f64,
    pub(crate) middle: f64,
}

/// One frame: the measured motion, its slope, the deviation.
struct Frame {
    late: f64,
    value: Six,
    slope: Six,
    deviation: Six,
}

/// Refines an offset; `None` where the motion does not determine it, or leads out of the recording.
pub(crate) fn fine(measured: &Track, recorder: &Track, offset: f64) -> Option<Fine> {
    let overlap = |t: f64| recorder.at(t - offset).is_some();
    let times: Vec<f64> = measured.times().iter().copied().filter(|t| overlap(*t)).collect();
    let middle = 0.5 * (times.first()? + times.last()?);
    let mut sought = [offset, 0.0];
    // Before anything is known, R(a) says which degree of freedom weighs how much.
    let mut sigmas: Six = DEGREES_OF_FREEDOM.map(|of| 0.1 * of.limit);
    for i in 0..ITERATIONS {
        let frames = frames(measured, recorder, &times, middle, sought);
        let step = Step::solve(&frames, &sigmas, sought[1])?;
        sought = [sought[0] + step.change[0], sought[1] + step.change[1]];
        let settled = (step.change[0] / step.sigma[0]).abs() < 1e-3;
        sigmas = step.residuals;
        if settled && i > 1 {
            return Some(Fine {
                offset: sought[0],
                offset_sigma: step.covariance(&frames, recorder.interval(), 0),
                drift: sought[1],
                drift_sigma: step.covariance(&frames, recorder.interval(), 1),
                middle,
            });
        }
    }
    None
}

fn frames(measured: &Track, recorder: &Track, times: &[f64], middle: f64, sought: [f64; 2]) -> Vec<Frame> {
    let frame = |t: &f64| {
        let late = t - middle;
        let (value, slope) = measured.at(*t)?;
        let (truth, _) = recorder.at(t - sought[0] - sought[1] * late)?;
        Some(Frame { late, value, slope, deviation: std::array::from_fn(|k| value[k] - truth[k]) })
    };
    times.iter().filter_map(frame).collect()
}

/// One step of the iteration.
struct Step {
    /// Of offset and drift.
    change: [f64; 2],
    /// Their standard deviations if deviations were independent.
    sigma: [f64; 2],
    /// Standard deviation of what is left, a degree of freedom.
    residuals: Six,
    /// Inverse of the normal matrix, prior included.
    inverse: [[f64; 2]; 2],
    /// What each frame adds to the score.
    scores: Vec<[f64; 2]>,
}

impl Step {
    fn solve(frames: &[Frame], sigmas: &Six, drift: f64) -> Option<Self> {
        if frames.len() < 2 * NUISANCES {
            return None;
        }
        let prior = 1.0 / (DRIFT_PRIOR * DRIFT_PRIOR);
        let mut normal = [[0.0, 0.0], [0.0, prior]];
        let mut score = [0.0, prior * drift];
        let mut parts = Vec::with_capacity(6);
        for k in 0..6 {
            let weight = 1.0 / (sigmas[k] * sigmas[k]);
            let part = Part::new(frames, k, weight)?;
            for (frame, columns) in frames.iter().zip(&part.columns) {
                for a in 0..2 {
                    score[a] += weight * columns[a] * frame.deviation[k];
                    for b in 0..2 {
                        normal[a][b] += weight * columns[a] * design(frame, k)[b];
                    }
                }
            }
            parts.push(part);
        }
        let determinant = normal[0][0] * normal[1][1] - normal[0][1] * normal[1][0];
        if !(determinant > 0.0 && normal[0][0] > 0.0) {
            return None;
        }
        let inverse = [
            [normal[1][1] / determinant, -normal[0][1] / determinant],
            [-normal[1][0] / determinant, normal[0][0] / determinant],
        ];
        // The deviation grows by the slope for every second that the offset is too small, hence the sign.
        let change: [f64; 2] =
            std::array::from_fn(|a| -(inverse[a][0] * score[0] + inverse[a][1] * score[1]));
        let mut scores = vec![[0.0; 2]; frames.len()];
        let mut residuals = [0.0; 6];
        for (k, part) in parts.iter().enumerate() {
            let weight = 1.0 / (sigmas[k] * sigmas[k]);
            let left = part.left(frames, k, change);
            let squares: f64 = left.iter().map(|e| e * e).sum();
            // A recorder without any noise leaves rounding: that is not a weight.
            residuals[k] =
                (squares / (frames.len() - NUISANCES) as f64).sqrt().max(1e-6 * DEGREES_OF_FREEDOM[k].limit);
            for ((score, columns), left) in scores.iter_mut().zip(&part.columns).zip(&left) {
                for a in 0..2 {
                    score[a] += weight * columns[a] * left;
                }
            }
        }
        let sigma = [inverse[0][0].sqrt(), inverse[1][1].sqrt()];
        Some(Self { change, sigma, residuals, inverse, scores })
    }

    /// Standard deviation of offset (0) or drift (1), with what deviations have in common over time.
    fn covariance(&self, frames: &[Frame], recorder_interval: f64, of: usize) -> f64 {
        let n = self.scores.len();
        let seconds = frames.last().map_or(0.0, |f| f.late) - frames.first().map_or(0.0, |f| f.late);
        let interval = seconds / (n.max(2) - 1) as f64;
        let memory = MEMORY_S.max(MEMORY_INTERVALS * recorder_interval);
        let lags = ((memory / interval).ceil() as usize).min(n / 8);
        let prior = 1.0 / (DRIFT_PRIOR * DRIFT_PRIOR);
        let row = self.inverse[of];
        let variance = |meat: &[[f64; 2]; 2]| -> f64 {
            (0..2).map(|a| (0..2).map(|b| row[a] * meat[a][b] * row[b]).sum::<f64>()).sum()
        };
        let mut meat = [[0.0, 0.0], [0.0, prior]];
        let mut independent = 0.0;
        for lag in 0..=lags {
            let weight = 1.0 - lag as f64 / (lags + 1) as f64;
            for (now, before) in self.scores[lag..].iter().zip(&self.scores) {
                for a in 0..2 {
                    for b in 0..2 {
                        let both = now[a] * before[b] + if lag == 0 { 0.0 } else { before[a] * now[b] };
                        meat[a][b] += weight * both;
                    }
                }
            }
            if lag == 0 {
                independent = variance(&meat);
            }
        }
        // A few hundred frames know little of their own correlation: where it seems to help, that is chance.
        let variance = variance(&meat).max(independent);
        // Two sought and seven systematic numbers a degree of freedom went into what is left.
        let freedom = n as f64 / (n - NUISANCES - 2).max(1) as f64;
        (variance * freedom).sqrt()
    }
}

/// How the deviation of degree of freedom `k` changes with offset and drift.
fn design(frame: &Frame, k: usize) -> [f64; 2] {
    [frame.slope[k], frame.slope[k] * frame.late]
}

/// What may be systematic: a constant, and multiples of the motion.
fn nuisances(frame: &Frame) -> [f64; NUISANCES] {
    let [x, y, z, roll, pitch, yaw] = frame.value;
    [1.0, x, y, z, roll, pitch, yaw]
}

/// One degree of freedom with the nuisances taken out.
struct Part {
    /// The design without what the nuisances explain.
    columns: Vec<[f64; 2]>,
    /// Cholesky factor of the nuisances' normal matrix.
    factor: [[f64; NUISANCES]; NUISANCES],
}

impl Part {
    fn new(frames: &[Frame], k: usize, weight: f64) -> Option<Self> {
        let mut normal = [[0.0; NUISANCES]; NUISANCES];
        let mut mixed = [[0.0; NUISANCES]; 2];
        for frame in frames {
            let (n, d) = (nuisances(frame), design(frame, k));
            for i in 0..NUISANCES {
                for j in 0..=i {
                    normal[i][j] += n[i] * n[j];
                }
                mixed[0][i] += n[i] * d[0];
                mixed[1][i] += n[i] * d[1];
            }
        }
        for (l, row) in normal.iter_mut().enumerate() {
            let sigma = match (l.checked_sub(1), k) {
                // The constant is free, but for rounding.
                (None, _) => 1e6,
                (Some(l), k) if (l < 3) == (k < 3) => COUPLING[0],
                (Some(_), k) if k < 3 => COUPLING[1],
                _ => COUPLING[2],
            };
            row[l] += 1.0 / (weight * sigma * sigma);
        }
        let factor = cholesky(normal)?;
        let explained = mixed.map(|mixed| solve(&factor, &mixed));
        let columns = frames
            .iter()
            .map(|frame| {
                let (n, d) = (nuisances(frame), design(frame, k));
                std::array::from_fn(|a| d[a] - n.iter().zip(&explained[a]).map(|(n, e)| n * e).sum::<f64>())
            })
            .collect();
        Some(Self { columns, factor })
    }

    /// The deviations after a change of offset and drift, without what the nuisances then explain.
    fn left(&self, frames: &[Frame], k: usize, change: [f64; 2]) -> Vec<f64> {
        let changed = |frame: &Frame| {
            let [a, b] = design(frame, k);
            frame.deviation[k] + a * change[0] + b * change[1]
        };
        let mut mixed = [0.0; NUISANCES];
        for frame in frames {
            for (mixed, n) in mixed.iter_mut().zip(nuisances(frame)) {
                *mixed += n * changed(frame);
            }
        }
        let explained = solve(&self.factor, &mixed);
        let left = |frame: &Frame| {
            changed(frame) - nuisances(frame).iter().zip(&explained).map(|(n, e)| n * e).sum::<f64>()
        };
        frames.iter().map(left).collect()
    }
}

/// The lower factor of a symmetric matrix whose lower half is given.
fn cholesky(mut m: [[f64; NUISANCES]; NUISANCES]) -> Option<[[f64; NUISANCES]; NUISANCES]> {
    for i in 0..NUISANCES {
        for j in 0..=i {
            let sum: f64 = m[i][j] - (0..j).map(|k| m[i][k] * m[j][k]).sum::<f64>();
            if i == j {
                if sum.is_nan() || sum <= 0.0 {
                    return None;
                }
                m[i][i] = sum.sqrt();
            } else {
                m[i][j] = sum / m[j][j];
            }
        }
    }
    Some(m)
}

fn solve(factor: &[[f64; NUISANCES]; NUISANCES], right: &[f64; NUISANCES]) -> [f64; NUISANCES] {
    let mut x = *right;
    for i in 0..NUISANCES {
        let sum: f64 = (0..i).map(|j| factor[i][j] * x[j]).sum();
        x[i] = (x[i] - sum) / factor[i][i];
    }
    for i in (0..NUISANCES).rev() {
        let sum: f64 = (i + 1..NUISANCES).map(|j| factor[j][i] * x[j]).sum();
        x[i] = (x[i] - sum) / factor[i][i];
    }
    x
}
