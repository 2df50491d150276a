//! What a rendered picture must show, against what was told: places, signs, light, noise, what covers what.

use gangway_scene::Scene;

/// A small scene: four frontal rings 2 m before a camera without distortion; `more` is
/// added to the file, and `sensor` to its sensor.
fn scene(sensor: &str, more: &str) -> Scene {
    let text = format!(
        r#"
        name = "small"
        frames = 60
        seed = 11
        [camera]
        width_px = 320
        height_px = 240
        rate_hz = 50.0
        focal_px = [800.0, 800.0]
        principal_px = [160.3, 119.8]
        position_mm = [-2000.0, 0.0, 0.0]
        [sensor]
        {sensor}
        [background]
        level = 0.3
        texture = 0.0
        shapes = 0
        [[target]]
        name = "front"
        origin_mm = [0.0, 1.3, -0.7]
        outer_diameter_mm = 50.0
        inner_diameter_mm = 25.0
        circles_mm = [[-80.0, 60.0], [80.0, 60.0], [-80.0, -60.0], [80.0, -60.0]]
        {more}
        "#
    );
    Scene::parse(&text, "small.toml").unwrap()
}

/// A term of 10 mm or 1 degree from the start on.
fn step(degree: &str, size: f64) -> String {
    format!("[motion]\nrest_s = 0.1\n[[motion.step]]\ndegree = \"{degree}\"\nsize = {size}\nat_s = 0.1\n")
}

/// Centroid of what is darker than `paper` within `reach` px of a place.
fn dark_centroid(shares: &[f32], width: usize, at: [f64; 2], reach: f64, paper: f64) -> [f64; 2] {
    let (mut sum, mut u, mut v) = (0.0, 0.0, 0.0);
    for (i, share) in shares.iter().enumerate() {
        let (x, y) = ((i % width) as f64, (i / width) as f64);
        if (x - at[0]).hypot(y - at[1]) <= reach {
            let weight = paper - f64::from(*share);
            sum += weight;
            u += weight * x;
            v += weight * y;
        }
    }
    [u / sum, v / sum]
}

#[test]
fn a_frontal_ring_is_where_its_centre_projects_to() {
    // Sharp edges alias on the pixels, even from exact areas; a lens' blur leaves a third of that.
    for (blur, allowed) in [(0.0, 0.001), (0.4, 0.0004), (0.7, 0.0004)] {
        let scene = scene(&format!("blur_px = {blur}\nblack_level = 0.0"), "[light]\nlevel = 1.0");
        let mut shares = Vec::new();
        scene.render_ideal(0, &mut shares);
        let centres = scene.centres(0);
        // By hand: u = 160.3 - 800 (1.3 + 80) / 2000, v = 119.8 - 800 (-0.7 + 60) / 2000.
        let first = centres[0][0].unwrap();
        assert!((first[0] - 127.78).abs() < 1e-9 && (first[1] - 96.08).abs() < 1e-9, "{first:?}");
        for centre in centres[0].iter().map(|centre| centre.unwrap()) {
            // Ring of 10 px radius; the next is 48 px away, the sheet's edge 20 px.
            let seen = dark_centroid(&shares, 320, centre, 17.0, 0.85);
            let error = (seen[0] - centre[0]).hypot(seen[1] - centre[1]);
            assert!(error < allowed, "{error} with blur {blur}");
        }
    }
}

#[test]
fn a_ring_has_the_area_that_it_has_on_paper() {
    let scene = scene("blur_px = 0.0\nblack_level = 0.0", "[light]\nlevel = 1.0");
    let mut shares = Vec::new();
    scene.render_ideal(0, &mut shares);
    let centre = scene.centres(0)[0][0].unwrap();
    let near = |i: usize| ((i % 320) as f64 - centre[0]).hypot((i / 320) as f64 - centre[1]) <= 17.0;
    let dark: f64 = (0..shares.len()).filter(|i| near(*i)).map(|i| 0.85 - f64::from(shares[i])).sum();
    // Ink of reflectance 0.06 between radii of 10 and 5 px; the share of a tangent in 1/4 px cells: 1e-4.
    let area = std::f64::consts::PI * (100.0 - 25.0);
    assert!((dark / (0.85 - 0.06) / area - 1.0).abs() < 3e-4, "{}", dark / (0.85 - 0.06) / area);
}

