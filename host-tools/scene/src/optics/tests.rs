use super::*;

fn lens() -> Lens {
    Lens::new([1000.0, 1100.0], [320.0, 240.0], 2.0, [-0.1, 0.02, 0.001, -0.002, 0.003])
}

#[test]
fn a_point_projects_to_the_pixel_worked_out_by_hand() {
    // x = 0.5, y = -0.25: r2 = 0.3125, radial = 1 - 0.1 r2 + 0.02 r2^2 + 0.003 r2^3 = 0.970794677734375
    // xd = 0.4853973388671875 + 2*0.001*(-0.125) - 0.002*(0.3125 + 0.5) = 0.4835223388671875
    // yd = -0.24269866943359375 + 0.001*(0.3125 + 0.125) + 2*(-0.002)*(-0.125) = -0.24176116943359375
    let [u, v] = lens().project(&[500.0, -250.0, 1000.0]).unwrap();
    assert!((u - (483.522_338_867_187_5 - 0.483_522_338_867_187_5 + 320.0)).abs() < 1e-9, "{u}");
    assert!((v - (-265.937_286_376_953 + 240.0)).abs() < 1e-9, "{v}");
}

#[test]
fn a_ray_and_its_derivative_agree_with_the_projection() {
    let lens = lens();
    let pixel = [500.3, 120.8];
    let ray = lens.ray(pixel, [0.0, 0.0]).unwrap();
    let project = |x: f64, y: f64| lens.project(&[1e3 * x, 1e3 * y, 1e3]).unwrap();
    let [u, v] = project(ray.at[0], ray.at[1]);
    // The step of Newton's method ends below 1e-13, times a focal length of 1e3.
    assert!((u - pixel[0]).abs() < 1e-9 && (v - pixel[1]).abs() < 1e-9);
    // A pixel further right: first order only, curvature of the distortion is below 1e-6 over 0.01 px.
    let next = project(ray.at[0] + 0.01 * ray.per_px[0][0], ray.at[1] + 0.01 * ray.per_px[1][0]);
    assert!((next[0] - u - 0.01).abs() < 1e-6 && (next[1] - v).abs() < 1e-6);
    let below = project(ray.at[0] + 0.01 * ray.per_px[0][1], ray.at[1] + 0.01 * ray.per_px[1][1]);
    assert!((below[0] - u).abs() < 1e-6 && (below[1] - v - 0.01).abs() < 1e-6);
}

#[test]
fn points_behind_the_camera_or_beyond_the_fold_have_no_pixel() {
    assert_eq!(lens().project(&[0.0, 0.0, -5.0]), None);
    // Barrel distortion of -0.5 turns back at r^2 = 1/1.5.
    let barrel = Lens::new([1000.0; 2], [0.0; 2], 0.0, [-0.5, 0.0, 0.0, 0.0, 0.0]);
    assert!(barrel.project(&[0.8, 0.0, 1.0]).is_some());
    assert_eq!(barrel.project(&[0.9, 0.0, 1.0]), None);
    assert_eq!(barrel.ray([900.0, 0.0], [0.0, 0.0]), None);
}

#[test]
fn a_camera_that_looks_straight_ahead_sees_left_on_the_left_and_up_above() {
    let pose = Pose::of_camera(&[-1000.0, 0.0, 0.0], 0.0, 0.0, 0.0);
    assert_eq!(pose.transform(&[0.0, 0.0, 0.0]), [0.0, 0.0, 1000.0]);
    let left_and_up = pose.transform(&[0.0, 100.0, 50.0]);
    assert_eq!(left_and_up, [-100.0, -50.0, 1000.0]);
}

#[test]
fn a_camera_turned_to_the_left_sees_what_was_ahead_on_the_right() {
    let yawed = Pose::of_camera(&[-1000.0, 0.0, 0.0], 0.0, 0.0, 10.0);
    assert!(yawed.transform(&[0.0, 0.0, 0.0])[0] > 100.0);
    // Pitched down: what was ahead is above the middle, y negative.
    let pitched = Pose::of_camera(&[-1000.0, 0.0, 0.0], 0.0, 10.0, 0.0);
    assert!(pitched.transform(&[0.0, 0.0, 0.0])[1] < -100.0);
    // Rolled by a positive angle about x: the camera's left side rises, what is on the left shows further
    // down.
    let rolled = Pose::of_camera(&[-1000.0, 0.0, 0.0], 10.0, 0.0, 0.0);
    assert!(rolled.transform(&[0.0, 100.0, 0.0])[1] > 10.0);
}

#[test]
fn an_inverse_undoes_its_matrix() {
    let m = multiply(&rotation(3.0, -4.0, 20.0), &[[2.0, 0.1, 0.0], [0.0, 1.5, 0.3], [0.2, 0.0, 1.0]]);
    let product = multiply(&m, &inverse(&m).unwrap());
    for (i, row) in product.iter().enumerate() {
        for (j, value) in row.iter().enumerate() {
            // A few rounding errors of f64.
            assert!((value - f64::from(u8::from(i == j))).abs() < 1e-14);
        }
    }
    assert_eq!(inverse(&[[1.0, 2.0, 3.0], [2.0, 4.0, 6.0], [0.0, 1.0, 0.0]]), None);
}
