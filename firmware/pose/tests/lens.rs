//! The lens there and back, its derivative, and the angles there and back.

use gangway_pose::{Circle, Lens, LensError, Pose, angles, project_circle, rotation};
use nalgebra::{Matrix3, Vector3};
use proptest::prelude::*;

/// Lenses from tele to wide with distortion of either sign.
fn lens() -> impl Strategy<Value = Lens> {
    let coefficients = (-0.4..0.4, -0.3..0.3, -0.005..0.005, -0.005..0.005, -0.2..0.2);
    (500.0..5000.0, 0.95..1.05, -2.0..2.0, (300.0..2500.0, 200.0..1700.0), coefficients).prop_map(
        |(f, ratio, skew, (cx, cy), (k1, k2, p1, p2, k3))| Lens {
            focal: [f, f * ratio],
            skew,
            principal: [cx, cy],
            distortion: [k1, k2, p1, p2, k3],
        },
    )
}

/// Whether the distortion is invertible all the way from the axis to a point, by its formula and not by the
/// lens' own judgement: the derivative stays positive definite, with room for the two to differ at the very
/// edge.
fn invertible_with_room(lens: &Lens, x: f64, y: f64) -> bool {
    let [k1, k2, p1, p2, k3] = lens.distortion;
    (0..=400).map(|step| f64::from(step) / 400.0).all(|share| {
        let (x, y) = (share * x, share * y);
        let r2 = x * x + y * y;
        let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
        let slope = 2.0 * (k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3));
        let xx = radial + x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x;
        let yy = radial + y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x;
        let xy = x * y * slope + 2.0 * (p1 * x + p2 * y);
        xx > 0.02 && yy > 0.02 && xx * yy - xy * xy > 0.02
    })
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(2000) })]

    #[test]
    fn a_pixel_comes_back_from_its_ray(lens in lens(), x in -1.2..1.2_f64, y in -0.9..0.9_f64) {
        match lens.project(&Vector3::new(1000.0 * x, 1000.0 * y, 1000.0)) {
            Ok(pixel) => {
                let [rx, ry] = lens.pixel_to_ray(pixel).expect("what is seen has a ray");
                let [u, v] = lens.project(&Vector3::new(rx, ry, 1.0)).expect("a ray has a pixel");
                prop_assert!((u - pixel[0]).abs() < 1e-9 && (v - pixel[1]).abs() < 1e-9);
                // And it is the ray that it came from, not another one with the same pixel: near the edge of
                // the invertible part a rounding of the pixel is many roundings of the ray.
                prop_assert!((rx - x).abs() < 1e-6 && (ry - y).abs() < 1e-6, "{} {} from {} {}", rx, ry, x, y);
            }
            Err(error) => {
                prop_assert_eq!(error, LensError::NotInvertible);
                prop_assert!(!invertible_with_room(&lens, x, y), "the way from the axis to {} {} is open", x, y);
            }
        }
    }

    #[test]
    fn the_derivative_is_that_of_the_projection(lens in lens(), x in -0.6..0.6_f64, y in -0.4..0.4_f64, z in 800.0..6000.0_f64) {
        let point = Vector3::new(x * z, y * z, z);
        let Ok((_, jacobian)) = lens.project_with_jacobian(&point) else { return Ok(()) };
        for axis in 0..3 {
            let mut step = Vector3::zeros();
            step[axis] = 1e-3 * z;
            let (Ok(a), Ok(b)) = (lens.project(&(point - step)), lens.project(&(point + step))) else { return Ok(()) };
            for row in 0..2 {
                let difference = (b[row] - a[row]) / (2e-3 * z);
                // The third derivative times a step of a thousandth, squared.
                let tolerance = 2e-5 * lens.focal[row] / z;
                prop_assert!((jacobian[(row, axis)] - difference).abs() < tolerance);
            }
        }
    }

    #[test]
    fn angles_come_back_from_their_rotation(roll in -3.1..3.1_f64, pitch in -1.5..1.5_f64, yaw in -3.1..3.1_f64) {
        let [r, p, y] = angles(&rotation(roll, pitch, yaw));
        // Near 90 degrees of pitch (1.5 is 86) the other two lose one digit.
        prop_assert!((r - roll).abs() < 1e-13 && (p - pitch).abs() < 1e-13 && (y - yaw).abs() < 1e-13);
    }

    #[test]
    fn a_quaternion_is_its_rotation(roll in -3.1..3.1_f64, pitch in -1.5..1.5_f64, yaw in -3.1..3.1_f64) {
        let pose = Pose { rotation: rotation(roll, pitch, yaw), translation: Vector3::new(1.0, 2.0, 3.0) };
        let quaternion = pose.quaternion();
        let back = Pose::from_quaternion(quaternion, pose.translation);
        prop_assert!(quaternion[0] >= 0.0);
        prop_assert!((back.rotation - pose.rotation).abs().max() < 1e-14);
    }

    /// The disc is taken apart into many points, each projected by itself.
    #[test]
    fn the_shape_and_bias_of_a_disc_are_those_of_its_points(
        x in -500.0..500.0, y in -250.0..250.0, z in 1200.0..2500.0, tilt in -0.6..0.6, turn in -0.6..0.6,
    ) {
        let lens = Lens {
            focal: [1471.3, 1470.1], skew: 0.4, principal: [953.2, 546.8],
            distortion: [-0.071, 0.043, 0.0004, -0.0003, 0.0],
        };
        let pose = Pose { rotation: Matrix3::identity(), translation: Vector3::new(x, y, z) };
        let turned = rotation(tilt, turn, 0.0);
        let circle = Circle {
            point: Vector3::zeros(), normal: -turned.column(2).into_owned(), outer_mm: 42.0, inner_mm: 21.0, target: 0,
        };
        let found = project_circle(&circle, &pose, &lens).expect("the circle is in sight");
        let (mut sum, mut squares, mut count) = ([0.0; 2], [0.0; 3], 0.0);
        // Rings of equal area, each at its middle: exact for the second moments.
        for ring in 0..16 {
            for step in 0..32 {
                let radius = ((f64::from(ring) + 0.5) / 16.0).sqrt();
                let (sine, cosine) = (f64::from(step) * std::f64::consts::TAU / 32.0).sin_cos();
                let (a, b) = (radius * cosine, radius * sine);
                let point = turned * Vector3::new(21.0 * a, 21.0 * b, 0.0) + pose.translation;
                let (at, jacobian) = lens.project_with_jacobian(&point).expect("the disc is in sight");
                // Pixels, not millimetres, are what a centroid counts.
                let plane = jacobian * turned.fixed_columns::<2>(0);
                let area = plane.determinant().abs();
                let (u, v) = (at[0] - found.centre[0], at[1] - found.centre[1]);
                sum = [sum[0] + area * u, sum[1] + area * v];
                squares = [squares[0] + area * u * u, squares[1] + area * u * v, squares[2] + area * v * v];
                count += area;
            }
        }
        for (bias, sum) in found.bias.iter().zip(sum) {
            let off = bias - sum / count;
            // A thirtieth of the 0.003 px that a centre may be biased by.
            prop_assert!(off.abs() < 1e-4, "bias {} px off", off);
        }
        for (shape, squares) in found.shape.iter().zip(squares) {
            // What perspective adds within the disc; moments are about the projected centre in both.
            prop_assert!((shape - squares / count).abs() < 0.003 * (found.shape[0] + found.shape[2]));
        }
    }
}