#[test]
fn nothing_has_moved_at_rest() {
    for scene in [Scene::builtin("rig").unwrap(), Scene::builtin("ride").unwrap()] {
        for frame in 0..20 {
            let truth = scene.truth(frame);
            assert_eq!((truth.displacement_mm, truth.rotation_deg), ([0.0; 3], [0.0; 3]));
            assert_eq!(scene.centres(frame), scene.centres(0));
        }
        assert_ne!(scene.centres(30), scene.centres(0));
    }
}

/// Mean place of all centres after a step, less that before, px; and the truth.
fn shift(degree: &str, size: f64) -> ([f64; 2], [f64; 6]) {
    let scene = scene("", &step(degree, size));
    let mean = |frame| {
        let centres: Vec<[f64; 2]> = scene.centres(frame).concat().into_iter().flatten().collect();
        [0, 1].map(|axis| centres.iter().map(|c| c[axis]).sum::<f64>() / centres.len() as f64)
    };
    let (before, after) = (mean(0), mean(20));
    let truth = scene.truth(20);
    let [x, y, z] = truth.displacement_mm;
    let [roll, pitch, yaw] = truth.rotation_deg;
    ([after[0] - before[0], after[1] - before[1]], [x, y, z, roll, pitch, yaw])
}

#[test]
fn a_positive_y_displacement_moves_the_targets_to_the_left() {
    let ([u, v], truth) = shift("y", 10.0);
    assert!((u + 4.0).abs() < 1e-9 && v.abs() < 1e-9, "{u} {v}");
    assert_eq!(truth, [0.0, 10.0, 0.0, 0.0, 0.0, 0.0]);
}

#[test]
fn a_positive_z_displacement_moves_the_targets_up() {
    let ([u, v], truth) = shift("z", 10.0);
    assert!(u.abs() < 1e-9 && (v + 4.0).abs() < 1e-9, "{u} {v}");
    assert_eq!(truth, [0.0, 0.0, 10.0, 0.0, 0.0, 0.0]);
}

#[test]
fn a_positive_x_displacement_moves_the_targets_away() {
    let scene = scene("", &step("x", 500.0));
    let spread = |frame| {
        let centres = scene.centres(frame).concat();
        centres[1].unwrap()[0] - centres[0].unwrap()[0]
    };
    // 160 mm at 2 m and at 2.5 m.
    assert!((spread(0) - 64.0).abs() < 1e-9);
    assert!((spread(20) - 51.2).abs() < 1e-9);
}

/// The same scene with its target 1 m ahead of CB_02's origin and the camera as far before it.
fn ahead(degree: &str) -> [f64; 2] {
    let text = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/ride.toml")).unwrap();
    let camera_and_target = text.split("[motion]").next().unwrap();
    let scene = Scene::parse(&format!("{camera_and_target}\n{}", step(degree, 1.0)), "ahead.toml").unwrap();
    // The target `top` lies ahead of the origin by 380 mm and above it by 580 mm.
    let at = |frame: u32| scene.centres(frame)[0][2].unwrap();
    let (before, after) = (at(0), at(20));
    [after[0] - before[0], after[1] - before[1]]
}

#[test]
fn a_positive_yaw_turns_what_is_ahead_to_the_left() {
    let [u, _] = ahead("yaw");
    // 380 mm times 1 degree = 6.6 mm at 2 m and 1470 px: about 4.9 px.
    assert!(u < -4.0 && u > -6.0, "{u}");
}

#[test]
fn a_positive_pitch_lowers_what_is_ahead() {
    let [_, v] = ahead("pitch");
    assert!(v > 3.0, "{v}");
}

#[test]
fn a_positive_roll_moves_what_is_above_to_the_right() {
    let [u, _] = ahead("roll");
    // About x forward by the right hand: z turns to -y, which is right. 580 mm times 1 degree: about 7.4 px.
    assert!(u > 6.0 && u < 9.0, "{u}");
}

#[test]
fn the_picture_is_the_same_on_any_number_of_threads() {
    let render = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let scene = Scene::builtin("ride").unwrap();
        let mut samples = Vec::new();
        pool.install(|| scene.render(57, &mut samples));
        samples
    };
    let one = render(1);
    assert!(one == render(3));
    let mut other = Vec::new();
    Scene::builtin("ride").unwrap().with_seed(99).render(57, &mut other);
    assert!(one != other);
}

