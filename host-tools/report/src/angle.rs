//! Differences of angles, the short way round.

/// `measured - truth` in degrees, from -180 (excluded) to 180.
pub(crate) fn difference_deg(measured: f64, truth: f64) -> f64 {
    let turned = (measured - truth).rem_euclid(360.0);
    // Small differences are kept to the last bit: the remainder would round them.
    if (measured - truth).abs() <= 180.0 {
        measured - truth
    } else if turned > 180.0 {
        turned - 360.0
    } else {
        turned
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turn_past_the_half_circle_is_a_small_difference() {
        assert_eq!(difference_deg(179.5, -179.5), -1.0);
        assert_eq!(difference_deg(-179.5, 179.5), 1.0);
        assert_eq!(difference_deg(1.0, 3.5), -2.5);
    }
}
