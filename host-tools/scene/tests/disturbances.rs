//! Each of what disturbs a ride, alone on a small scene: it does to the picture what its name says, where and
//! when it says, and nothing else.

use gangway_scene::Scene;

const WIDTH: usize = 320;
const HEIGHT: usize = 240;
/// Reflectance of the background.
const LEVEL: f32 = 0.3;

/// Four frontal rings 2 m before a camera without distortion, 20 px across, that never move: at 0.4 px a
/// millimetre. `more` is added to the file.
fn scene(more: &str) -> Scene {
    changed(&[], more)
}

/// The same with further keys in some of its tables.
fn changed(further: &[(&str, &str)], more: &str) -> Scene {
    let mut text = format!(
        r#"
name = "small"
frames = 60
[camera]
width_px = {WIDTH}
height_px = {HEIGHT}
rate_hz = 50.0
focal_px = [800.0, 800.0]
principal_px = [160.0, 120.0]
exposure_ms = 0.1
position_mm = [-2000.0, 0.0, 0.0]
[sensor]
black_level = 0.0
[background]
level = {LEVEL}
texture = 0.0
shapes = 0
[light]
level = 1.0
[[target]]
name = "front"
origin_mm = [0.0, 0.0, 0.0]
outer_diameter_mm = 50.0
inner_diameter_mm = 25.0
circles_mm = [[-80.0, 60.0], [80.0, 60.0], [-80.0, -60.0], [80.0, -60.0]]
{more}
"#
    );
    for (table, keys) in further {
        let header = format!("[{table}]\n");
        assert!(text.contains(&header), "{table} is a table of it");
        text = text.replacen(&header, &format!("{header}{keys}\n"), 1);
    }
    Scene::parse(&text, "small.toml").unwrap()
}

fn shares(scene: &Scene, frame: u32) -> Vec<f32> {
    let mut shares = Vec::new();
    scene.render_ideal(frame, &mut shares);
    shares
}

fn at(shares: &[f32], [u, v]: [usize; 2]) -> f32 {
    shares[v * WIDTH + u]
}

/// Pixels in which two pictures differ by more than rounding.
fn differing(a: &[f32], b: &[f32]) -> Vec<[usize; 2]> {
    let differs = |i: &usize| (a[*i] - b[*i]).abs() > 1e-5;
    (0..a.len()).filter(differs).map(|i| [i % WIDTH, i / WIDTH]).collect()
}

/// The places of all circles, px.
fn places(scene: &Scene, frame: u32) -> Vec<[f64; 2]> {
    scene
        .centres(frame)
        .into_iter()
        .flatten()
        .map(|centre| centre.expect("it is before the camera"))
        .collect()
}

/// Whether a ring of the scene's size shows there: black round about, white in the middle and outside.
fn shows_ring(shares: &[f32], [u, v]: [f64; 2]) -> bool {
    let ring = |radius: f64| {
        let level = |k: usize| {
            let (sin, cos) = (std::f64::consts::TAU * k as f64 / 8.0).sin_cos();
            at(shares, [(u + radius * cos).round() as usize, (v + radius * sin).round() as usize])
        };
        (0..8).map(level).fold([f32::INFINITY, 0.0], |[low, high], level| [low.min(level), high.max(level)])
    };
    // Radii of 5 and 10 px.
    ring(7.5)[1] < 0.2 && ring(0.0)[0] > 0.5 && ring(13.0)[0] > 0.5
}

#[test]
fn a_person_comes_stands_before_the_targets_and_goes() {
    let person = "[[person]]\nwidth_px = 100.0\nheight_px = 220.0\nat_px = 160.0\nenters_s = 0.2\n\
                  stands_s = 0.4\ngoes_s = 0.6\nleaves_s = 0.8\nto = \"right\"\nlevel = 0.1";
    let (free, with) = (scene(""), scene(person));
    for frame in [5, 45] {
        assert!(shares(&free, frame) == shares(&with, frame), "frame {frame}: nobody is there");
    }
    let standing = shares(&with, 25);
    for place in places(&with, 25) {
        // Rings 32 px beside the middle are behind a trunk of half a width of 50 px.
        assert!(!shows_ring(&standing, place) && with.is_covered(25, place, 5.0), "{place:?}");
        assert!(shows_ring(&shares(&free, 25), place) && !free.is_covered(25, place, 5.0), "{place:?}");
    }
    let covered = differing(&standing, &shares(&free, 25));
    assert!(covered.iter().all(|[u, _]| (108..=212).contains(u)), "beside the person nothing changes");
    // Half way in, the middle is half way from beyond the edge to where the person stands.
    let coming = differing(&shares(&with, 15), &shares(&free, 15));
    assert!(!coming.is_empty() && coming.iter().all(|[u, _]| *u < 110), "it comes from the left");
}

