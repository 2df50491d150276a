//! Whether circles scatter more than their covariances say: the weighted sum of squares against its own
//! distribution, chi squared (Wilson and Hilferty 1931 for its quantile).

/// Standard normal quantile beyond which a sum of squares is no chance: one in a thousand.
const QUANTILE: f64 = 3.09;

/// Odds, beforehand, that the centres scatter more than their covariances say: one in ten pictures. The factor
/// is then equally likely to be in any equal span of its logarithm, up to ten (Jeffreys' prior for a scale).
const ODDS: f64 = 1.0 / 9.0;
const SPAN: f64 = core::f64::consts::LN_10;
/// Terms of a series below this share of its sum are left out; it matters to the odds only.
const LAST_TERM: f64 = 0.01;
/// Odds above this are certainty.
const CERTAIN: f64 = 1e6;

/// The factor by which the centres' variances are too small: its mean after chi2 was seen, which makes the
/// normalised squared error 6 in the mean over all pictures that show this chi2. Where chance alone explains
/// the residuals it is all but one: true covariances stay true. Where it does not, it is
/// `chi2 / (freedom - 2)`. The two less make up for the factor being itself an estimate: the mean of the F
/// distribution of 6 and n is n / (n - 2).
///
/// A covariance from the pixels' noise knows nothing of compression, calibration and printing. How likely
/// chi2 is with a factor f^2 of the variances goes as `f^-n exp(-chi2 / 2 f^2)`. With n = 2 k, x = chi2 / 2, its
/// integral over the prior is, against that of f = 1, `B / (2 ln 10)` with
/// `B = sum_i x^i / (k (k + 1) .. (k + i))`, and that of f^2 times it `(1 + x B) / (k - 1) / (2 ln 10)`.
pub(crate) fn excess(chi2: f64, freedom: f64) -> f64 {
    let (k, x) = (0.5 * freedom, 0.5 * chi2);
    if freedom <= 2.0 {
        // No mean: what is no chance counts as it is.
        return if is_significant(chi2, freedom) { chi2 } else { 1.0 };
    }
    let to_odds = ODDS / (2.0 * SPAN);
    let (mut term, mut sum, mut next) = (1.0 / k, 1.0 / k, k);
    while term > LAST_TERM * sum {
        next += 1.0;
        term *= x / next;
        sum += term;
        if to_odds * sum > CERTAIN {
            return x / (k - 1.0);
        }
    }
    let odds = to_odds * sum;
    let mean = (1.0 + to_odds * (1.0 + x * sum) / (k - 1.0)) / (1.0 + odds);
    mean.max(1.0)
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
    fn the_factor_is_its_mean_over_all_that_it_may_be() {
        // By summing over the logarithm of the factor, far beyond ten, as the closed form does.
        for (chi2, freedom) in
            [(2.0, 4.0), (12.0, 4.0), (25.0, 8.0), (24.0, 24.0), (60.0, 24.0), (90.0, 50.0)]
        {
            let likely = |f: f64| f.powf(-freedom) * (-0.5 * chi2 * (1.0 / (f * f) - 1.0)).exp();
            let step = 1e-3;
            let (mut all, mut squares) = (0.0, 0.0);
            for i in 0..20_000 {
                let f = ((f64::from(i) + 0.5) * step).exp();
                all += step * likely(f);
                squares += step * likely(f) * f * f;
            }
            let weight = ODDS / SPAN;
            let mean = (1.0 + weight * squares) / (1.0 + weight * all);
            // The series ends where a term is a hundredth of it.
            assert!((excess(chi2, freedom) / mean - 1.0).abs() < 0.02, "{chi2} of {freedom}: {mean}");
        }
    }

    #[test]
    fn without_redundancy_nothing_is_scaled_and_by_chance_hardly_anything() {
        assert_eq!(excess(1e9, 0.0), 1.0);
        // Mean odds of 1 : 9 times what 24 degrees of freedom tell: hundredths.
        assert!(excess(24.0, 24.0) < 1.01 && excess(30.0, 24.0) < 1.03);
        assert!((excess(88.0, 24.0) / 4.0 - 1.0).abs() < 0.01);
        assert_eq!(excess(1e9, 24.0), 1e9 / 22.0);
        assert_eq!(excess(f64::NAN, 24.0), 1.0, "and it ends");
    }
}