#[test]
fn a_pixel_comes_back_even_if_the_search_begins_where_the_lens_is_nearly_singular() {
    // Taken for a ray, the distorted point has a derivative with a determinant of 0.0002.
    let distortion = [0.37697, -0.18627, -0.00399, -0.00466, -0.10083];
    let lens = Lens { focal: [500.0, 475.0], skew: 0.0, principal: [300.0, 200.0], distortion };
    let [x, y] = [-0.360_47, -0.882_65];
    let pixel = lens.project(&Vector3::new(x, y, 1.0)).expect("the way from the axis is open");
    let [rx, ry] = lens.pixel_to_ray(pixel).expect("what is seen has a ray");
    assert!((rx - x).abs() < 1e-9 && (ry - y).abs() < 1e-9, "{rx} {ry}");
}

#[test]
fn a_way_from_the_axis_that_is_all_but_closed_is_not_open() {
    // Between two points at which the derivative is looked at, its determinant is negative.
    let distortion = [-0.087_446_42, -0.281_243_77, 0.001_626_64, -0.000_152_41, 0.111_282_96];
    let lens = Lens { focal: [500.0, 475.0], skew: 0.0, principal: [300.0, 200.0], distortion };
    let point = Vector3::new(-1.073_266_364_026_850_3, 0.413_047_792_181_079_9, 1.0);
    assert_eq!(lens.project(&point), Err(LensError::NotInvertible));
}
