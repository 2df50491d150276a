//! The blurred edge that ring and profile are made of: the step seen through the density (1 - z^2)^3 on -1..1, which
//! is nearly Gaussian and ends.

/// Half width of an edge in standard deviations of its blur: the density's variance is 1/9.
pub(crate) const HALF_WIDTH: f64 = 3.0;

/// The density's value at 0 when its integral is 1.
pub(crate) const PEAK: f64 = 35.0 / 32.0;

/// Integrals of (1 - z^2)^6 and (1 - z^2)^12 over -1..1: of the squared density and of its fourth power, peak 1.
pub(crate) const SQUARE: f64 = 2048.0 / 3003.0;
pub(crate) const FOURTH: f64 = 8_388_608.0 / 16_900_975.0;

/// Density (peak 1) and its integral from 0 (total 1) at `z`, which is taken to -1..1.
#[inline(always)]
pub(crate) fn edge(z: f32) -> (f32, f32) {
    // Written out: `clamp` keeps a NaN and so would not become two instructions.
    let z = if z > -1.0 { z } else { -1.0 };
    let z = if z < 1.0 { z } else { 1.0 };
    let square = z * z;
    let rest = 1.0 - square;
    let integral = z * (1.093_75 - square * (1.093_75 - square * (0.656_25 - 0.156_25 * square)));
    (rest * rest * rest, integral)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_edge_is_its_density_summed() {
        let steps = 4000;
        let z = |i: i32| (f64::from(i) + 0.5) / f64::from(steps) * 2.0 - 1.0;
        let (mut sum, mut second, mut square, mut fourth) = (0.0, 0.0, 0.0, 0.0);
        for i in 0..steps {
            let (density, integral) = edge(z(i) as f32);
            let density = f64::from(density);
            sum += PEAK * density * 2.0 / f64::from(steps);
            second += PEAK * density * z(i) * z(i) * 2.0 / f64::from(steps);
            square += density * density * 2.0 / f64::from(steps);
            fourth += density.powi(4) * 2.0 / f64::from(steps);
            // Half a step and rounding.
            assert!((sum - 0.5 - f64::from(integral)).abs() < 4e-4, "{i}");
        }
        assert!((second - HALF_WIDTH.powi(-2)).abs() < 1e-6);
        assert!((square - SQUARE).abs() < 1e-6 && (fourth - FOURTH).abs() < 1e-6, "{square} {fourth}");
        assert_eq!(edge(-7.0), (0.0, -0.5));
        assert_eq!(edge(7.0), (0.0, 0.5));
    }
}
