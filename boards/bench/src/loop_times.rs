//! Loop times of any number of frames in fixed space: a histogram whose buckets are 1.6 % wide.

use std::time::Duration;

/// Buckets of an octave.
const FINE: u64 = 64;
/// Octaves of nanoseconds: up to about 18 minutes.
const OCTAVES: u64 = 40;

/// Times of the frame loop, from a frame's arrival to the end of its step.
#[derive(Clone, Debug)]
pub struct LoopTimes {
    counts: Vec<u64>,
    count: u64,
    least: Duration,
    most: Duration,
}

impl Default for LoopTimes {
    fn default() -> Self {
        let buckets = (FINE * OCTAVES) as usize;
        Self { counts: vec![0; buckets], count: 0, least: Duration::MAX, most: Duration::ZERO }
    }
}

/// Below 64 ns a bucket a nanosecond, above 64 of equal width an octave.
fn bucket(ns: u64) -> u64 {
    match ns.checked_ilog2() {
        Some(octave) if octave >= 6 => u64::from(octave - 5) * FINE + (ns >> (octave - 6)) - FINE,
        _ => ns,
    }
}

/// The middle of a bucket, ns.
fn middle(bucket: u64) -> u64 {
    if bucket < FINE {
        return bucket;
    }
    let shift = bucket / FINE - 1;
    ((bucket % FINE + FINE) << shift) + (1 << shift) / 2
}

impl LoopTimes {
    /// Notes one time.
    pub fn note(&mut self, time: Duration) {
        let ns = u64::try_from(time.as_nanos()).unwrap_or(u64::MAX);
        let last = self.counts.len() - 1;
        if let Some(count) = self.counts.get_mut((bucket(ns) as usize).min(last)) {
            *count += 1;
        }
        self.count += 1;
        self.least = self.least.min(time);
        self.most = self.most.max(time);
    }

    /// Times noted.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// The time that `share` (0 to 1) of all are not above, to 0.8 %; zero where none was noted.
    pub fn quantile(&self, share: f64) -> Duration {
        if self.count == 0 {
            return Duration::ZERO;
        }
        let rank = ((self.count as f64 * share).ceil() as u64).clamp(1, self.count);
        let mut below = 0;
        for (bucket, count) in (0..).zip(&self.counts) {
            below += count;
            if below >= rank {
                return Duration::from_nanos(middle(bucket)).clamp(self.least, self.most);
            }
        }
        self.most
    }

    /// The median, to 0.8 %.
    pub fn median(&self) -> Duration {
        self.quantile(0.5)
    }

    /// The shortest; zero where none was noted.
    pub fn least(&self) -> Duration {
        if self.count == 0 { Duration::ZERO } else { self.least }
    }

    /// The longest.
    pub fn most(&self) -> Duration {
        self.most
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn buckets_follow_one_another_without_gap() {
        let mut last = 0;
        for ns in 1..100_000 {
            let next = bucket(ns);
            assert!(next == last || next == last + 1, "{ns}");
            last = next;
        }
        // A bucket is 1/64 of an octave: its middle is at most 1/128 of its start away.
        for ns in [64, 1_000, 123_456, 7_654_321, 9_999_999_999] {
            assert!(middle(bucket(ns)).abs_diff(ns) * 128 <= ns, "{ns}");
        }
    }

    #[test]
    fn the_median_is_right_to_a_bucket_and_the_extremes_exactly() {
        let mut times = LoopTimes::default();
        assert_eq!((times.median(), times.least()), (Duration::ZERO, Duration::ZERO));
        for ms in [5, 1, 4, 2, 3] {
            times.note(Duration::from_millis(ms));
        }
        // Half a bucket: 1/128.
        assert!(times.median().abs_diff(Duration::from_millis(3)) < Duration::from_millis(3) / 128);
        assert_eq!(times.least(), Duration::from_millis(1));
        assert_eq!(times.most(), Duration::from_millis(5));
        assert_eq!(times.quantile(1.0), Duration::from_millis(5));
        times.note(Duration::from_secs(1_000_000));
        assert_eq!(times.count(), 6);
    }
}
