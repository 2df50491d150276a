//! MAX, RMSE, MEAN and STD (thesis 5.3.5), and how deviations stand to the stated standard deviations.

use serde::Serialize;

/// How one degree of freedom deviates from the reference; lengths in mm, angles in degrees.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Deviation {
    /// Largest absolute deviation.
    pub max: f64,
    /// The frame that has it.
    pub max_frame: u32,
    /// Root of the mean square deviation.
    pub rmse: f64,
    /// Mean deviation, with its sign.
    pub mean: f64,
    /// Standard deviation about the mean (divided by n, so that rmse^2 = mean^2 + std^2).
    pub std: f64,
    /// What requirement R(a) allows.
    pub limit: f64,
    /// Whether `max` is within it.
    pub within_limit: bool,
    /// Shares (0 to 1) of the frames that deviate by at most 1, 2 and 3 of their own stated standard
    /// deviations; `None` where no frame states one.
    pub within_sigma: Option<[f64; 3]>,
}

/// How one degree of freedom moves.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Motion {
    /// Smallest value.
    pub min: f64,
    /// Largest value.
    pub max: f64,
    /// Mean value.
    pub mean: f64,
    /// Standard deviation about the mean (divided by n).
    pub std: f64,
    /// Median of the stated standard deviations; `None` where no frame states one.
    pub sigma_median: Option<f64>,
}

/// One frame's deviation, as [`deviation`] takes it.
pub(crate) struct Error {
    pub(crate) frame: u32,
    pub(crate) error: f64,
    pub(crate) sigma: f64,
}

/// Statistics of the deviations; `None` of none.
pub(crate) fn deviation(errors: &[Error], limit: f64) -> Option<Deviation> {
    let (mean, std) = mean_and_std(errors.iter().map(|e| e.error))?;
    let worst =
        errors.iter().max_by(|a, b| a.error.abs().total_cmp(&b.error.abs()).then(b.frame.cmp(&a.frame)))?;
    let squares: f64 = errors.iter().map(|e| e.error * e.error).sum();
    let stated: Vec<f64> =
        errors.iter().filter(|e| is_stated(e.sigma)).map(|e| e.error.abs() / e.sigma).collect();
    let share = |k: f64| stated.iter().filter(|r| **r <= k).count() as f64 / stated.len() as f64;
    Some(Deviation {
        max: worst.error.abs(),
        max_frame: worst.frame,
        rmse: (squares / errors.len() as f64).sqrt(),
        mean,
        std,
        limit,
        within_limit: worst.error.abs() <= limit,
        within_sigma: (!stated.is_empty()).then(|| [share(1.0), share(2.0), share(3.0)]),
    })
}

/// Statistics of the motion; `None` of none.
pub(crate) fn motion(values: &[f64], sigmas: &[f64]) -> Option<Motion> {
    let (mean, std) = mean_and_std(values.iter().copied())?;
    Some(Motion {
        min: values.iter().copied().min_by(f64::total_cmp)?,
        max: values.iter().copied().max_by(f64::total_cmp)?,
        mean,
        std,
        sigma_median: median(sigmas.iter().copied().filter(|s| is_stated(*s)).collect()),
    })
}

fn is_stated(sigma: f64) -> bool {
    sigma.is_finite() && sigma > 0.0
}

/// Mean and standard deviation about it, in two passes: the sum of squares less the squared sum would cancel.
fn mean_and_std(values: impl Iterator<Item = f64> + Clone) -> Option<(f64, f64)> {
    let n = values.clone().count();
    if n == 0 {
        return None;
    }
    let mean = values.clone().sum::<f64>() / n as f64;
    let variance = values.map(|v| (v - mean) * (v - mean)).sum::<f64>() / n as f64;
    Some((mean, variance.sqrt()))
}

/// The middle value, the lower of the two middle ones where their number is even.
pub(crate) fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len().saturating_sub(1) / 2).copied()
}
