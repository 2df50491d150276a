use super::*;
use crate::length;
use crate::profile::{FARTHEST_PX, FINE, Places};

const RADIAL: Radial = Radial { white: 2000.0, contrast: 1600.0, outer: 12.0, inner: 6.0, blur: 0.7 };

/// The profile of every third row of a ring whose centre is `off` from where it is taken to be, for white that
/// slopes along x and y and is brighter than the profile by a level that grows outwards.
fn profile(off: [f64; 2], slope: [f64; 2], brighter: f64) -> std::boxed::Box<Profile> {
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
            let radius = length(x - off[0], y - off[1]);
            let (_, _, covered) = kernel.at(radius as f32);
            let white = RADIAL.white + slope[0] * x + slope[1] * y;
            let more = brighter * (radius - 12.0).max(0.0);
            values[i] = (white * (1.0 - 0.8 * f64::from(covered)) + more).round() as u16;
        }
        profile.add(&places, &values);
    }
    profile.close();
    profile
}

/// What the sides of such rows say of white with this slope.
fn lean(brighter: f64, slope: [f64; 2]) -> Lean {
    profile([0.0; 2], slope, brighter).lean(&RADIAL, &(13.4..f64::INFINITY), f64::INFINITY)
}

#[test]
fn few_rows_about_a_centre_that_is_off_tell_what_those_about_the_right_one_do() {
    let fit = |profile: &Profile| profile.fit(&RADIAL, 2.0, (14.5, f64::INFINITY), &FINE).unwrap();
    let right = fit(&profile([0.0; 2], [0.0; 2], 0.0));
    let (mut before, mut after) = (0.0, 0.0);
    for off in [[0.1, -0.1], [0.1, 0.1], [-0.15, 0.0], [0.0, 0.15], [0.0, -0.15]] {
        let mut profile = profile(off, [0.0; 2], 0.0);
        // What an offset blurs all around, its half square, is taken out of the blur by who knows the ring.
        let square = |profile: &Profile| {
            let fine = fit(profile).less_blur(0.5 * (off[0] * off[0] + off[1] * off[1]));
            let errors = [fine.outer - right.outer, fine.inner - right.inner, fine.blur - right.blur];
            errors.iter().map(|error| error * error).sum::<f64>()
        };
        before += square(&profile);
        let lean = profile.lean(&RADIAL, &(13.4..f64::INFINITY), f64::INFINITY);
        profile.centre(&RADIAL, lean.step);
        after += square(&profile);
    }
    // A quadrant's few pixels are not spread evenly over its directions: half of the error may stay.
    assert!(after < 0.3 * before, "{before} {after}");
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