#[test]
fn an_occluder_covers_its_rectangle_along_its_path() {
    let occluder =
        "[[occluder]]\nsize_px = [40.0, 30.0]\npath = [[0.2, 100.0, 60.0], [0.6, 180.0, 60.0]]\nlevel = 0.05";
    let (free, with) = (scene(""), scene(occluder));
    // At 0.4 s its middle is at 140.
    let covered = differing(&shares(&with, 20), &shares(&free, 20));
    assert!(covered.iter().all(|[u, v]| (118..=162).contains(u) && (43..=77).contains(v)));
    assert!((at(&shares(&with, 20), [140, 60]) - 0.05).abs() < 1e-5);
    assert!(shares(&with, 35) == shares(&free, 35));
}

#[test]
fn glare_lays_its_light_over_what_is_there_and_clips_it() {
    let glare = "[[glare]]\nradius_px = 15.0\npath = [[0.2, 160.0, 120.0], [0.6, 160.0, 120.0]]\nlevel = 4.0";
    let (free, with) = (scene(""), scene(glare));
    let (before, shining) = (shares(&free, 20), shares(&with, 20));
    let added = at(&shining, [160, 120]) - at(&before, [160, 120]);
    assert!((added - 4.0).abs() < 1e-4, "{added}");
    // Two standard deviations off: exp(-2).
    let added = at(&shining, [190, 120]) - at(&before, [190, 120]);
    assert!((added - 4.0 * (-2.0f32).exp()).abs() < 1e-3, "{added}");
    let mut samples = Vec::new();
    with.render(20, &mut samples);
    assert_eq!(samples[120 * WIDTH + 160], 255);
    assert!(shares(&with, 35) == shares(&free, 35));
}

#[test]
fn a_reflection_is_faint_and_wanders_along_its_path() {
    let reflection =
        "[[glare]]\nradius_px = 8.0\npath = [[0.2, 100.0, 40.0], [0.6, 200.0, 60.0]]\nlevel = 0.4";
    let (free, with) = (scene(""), scene(reflection));
    for (frame, middle) in [(10, [100, 40]), (20, [150, 50]), (30, [200, 60])] {
        let (before, shining) = (shares(&free, frame), shares(&with, frame));
        let added: Vec<f32> = shining.iter().zip(&before).map(|(with, free)| with - free).collect();
        let most = (0..added.len()).max_by(|a, b| added[*a].total_cmp(&added[*b])).unwrap();
        assert_eq!([most % WIDTH, most / WIDTH], middle, "frame {frame}");
        assert!((added[most] - 0.4).abs() < 1e-3, "{}", added[most]);
    }
}

#[test]
fn a_low_sun_saturates_its_part_of_a_target_and_no_more() {
    let sun = "[[sun]]\nsize_px = [60.0, 200.0]\npath = [[0.2, 198.0, 120.0], [0.6, 198.0, 120.0]]\n\
               edge_px = 0.0\nlevel = 1.5";
    let (free, with) = (scene(""), scene(sun));
    let sunny = differing(&shares(&with, 20), &shares(&free, 20));
    // From 168 to 228; the blur of the lens beside that.
    assert!(sunny.iter().all(|[u, v]| (164..=232).contains(u) && (16..=224).contains(v)));
    let mut samples = Vec::new();
    with.render(20, &mut samples);
    let sample = |[u, v]: [f64; 2]| samples[v.round() as usize * WIDTH + u.round() as usize];
    // The white inside the rings on the right is clipped, that of those on the left is not.
    for place in places(&with, 20) {
        assert_eq!(sample(place) == 255, place[0] > 160.0, "{place:?}");
    }
    assert!(shares(&with, 35) == shares(&free, 35));
}