#[test]
fn light_scales_the_picture() {
    let shares = |level: f64| {
        let scene = scene("black_level = 0.0", &format!("[light]\nlevel = {level}"));
        let mut shares = Vec::new();
        scene.render_ideal(0, &mut shares);
        shares
    };
    let (full, third) = (shares(0.9), shares(0.3));
    // f32.
    assert!(full.iter().zip(&third).all(|(full, third)| (third / full - 1.0 / 3.0).abs() < 1e-5));
    assert!((full[0] - 0.27).abs() < 1e-6, "background of 0.3 under a light of 0.9: {}", full[0]);
}

#[test]
fn a_rendered_frame_has_the_noise_that_was_set() {
    let more = "[light]\nlevel = 1.0";
    let noisy = scene(
        "black_level = 0.0\nbits = 16\nfull_well_e = 10000\nread_noise_e = 30.0\nshot_noise = true",
        more,
    );
    let (mut samples, mut ideal) = (Vec::new(), Vec::new());
    noisy.render(3, &mut samples);
    noisy.render_ideal(3, &mut ideal);
    let shares: Vec<f64> =
        samples.chunks_exact(2).map(|s| f64::from(u16::from_le_bytes([s[0], s[1]])) / 65535.0).collect();
    // Background of 0.3: 3000 photo-electrons and a read noise of 30.
    let deviations: Vec<f64> = shares
        .iter()
        .zip(&ideal)
        .filter(|(_, ideal)| (**ideal - 0.3).abs() < 1e-6)
        .map(|(share, ideal)| share - f64::from(*ideal))
        .collect();
    let n = deviations.len() as f64;
    let mean = deviations.iter().sum::<f64>() / n;
    let variance = deviations.iter().map(|d| d * d).sum::<f64>() / n;
    let told = (3000.0 + 900.0) / 1e8;
    assert!(n > 40_000.0);
    // Four standard errors each.
    assert!(mean.abs() < 4.0 * (told / n).sqrt(), "{mean}");
    assert!((variance / told - 1.0).abs() < 4.0 * (2.0 / n).sqrt(), "{}", variance / told);
}

#[test]
fn a_post_covers_what_is_behind_it_and_then_is_gone() {
    let post = "[[post]]\nwidth_px = 80.0\nenters_s = 0.0\nleaves_s = 0.8\nto = \"right\"\nlevel = 0.2";
    let scene = scene("black_level = 0.0\nblur_px = 0.0", &format!("[light]\nlevel = 1.0\n{post}"));
    let mut shares = Vec::new();
    // Its middle goes from -40.5 to 359.5 in 0.8 s: at frame 20 it is at 159.5.
    scene.render_ideal(20, &mut shares);
    for row in [0, 119, 239] {
        let line = &shares[row * 320..(row + 1) * 320];
        assert!(line[121..199].iter().all(|share| (share - 0.2).abs() < 1e-6));
        assert!(line[117] > 0.25 && line[202] > 0.25);
    }
    let (mut free, mut after) = (Vec::new(), Vec::new());
    scene.render_ideal(0, &mut free);
    scene.render_ideal(41, &mut after);
    assert!(free == after);
}

