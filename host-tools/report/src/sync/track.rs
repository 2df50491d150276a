//! A motion over time, sampled unevenly: natural cubic splines through its samples, none across gaps.

/// Neighbours further apart than so many median intervals have a gap between them.
const GAP_INTERVALS: f64 = 4.0;

/// The six degrees of freedom.
pub(crate) type Six = [f64; 6];

/// Samples with the second derivatives of the splines through them.
#[derive(Clone, Debug)]
pub(crate) struct Track {
    times: Vec<f64>,
    values: Vec<Six>,
    bends: Vec<Six>,
    interval: f64,
}

impl Track {
    /// Through samples at rising times, s; two at least.
    pub(crate) fn new(times: Vec<f64>, values: Vec<Six>) -> Self {
        let steps = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let interval = crate::statistics::median(steps).unwrap_or(1.0);
        let mut track = Self { bends: vec![[0.0; 6]; values.len()], times, values, interval };
        let mut first = 0;
        for i in 1..=track.times.len() {
            if i == track.times.len() || track.is_gap(i) {
                track.bend(first, i);
                first = i;
            }
        }
        track
    }

    /// Whether there is a gap before sample `i`.
    fn is_gap(&self, i: usize) -> bool {
        self.times[i] - self.times[i - 1] > GAP_INTERVALS * self.interval
    }

    /// Second derivatives of the natural spline through samples `first..end` (a tridiagonal system, by
    /// elimination).
    fn bend(&mut self, first: usize, end: usize) {
        let n = end - first;
        if n < 3 {
            return;
        }
        let t = &self.times[first..end];
        let step = |i: usize| t[i + 1] - t[i];
        let mut upper = vec![0.0; n];
        let mut right = vec![[0.0; 6]; n];
        for i in 1..n - 1 {
            let (h0, h1) = (step(i - 1), step(i));
            let pivot = 2.0 * (h0 + h1) - h0 * upper[i - 1];
            upper[i] = h1 / pivot;
            for k in 0..6 {
                let y = |i: usize| self.values[first + i][k];
                let bend = 6.0 * ((y(i + 1) - y(i)) / h1 - (y(i) - y(i - 1)) / h0);
                right[i][k] = (bend - h0 * right[i - 1][k]) / pivot;
            }
        }
        for i in (1..n - 1).rev() {
            for k in 0..6 {
                self.bends[first + i][k] = right[i][k] - upper[i] * self.bends[first + i + 1][k];
            }
        }
    }

    /// Sample times, s.
    pub(crate) fn times(&self) -> &[f64] {
        &self.times
    }

    /// Samples.
    pub(crate) fn values(&self) -> &[Six] {
        &self.values
    }

    /// Median time from sample to sample, s.
    pub(crate) fn interval(&self) -> f64 {
        self.interval
    }

    /// First and last time, s.
    pub(crate) fn span(&self) -> [f64; 2] {
        [self.times.first().copied().unwrap_or(0.0), self.times.last().copied().unwrap_or(0.0)]
    }

    /// Value and slope (per s) at a time; nothing outside and in gaps.
    pub(crate) fn at(&self, t: f64) -> Option<(Six, Six)> {
        let [first, last] = self.span();
        if !(first <= t && t <= last) {
            return None;
        }
        let i = self.times.partition_point(|time| *time <= t).clamp(1, self.times.len() - 1);
        if self.is_gap(i) {
            // The samples on its edges are there all the same.
            let edge = [i - 1, i].into_iter().find(|i| self.times[*i] == t)?;
            return Some((self.values[edge], [0.0; 6]));
        }
        let h = self.times[i] - self.times[i - 1];
        let (a, b) = ((self.times[i] - t) / h, (t - self.times[i - 1]) / h);
        let mut value = [0.0; 6];
        let mut slope = [0.0; 6];
        for k in 0..6 {
            let (y0, y1) = (self.values[i - 1][k], self.values[i][k]);
            let (m0, m1) = (self.bends[i - 1][k], self.bends[i][k]);
            value[k] = a * y0 + b * y1 + h * h / 6.0 * ((a * a * a - a) * m0 + (b * b * b - b) * m1);
            slope[k] = (y1 - y0) / h + h / 6.0 * ((1.0 - 3.0 * a * a) * m0 + (3.0 * b * b - 1.0) * m1);
        }
        Some((value, slope))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spline_meets_its_samples_and_follows_a_sine_between_uneven_ones() {
        let times: Vec<f64> = (0..200).map(|i| 0.02 * f64::from(i) + 0.004 * f64::from(i % 3)).collect();
        let motion = |t: f64| [(2.0 * t).sin(), t, 1.0, 0.0, -t, (5.0 * t).cos()];
        let track = Track::new(times.clone(), times.iter().map(|t| motion(*t)).collect());
        assert_eq!(track.at(times[7]).unwrap().0, motion(times[7]));
        for t in [0.511, 1.7, 3.456] {
            let (value, slope) = track.at(t).unwrap();
            for k in 0..6 {
                // (w h)^4 / 384 of w = 5, h = 0.026: 7e-7.
                assert!((value[k] - motion(t)[k]).abs() < 1e-6, "{k} at {t}");
            }
            assert!((slope[0] - 2.0 * (2.0 * t).cos()).abs() < 1e-4 && (slope[4] + 1.0).abs() < 1e-9);
        }
        assert!(track.at(-0.001).is_none() && track.at(5.0).is_none());
    }

    #[test]
    fn nothing_is_made_up_within_a_gap() {
        let times: Vec<f64> = (0..20).chain(40..60).map(|i| 0.1 * f64::from(i)).collect();
        let track = Track::new(times, vec![[1.0; 6]; 40]);
        assert!(track.at(3.0).is_none());
        assert_eq!(track.at(1.85).unwrap().0, [1.0; 6]);
        assert_eq!(track.at(4.0).unwrap().0, [1.0; 6]);
    }
}
