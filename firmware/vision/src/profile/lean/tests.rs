use super::*;
use crate::length;
use crate::profile::{FARTHEST_PX, Places};

const RADIAL: Radial = Radial { white: 2000.0, contrast: 1600.0, outer: 12.0, inner: 6.0, blur: 0.7 };

/// What the sides of every third row say of white that is brighter than the profile by a level that grows
/// outwards, and that slopes along x and y.
fn lean(brighter: f64, slope: [f64; 2]) -> Lean {
    let kernel = Kernel::new(&RADIAL);
    let mut profile = std::boxed::Box::new(Profile::new());
    profile.clear(16.0);
    for y in (-15..=16).step_by(3) {
        let mut places = Places::new();
        let mut values = [0; BLOCK];
        for (i, x) in (-15..=16).enumerate() {
            let (x, y) = (f64::from(x) - 0.2, f64::from(y) - 0.4);
            let radius = length(x, y);
            places.x[i] = (x / radius) as f32;
            places.y[i] = (y / radius) as f32;
            places.radius[i] = if radius < 16.0 { radius as f32 } else { FARTHEST_PX };
            let (_, _, covered) = kernel.at(radius as f32);
            let white = 2000.0 + slope[0] * x + slope[1] * y;
            let more = brighter * (radius - 12.0).max(0.0);
            values[i] = (white * (1.0 - 0.8 * f64::from(covered)) + more).round() as u16;
        }
        profile.add(&places, &values);
    }
    profile.close();
    profile.lean(&RADIAL, 13.4, f64::INFINITY)
}

#[test]
fn white_that_the_profile_does_not_explain_leans_to_no_side() {
    // As much as the white of a sheet changes over a ring under light that is uneven by a tenth.
    let [x, y] = lean(20.0, [0.0; 2]).white_slope;
    assert!(x.abs() < 0.1 && y.abs() < 0.1, "{x} {y}");
}

#[test]
fn few_rows_tell_the_slope_of_the_white_along_either_axis() {
    for slope in [[3.0, 0.0], [0.0, 3.0], [-2.0, 2.0]] {
        let [x, y] = lean(20.0, slope).white_slope;
        // A quadrant's pixels are not spread evenly over its directions.
        assert!((x - slope[0]).abs() < 0.3 && (y - slope[1]).abs() < 0.3, "{slope:?}: {x} {y}");
    }
}