#[test]
fn motion_during_the_exposure_blurs_along_the_motion_and_keeps_the_centre() {
    let ramp =
        "[motion]\nrest_s = 0.0\n[[motion.ramp]]\ndegree = \"y\"\nsize = 1000.0\nstart_s = 0.0\nend_s = 10.0";
    let smeared = |exposure_ms: f64| {
        let text = format!(
            r#"
            name = "m"
            [camera]
            width_px = 320
            height_px = 240
            rate_hz = 50.0
            focal_px = [800.0, 800.0]
            principal_px = [160.3, 119.8]
            position_mm = [-2000.0, 0.0, 0.0]
            exposure_ms = {exposure_ms}
            [sensor]
            blur_px = 0.0
            black_level = 0.0
            [light]
            level = 1.0
            [[target]]
            name = "front"
            origin_mm = [0.0, 0.0, 0.0]
            outer_diameter_mm = 30.0
            inner_diameter_mm = 15.0
            circles_mm = [[-80.0, 60.0], [80.0, 60.0], [-80.0, -60.0], [80.0, -60.0]]
            sheet_mm = [300.0, 200.0]
            {ramp}
            "#
        );
        let scene = Scene::parse(&text, "m.toml").unwrap();
        let mut shares = Vec::new();
        scene.render_ideal(5, &mut shares);
        let centre = scene.centres(5)[0][0].unwrap();
        let seen = dark_centroid(&shares, 320, centre, 11.0, 0.85);
        let width = |axis: usize| {
            let (mut sum, mut square) = (0.0, 0.0);
            for (i, share) in shares.iter().enumerate() {
                let at = [(i % 320) as f64, (i / 320) as f64];
                if (at[0] - centre[0]).hypot(at[1] - centre[1]) <= 11.0 {
                    let weight = 0.85 - f64::from(*share);
                    sum += weight;
                    square += weight * (at[axis] - seen[axis]).powi(2);
                }
            }
            square / sum
        };
        (centre, seen, [width(0), width(1)])
    };
    let (_, _, sharp) = smeared(0.0);
    // 100 mm/s over 20 ms: 2 mm, at 2 m and 800 px: 0.8 px.
    let (centre, seen, wide) = smeared(20.0);
    assert!((seen[0] - centre[0]).hypot(seen[1] - centre[1]) < 0.001, "{centre:?} {seen:?}");
    // A box of 0.8 px adds 0.8^2 / 12 to the variance along the motion; four moments give 15/16 of it.
    let added = wide[0] - sharp[0];
    assert!((added / (0.64 / 12.0 * 15.0 / 16.0) - 1.0).abs() < 0.05, "{added}");
    assert!((wide[1] - sharp[1]).abs() < 0.002);
}

#[test]
fn each_row_of_a_rolling_shutter_shows_its_own_time() {
    let shares = |camera: &str, frame: u32| {
        let text = format!(
            r#"
            name = "rolling"
            [camera]
            width_px = 320
            height_px = 201
            focal_px = [800.0, 800.0]
            principal_px = [160.3, 99.8]
            position_mm = [-2000.0, 0.0, 0.0]
            {camera}
            [sensor]
            blur_px = 0.0
            [[target]]
            name = "front"
            origin_mm = [0.0, 0.0, 0.0]
            outer_diameter_mm = 60.0
            inner_diameter_mm = 30.0
            circles_mm = [[-80.0, 60.0], [80.0, 60.0], [-80.0, -60.0], [80.0, -60.0]]
            [motion]
            rest_s = 0.0
            [[motion.ramp]]
            degree = "y"
            size = 1000.0
            start_s = 0.0
            end_s = 1.0
            "#
        );
        let mut shares = Vec::new();
        Scene::parse(&text, "rolling.toml").unwrap().render_ideal(frame, &mut shares);
        shares
    };
    // Frame 1 at 0.1 s; the rows at 200 us each are five to a frame of 1000 Hz.
    let rolling = shares("rate_hz = 10.0\nline_time_us = 200.0", 1);
    let row = |shares: &[f32], row: usize| shares[row * 320..(row + 1) * 320].to_vec();
    for millisecond in [-16i32, -7, 0, 9, 18] {
        let global = shares("rate_hz = 1000.0", (100 + millisecond) as u32);
        let at = (100 + 5 * millisecond) as usize;
        let (seen, expected) = (row(&rolling, at), row(&global, at));
        let most = seen.iter().zip(&expected).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        // The same but for the rounding of the row's time.
        assert!(most < 1e-5, "row {at}: {most}");
        let middle = row(&shares("rate_hz = 10.0", 1), at);
        assert!(millisecond == 0 || seen != middle || expected == middle, "row {at} is not the frame's");
    }
}

#[test]
fn samples_of_more_than_eight_bits_keep_their_depth() {
    for (bits, greatest) in [(8, 255), (10, 1023), (12, 4095), (16, 65535)] {
        let scene = scene(&format!("bits = {bits}\nblack_level = 0.0"), "[light]\nlevel = 5.0");
        let mut samples = Vec::new();
        scene.render(0, &mut samples);
        let bytes = if bits > 8 { 2 } else { 1 };
        assert_eq!(samples.len(), 320 * 240 * bytes);
        let most = match bytes {
            1 => samples.iter().map(|s| u32::from(*s)).max(),
            _ => samples.chunks_exact(2).map(|s| u32::from(u16::from_le_bytes([s[0], s[1]]))).max(),
        };
        assert_eq!(most, Some(greatest));
    }
}
