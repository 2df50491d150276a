//! Whether circles scatter more than their covariances say: the weighted sum of squares against its own
//! distribution, chi squared (Wilson and Hilferty 1931 for its quantile).

/// Standard normal quantile beyond which a sum of squares is no chance: one in a thousand.
const QUANTILE: f64 = 3.09;

/// The factor by which the centres' variances are too small: `chi2 / (freedom - 2)` where chi2 is
/// significantly above its freedom, else one. The two less make up for the factor being itself an estimate:
/// the mean of the F distribution of 6 and n is n / (n - 2), so that the normalised squared error is 6 in the
/// mean.
///
/// A covariance from the pixels' noise knows nothing of compression, calibration and printing. Where chance
/// alone explains the residuals, nothing is scaled: true covariances stay true.
pub(crate) fn excess(chi2: f64, freedom: f64) -> f64 {
    if is_significant(chi2, freedom) { chi2 / (freedom - 2.0).max(1.0) } else { 1.0 }
}

/// Whether a sum of squares with so many degrees of freedom is larger than chance makes it.
pub(crate) fn is_significant(chi2: f64, freedom: f64) -> bool {
    if freedom <= 0.0 {
        return false;
    }
    let spread = 2.0 / (9.0 * freedom);
    let root = 1.0 - spread + QUANTILE * libm::sqrt(spread);
    chi2 > freedom * root * root * root
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_in_a_thousand_is_beyond_the_quantile() {
        // The 99.9 % points of the tables.
        for (freedom, point) in [(2.0, 13.82), (8.0, 26.12), (24.0, 51.18), (50.0, 86.66)] {
            assert!(
                !is_significant(0.97 * point, freedom) && is_significant(1.03 * point, freedom),
                "{freedom}"
            );
        }
    }

    #[test]
    fn nothing_is_scaled_without_redundancy_or_by_chance() {
        assert_eq!(excess(1e9, 0.0), 1.0);
        assert_eq!(excess(30.0, 24.0), 1.0);
        assert_eq!(excess(88.0, 24.0), 4.0);
    }
}