#[test]
fn flicker_changes_the_light_of_frames_and_of_the_rows_of_a_rolling_shutter() {
    // 12.5 Hz is a quarter of a turn a frame.
    let frames = changed(&[("light", "flicker_depth = 0.3\nflicker_hz = 12.5")], "");
    for (frame, expected) in [(0, 1.0), (1, 1.3), (2, 1.0), (3, 0.7)] {
        let level = at(&shares(&frames, frame), [5, 5]) / LEVEL;
        // The exposure of 0.1 ms averages over a two-hundredth of a turn.
        assert!((level - expected).abs() < 2e-3, "frame {frame}: {level}");
    }
    // 100 Hz is two whole turns a frame: all frames are alike; the 240 rows of a rolling shutter take half a
    // turn.
    let flicker = ("light", "flicker_depth = 0.3\nflicker_hz = 100.0");
    let global = changed(&[flicker], "");
    assert!(differing(&shares(&global, 0), &shares(&global, 1)).is_empty(), "a global shutter sees none");
    let rolling = changed(&[flicker, ("camera", "line_time_us = 20.0")], "");
    let picture = shares(&rolling, 3);
    let column: Vec<f32> = (0..HEIGHT).map(|v| at(&picture, [5, v]) / LEVEL).collect();
    let [low, high] = column.iter().fold([f32::INFINITY, 0.0], |[l, h], c| [c.min(l), c.max(h)]);
    assert!(high - low > 0.3, "{low} {high}");
}

#[test]
fn a_fall_of_the_light_to_a_tenth_dims_everything_and_comes_back() {
    let fall = "[[light.fall]]\nstart_s = 0.2\nfall_s = 0.1\nlevel = 0.1\nend_s = 0.6\nrise_s = 0.1";
    let (free, with) = (scene(""), scene(fall));
    let (before, dim) = (shares(&free, 20), shares(&with, 20));
    assert!(before.iter().zip(&dim).all(|(before, dim)| (dim - 0.1 * before).abs() < 1e-5));
    for frame in [9, 36] {
        assert!(shares(&with, frame) == shares(&free, frame), "frame {frame}");
    }
}

#[test]
fn in_darkness_nothing_is_seen() {
    let dark = "[[light.fall]]\nstart_s = 0.2\nfall_s = 0.1\nlevel = 0.0\nend_s = 0.6\nrise_s = 0.1";
    let with = scene(dark);
    assert!(shares(&with, 20).iter().all(|share| *share == 0.0));
    assert!(places(&with, 36).into_iter().all(|place| shows_ring(&shares(&with, 36), place)));
}

#[test]
fn lamps_shine_as_they_are_driven_in_darkness_too() {
    let led = "[[light.fall]]\nstart_s = 0.0\nfall_s = 0.0\nlevel = 0.0\nend_s = 100.0\nrise_s = 0.1\n\
               [[target]]\nname = \"lit\"\nkind = \"led\"\norigin_mm = [-5.0, 0.0, 0.0]\n\
               outer_diameter_mm = 40.0\ncircles_mm = [[-40.0, 0.0], [40.0, 0.0]]\nsheet_mm = [130.0, 50.0]";
    let lit = |drive: &str, frame: u32| {
        let scene = scene(&format!("[lamp]\nlevel = 0.8\ndrive = \"{drive}\"\n{led}"));
        let shares = shares(&scene, frame);
        // The printed circles come first.
        let lamps = &places(&scene, frame)[4..];
        let lit = lamps.iter().filter(|[u, v]| at(&shares, [*u as usize, *v as usize]) > 0.5).count();
        assert_eq!(at(&shares, [5, 5]), 0.0, "what they do not light is dark");
        lit
    };
    for frame in 4..8 {
        assert_eq!(lit("on", frame), 2, "frame {frame}");
        assert_eq!(lit("off", frame), 0, "frame {frame}");
    }
    let alternating: Vec<usize> = (4..8).map(|frame| lit("alternate", frame)).collect();
    assert!(alternating == [2, 0, 2, 0] || alternating == [0, 2, 0, 2], "{alternating:?}");
}

#[test]
fn a_knock_moves_the_picture_once_for_all_and_is_no_motion_of_the_train() {
    let knock = "[[knock]]\nat_s = 0.5\nshift_mm = [0.0, 2.0, 0.0]\nturn_deg = [0.0, 0.0, 0.3]";
    let with = scene(knock);
    let before = places(&with, 24);
    for frame in [30, 50] {
        for (before, after) in before.iter().zip(places(&with, frame)) {
            // 2 mm to the left see the target 0.8 px to the right, and 0.3 degrees to the left 4.19 px.
            assert!((after[0] - before[0] - 0.8 - 4.19).abs() < 0.05, "{before:?} {after:?}");
            assert!((after[1] - before[1]).abs() < 0.05, "{before:?} {after:?}");
            assert!(shows_ring(&shares(&with, frame), after));
        }
        let truth = with.truth(frame);
        assert!(truth.displacement_mm == [0.0; 3] && truth.rotation_deg == [0.0; 3]);
    }
}

