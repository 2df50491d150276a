//! The blurred edge that ring and profile are made of: the step seen through a lens and through pixels, which
//! are nearly Gaussian together. Both its parts are polynomials that end.

/// Half width of an edge in standard deviations of its blur. Chosen with [`edge`]'s coefficients for the
/// least distance from a Gaussian with a little of a square pixel in it (excess kurtosis -0.1): 0.001 of the
/// step, root mean square.
pub(crate) const HALF_WIDTH: f64 = 2.7;

/// Steepness of an edge over [`edge`]'s weight, for an edge of height 1 and half width 1: the least squares
/// factor.
pub(crate) const PEAK: f64 = 1.0518;

/// Integrals of (1 - z^2)^6 and (1 - z^2)^12 over -1..1: of the squared weight and of its fourth power.
pub(crate) const SQUARE: f64 = 2048.0 / 3003.0;
pub(crate) const FOURTH: f64 = 8_388_608.0 / 16_900_975.0;

/// How much a pixel at `z` half widths from an edge counts (1 at most), and the edge's height there, from
/// -1/2 to 1/2.
///
/// The weight is (1 - z^2)^3: as good as the edge's own steepness to three thousandths of the information.
#[inline(always)]
pub(crate) fn edge(z: f32) -> (f32, f32) {
    // Written out: `clamp` keeps a NaN and so would not become two instructions.
    let z = if z > -1.0 { z } else { -1.0 };
    let z = if z < 1.0 { z } else { 1.0 };
    let square = z * z;
    let rest = 1.0 - square;
    let height = z * (1.052_91 - square * (1.101_05 - square * (0.771_57 - 0.223_43 * square)));
    (rest * rest * rest, height)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Steps of a Gaussian's integral over six standard deviations either way.
    const STEPS: i32 = 4800;

    /// (x, density, integral from the middle) of a Gaussian of standard deviation 1.
    fn gaussian() -> impl Iterator<Item = (f64, f64, f64)> {
        let step = 12.0 / f64::from(STEPS);
        let density = |x: f64| (-0.5 * x * x).exp() / core::f64::consts::TAU.sqrt();
        let mut integral = -0.5;
        (0..STEPS).map(move |i| {
            let x = step * (f64::from(i) + 0.5) - 6.0;
            integral += density(x) * step;
            (x, density(x), integral - 0.5 * density(x) * step)
        })
    }

    #[test]
    fn the_edge_is_nearly_gaussian() {
        for (x, _, integral) in gaussian() {
            let (_, height) = edge((x / HALF_WIDTH) as f32);
            // Where the polynomial ends, and with the pixel's share.
            assert!((f64::from(height) - integral).abs() < 4e-3, "{x}: {height} {integral}");
        }
        assert_eq!((edge(-7.0), edge(7.0).0), ((0.0, -edge(7.0).1), 0.0));
        assert!((edge(7.0).1 - 0.5).abs() < 1e-6);
    }

    #[test]
    fn the_weight_is_nearly_the_steepness() {
        let mut sums = [0.0; 3];
        for (x, density, _) in gaussian() {
            let weight = f64::from(edge((x / HALF_WIDTH) as f32).0);
            for (sum, term) in sums.iter_mut().zip([weight * density, weight * weight, density * density]) {
                *sum += term;
            }
        }
        let [both, weight, density] = sums;
        assert!(both * both / (weight * density) > 0.997);
        // Within the share of the pixel.
        assert!((HALF_WIDTH * both / weight / PEAK - 1.0).abs() < 5e-3, "{}", HALF_WIDTH * both / weight);
    }

    #[test]
    fn the_powers_of_the_weight_are_integrated() {
        let z = |i: i32| (f64::from(i) + 0.5) / f64::from(STEPS) * 2.0 - 1.0;
        let mean = |power: i32| {
            let sum: f64 = (0..STEPS).map(|i| f64::from(edge(z(i) as f32).0).powi(power)).sum();
            2.0 * sum / f64::from(STEPS)
        };
        assert!((mean(2) - SQUARE).abs() < 1e-6 && (mean(4) - FOURTH).abs() < 1e-6);
    }
}