#[test]
fn shaking_moves_the_picture_to_and_fro_about_its_place_and_is_no_motion_of_the_train() {
    // A quarter of a turn a frame.
    let with = scene("[[shake]]\nfrequency_hz = 12.5\nstart_s = 0.4\nshift_mm = [0.0, 0.0, 5.0]");
    let still = places(&with, 10)[0];
    // A camera that is 5 mm up sees the target 2 px further down.
    for (frame, expected) in [(19, 0.0), (24, 0.0), (25, 2.0), (26, 0.0), (27, -2.0), (29, 2.0)] {
        let [u, v] = places(&with, frame)[0];
        assert!((v - still[1] - expected).abs() < 0.01 && (u - still[0]).abs() < 0.01, "{frame}: {u} {v}");
        assert!(shows_ring(&shares(&with, frame), [u, v]), "frame {frame}");
    }
    let truth = with.truth(25);
    assert!(truth.displacement_mm == [0.0; 3] && truth.rotation_deg == [0.0; 3]);
}

#[test]
fn identical_targets_look_alike_wherever_they_are() {
    let second = "[[target]]\nname = \"second\"\norigin_mm = [0.0, 250.0, 0.0]\nouter_diameter_mm = 50.0\n\
                  inner_diameter_mm = 25.0\n\
                  circles_mm = [[-80.0, 60.0], [80.0, 60.0], [-80.0, -60.0], [80.0, -60.0]]";
    let with = scene(second);
    let (all, picture) = (places(&with, 0), shares(&with, 0));
    // A carbody's left is the picture's left: 250 mm are exactly 100 px.
    for (first, second) in all[..4].iter().zip(&all[4..]) {
        assert!((first[0] - second[0] - 100.0).abs() < 1e-9 && (first[1] - second[1]).abs() < 1e-9);
        assert!(shows_ring(&picture, *first) && shows_ring(&picture, *second));
    }
    for v in 100..140 {
        for u in 130..190 {
            assert!((at(&picture, [u, v]) - at(&picture, [u - 100, v])).abs() < 1e-5, "{u} {v}");
        }
    }
}

#[test]
fn wheels_and_loudspeakers_are_behind_the_targets_and_move_nothing() {
    for (key, levels) in [("wheels", [0.06, 0.55, 0.12]), ("loudspeakers", [0.08, 0.1, 0.6])] {
        let (free, with) = (scene(""), changed(&[("background", &format!("{key} = 6"))], ""));
        let (plain, cluttered) = (shares(&free, 0), shares(&with, 0));
        let changed = differing(&plain, &cluttered);
        for level in levels {
            // As many pixels as half a disc of 12 px has.
            let count = changed.iter().filter(|place| (at(&cluttered, **place) - level).abs() < 1e-4).count();
            assert!(count > 50, "{key}: {count} pixels of {level}");
        }
        for place in places(&with, 0) {
            assert!(shows_ring(&cluttered, place), "{key} before {place:?}");
        }
        assert!(shares(&with, 7) == cluttered, "{key} stand still");
    }
}

#[test]
fn a_poster_shows_rings_that_are_no_target_of_the_setup() {
    let poster = "[[poster]]\nname = \"poster\"\norigin_mm = [0.0, 250.0, 0.0]\nouter_diameter_mm = 50.0\n\
                  inner_diameter_mm = 25.0\n\
                  circles_mm = [[-80.0, 60.0], [80.0, 60.0], [-80.0, -60.0], [80.0, -60.0]]";
    let (free, with) = (scene(""), scene(poster));
    let picture = shares(&with, 0);
    for [u, v] in places(&free, 0) {
        assert!(shows_ring(&picture, [u, v]) && shows_ring(&picture, [u - 100.0, v]));
        assert!(!shows_ring(&shares(&free, 0), [u - 100.0, v]));
    }
    assert_eq!(places(&with, 0), places(&free, 0));
    assert!(with.setup_text() == free.setup_text(), "the box is not told of it");
}
