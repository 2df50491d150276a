//! Scenes on disk: what is written, and what a scene file may not say.

use std::fs;
use std::ops::ControlFlow;
use std::path::Path;

use gangway_scene::{BUILTIN, Format, Scene};

/// A built-in scene, cut to a small picture so that it is quick: `more` is added before the first target.
fn small(more: &str) -> String {
    format!(
        r#"name = "small"
frames = 3
{more}
[camera]
width_px = 160
height_px = 120
rate_hz = 50.0
focal_px = [400.0, 400.0]
principal_px = [80.0, 60.0]
position_mm = [-2000.0, 0.0, 0.0]
[[target]]
name = "front"
origin_mm = [0.0, 0.0, 0.0]
outer_diameter_mm = 50.0
inner_diameter_mm = 25.0
circles_mm = [[-80.0, 60.0], [80.0, 60.0], [-80.0, -60.0], [80.0, -60.0]]
"#
    )
}

fn message(text: &str) -> String {
    Scene::parse(text, "bad.toml").err().map(|error| error.to_string()).unwrap_or_default()
}

fn names(dir: &Path) -> Vec<String> {
    let mut names: Vec<String> =
        fs::read_dir(dir).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

#[test]
fn every_built_in_scene_writes_a_setup_that_the_box_accepts_with_all_its_circles() {
    for ((name, _), circles) in BUILTIN.iter().zip([28, 19, 7, 7, 7, 28, 7]) {
        let scene = Scene::builtin(name).unwrap();
        let setup = gangway_setup::Setup::parse(&scene.setup_text(), "setup.toml").unwrap();
        let settings = setup.settings();
        assert_eq!(settings.name.as_str(), *name);
        assert_eq!((u32::from(settings.picture.0), u32::from(settings.picture.1)), scene.size());
        assert_eq!(settings.circles.len(), circles);
        let centres = scene.centres(0).concat();
        for (seed, centre) in settings.seeds.iter().zip(centres) {
            let (seed, centre) = (seed.unwrap(), centre.unwrap());
            // Seeds are written to a thousandth of a pixel.
            assert!((seed[0] - centre[0]).abs() < 6e-4 && (seed[1] - centre[1]).abs() < 6e-4);
        }
    }
}

#[test]
fn a_scene_on_disk_is_frames_truth_and_setup_and_nothing_else() {
    let dir = tempfile::tempdir().unwrap();
    let scene = Scene::parse(&small("seed = 3"), "small.toml").unwrap();
    let mut told = Vec::new();
    let written = scene
        .write(&dir.path().join("out"), Format::Y4m, |done| {
            told.push(done);
            ControlFlow::Continue(())
        })
        .unwrap();
    assert_eq!(names(&dir.path().join("out")), ["frames.y4m", "setup.toml", "truth.csv"]);
    assert_eq!(told, [1, 2, 3]);
    let bytes = fs::read(&written.frames).unwrap();
    let header = b"YUV4MPEG2 W160 H120 F50:1 Ip A1:1 Cmono\n";
    assert!(bytes.starts_with(header));
    assert_eq!(bytes.len(), header.len() + 3 * (6 + 160 * 120));
    let mut second = Vec::new();
    scene.render(1, &mut second);
    assert!(bytes[header.len() + 2 * 6 + 160 * 120..].starts_with(&second));
    let truth = fs::read_to_string(&written.truth).unwrap();
    assert_eq!(truth.lines().next(), Some("frame,dx_mm,dy_mm,dz_mm,roll_deg,pitch_deg,yaw_deg"));
    assert_eq!(truth.lines().nth(3), Some("2,0,0,0,0,0,0"));
    assert_eq!(fs::read_to_string(&written.setup).unwrap(), scene.setup_text());
}

#[test]
fn ten_bits_are_announced_in_the_header() {
    let scene = Scene::parse(&(small("") + "[sensor]\nbits = 10\n"), "small.toml").unwrap();
    assert_eq!(scene.y4m_header(), "YUV4MPEG2 W160 H120 F50:1 Ip A1:1 Cmono10\n");
}

#[test]
fn pictures_hold_the_samples() {
    for (bits, shift) in [(8, 0), (10, 6)] {
        let dir = tempfile::tempdir().unwrap();
        let scene = Scene::parse(&(small("") + &format!("[sensor]\nbits = {bits}\n")), "s.toml").unwrap();
        let written = scene.write(dir.path(), Format::Png, |_| ControlFlow::Continue(())).unwrap();
        assert_eq!(names(&written.frames), ["000000.png", "000001.png", "000002.png"]);
        let file = std::io::BufReader::new(fs::File::open(written.frames.join("000002.png")).unwrap());
        let mut reader = png::Decoder::new(file).read_info().unwrap();
        let mut seen = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut seen).unwrap();
        let mut samples = Vec::new();
        scene.render(2, &mut samples);
        if bits == 8 {
            assert!(seen == samples);
        } else {
            let seen = seen.chunks_exact(2).map(|s| u16::from_be_bytes([s[0], s[1]]) >> shift);
            let samples = samples.chunks_exact(2).map(|s| u16::from_le_bytes([s[0], s[1]]));
            assert!(seen.eq(samples));
        }
        // A second run does not mix its pictures with those of the first.
        let again =
            scene.write(dir.path(), Format::Png, |_| ControlFlow::Continue(())).unwrap_err().to_string();
        assert!(
            again.ends_with("frames: is there already; remove it or choose another directory"),
            "{again}"
        );
    }
}

#[test]
fn a_truth_file_moves_a_scene_again() {
    let dir = tempfile::tempdir().unwrap();
    let ride = Scene::builtin("ride").unwrap();
    fs::write(dir.path().join("motion.csv"), ride.truth_text()).unwrap();
    let text = small("").replace("frames = 3\n", "") + "[motion]\nrest_s = 0.0\ncsv = \"motion.csv\"\n";
    let again = Scene::parse(&text, dir.path().join("again.toml").to_str().unwrap()).unwrap();
    assert_eq!(again.frames(), ride.frames());
    for frame in [0, 30, 249] {
        let (a, b) = (ride.truth(frame), again.truth(frame));
        for (a, b) in a.displacement_mm.iter().zip(b.displacement_mm) {
            // Nine digits behind the point.
            assert!((a - b).abs() < 1e-9);
        }
    }
}

#[test]
fn what_cannot_be_written_is_one_sentence_and_leaves_nothing() {
    let dir = tempfile::tempdir().unwrap();
    let scene = Scene::parse(&small(""), "small.toml").unwrap();
    // A file where the directory should be.
    fs::write(dir.path().join("file"), "").unwrap();
    let error =
        scene.write(&dir.path().join("file"), Format::Y4m, |_| ControlFlow::Continue(())).unwrap_err();
    // The program prints an error and the sources behind it: the reason would stand there twice.
    assert!(std::error::Error::source(&error).is_none());
    let error = error.to_string();
    assert!(error.contains("file: cannot be written:") && !error.contains('\n'), "{error}");
    // Something in the way of the last rename.
    fs::create_dir_all(dir.path().join("out/frames.y4m")).unwrap();
    let error = scene
        .write(&dir.path().join("out"), Format::Y4m, |_| ControlFlow::Continue(()))
        .unwrap_err()
        .to_string();
    assert!(error.contains("is there already"), "{error}");
    assert_eq!(names(&dir.path().join("out")), ["frames.y4m"]);
}

#[test]
fn a_mistake_is_one_sentence_with_file_line_key_and_what_is_allowed() {
    let sensor = |line: &str| small("") + "[sensor]\n" + line + "\n";
    let small_target = small("");
    let another = &small_target[small_target.find("[[target]]").unwrap()..];
    let cases = [
        (
            small("").replace("rate_hz = 50.0", "rate_hz = 0"),
            "bad.toml:7: camera.rate_hz: is 0, allowed is 0.1 to 1000 Hz",
        ),
        (
            small("") + "[tolerance]\nprint_mm = -1\n",
            "bad.toml:18: tolerance.print_mm: is -1, allowed is 0 to 10 mm",
        ),
        (
            small("") + "[[motion.stairs]]\ndegree = \"x\"\nsize = 1\nsteps = 0\nstart_s = 1\nevery_s = 1\n",
            "bad.toml:20: motion.stairs[0].steps: is 0, allowed is 1 to 100000",
        ),
        (
            small("").replace("rate_hz = 50.0\n", ""),
            "bad.toml:4: camera.rate_hz: is missing, allowed is 0.1 to 1000 Hz",
        ),
        (
            small("").replace("rate_hz = 50.0", "rate_hz = 50.0\nexposure_ms = 30"),
            "bad.toml:8: camera.exposure_ms: is 30, longer than a frame at 50 Hz; allowed is 0 to 20 ms",
        ),
        (
            small("").replace("inner_diameter_mm = 25.0", "inner_diameter_mm = 60"),
            "bad.toml:15: target[0].inner_diameter_mm: is 60, allowed is less than outer_diameter_mm, 50 mm",
        ),
        (
            small("").replace("[80.0, -60.0]", "[70.0, 60.0]"),
            "bad.toml:16: target[0].circles_mm: circles 1 and 3 overlap, allowed is a distance of more than 50 mm",
        ),
        (small("u = 3"), "bad.toml:3: unknown field `u`, expected one of"),
        (sensor("bits = 7"), "bad.toml:18: sensor.bits: is 7, allowed is 8 to 16 bits"),
        (
            sensor("bits = \"ten\""),
            "bad.toml:18: sensor.bits: invalid type: string \"ten\", expected a number",
        ),
        (
            small("seed = -1"),
            "bad.toml:3: seed: invalid value: integer `-1`, expected a whole number of 0 or more",
        ),
        (sensor("bits = "), "bad.toml:18: "),
        (
            small("") + "sheet_mm = [100, 100]",
            "bad.toml:17: target[0].sheet_mm: does not hold the rings, allowed is at least 210 x 170 mm",
        ),
        (small("") + "v = [0, 1, 0]", "bad.toml:17: target[0].v: is not at a right angle to u"),
        (
            small("") + "[[motion.step]]\ndegree = \"z\"\nsize = 1\nat_s = 0.1",
            "bad.toml:20: motion.step[0].at_s: is 0.1, during rest; allowed is 0.4 s or later",
        ),
        (
            small("") + "[[motion.step]]\ndegree = \"up\"\nsize = 1\nat_s = 0.1",
            "bad.toml:18: motion.step[0].degree: unknown variant `up`, expected one of `x`, `y`, `z`, `roll`, `pitch`, `yaw`",
        ),
        (
            small("") + "[[occluder]]\nsize_px = [5, 5]\npath = [[1, 0, 0], [1, 5, 5]]",
            "bad.toml:19: occluder[0].path: time 1 follows 1, allowed are times that rise",
        ),
        (small("") + "[motion]\ncsv = \"none.csv\"", "bad.toml:18: motion.csv: none.csv cannot be read:"),
        (
            small("").replace("-2000.0", "2000.0"),
            "bad.toml:10: camera.position_mm: 0 circles of targets that show as a whole at rest",
        ),
        (
            small("") + "[[knock]]\nat_s = 1\nturn_deg = [0, 0, 1e300]",
            "bad.toml:19: knock[0].turn_deg: is 1e300, allowed is -45 to 45 degrees",
        ),
        (
            small("") + "[[shake]]\nfrequency_hz = inf\nshift_mm = [1, 0, 0]",
            "bad.toml:18: shake[0].frequency_hz: is inf, allowed is 0 to 500 Hz",
        ),
        (
            small("") + &another.repeat(1000),
            "bad.toml:11: target: 4004 circles over all targets, allowed are at most 64",
        ),
        (
            small("") + "[setup.board]\nlamps = \"alternate\"",
            "bad.toml:17: setup: the setup file it results in would be refused:",
        ),
        (
            small("") + "[setup.limits]\nx_mm = 3",
            "bad.toml:17: setup: the setup file it results in would be refused:",
        ),
    ];
    for (text, start) in cases {
        let message = message(&text);
        assert!(
            message.starts_with(start) && !message.contains('\n'),
            "{message}\nshould start with\n{start}"
        );
    }
    let unknown = Scene::builtin("moon").err().unwrap().to_string();
    assert_eq!(
        unknown,
        "there is no built-in scene `moon`, there are: rig, ride, 1a, 1b, 1c, 2b, 2c; or name a scene file"
    );
}

/// Standard deviation of what moves the first circle, px in u, over many seeds.
fn spread(tolerance: &str) -> f64 {
    let scene =
        |seed| Scene::parse(&(small("") + "[tolerance]\n" + tolerance), "s.toml").unwrap().with_seed(seed);
    let exact = Scene::parse(&small(""), "s.toml").unwrap().centres(0)[0][0].unwrap();
    let moved = |seed| scene(seed).centres(0)[0][0].unwrap()[0] - exact[0];
    (((0..400).map(moved).map(|d| d * d).sum::<f64>()) / 400.0).sqrt()
}

#[test]
fn tolerances_have_the_sizes_that_they_say() {
    // 400 px at 2000 mm: 0.2 px a mm. The first circle is 80 mm to the left and 60 mm up.
    for (tolerance, expected) in [
        ("print_mm = 1.0", 0.2),
        ("print_scale_percent = 1.0", 0.2 * 0.8),
        ("mounting_mm = 1.0", (0.2f64 * 0.2 + 0.008 * 0.008).sqrt()),
        // About w, 60 mm up; about u and v by what the depth changes, which is below a hundredth of it.
        ("mounting_deg = 1.0", 0.2 * 60.0 * 1f64.to_radians()),
        ("focal_percent = 1.0", 0.2 * 0.8),
        ("principal_percent = 0.5", 0.8),
    ] {
        // The standard deviation of 400 numbers is known to 3.5 %; three of those.
        let found = spread(tolerance);
        assert!((found / expected - 1.0).abs() < 0.11, "{tolerance}: {found}, not {expected}");
    }
}

#[test]
fn the_setup_says_what_was_meant_and_only_the_seeds_what_shows() {
    let exact = Scene::parse(&small(""), "s.toml").unwrap();
    let text = small("")
        + "[tolerance]\nprint_mm = 0.5\nmounting_mm = 3.0\nmounting_deg = 1.0\nfocal_percent = 1.0\n";
    let scene = Scene::parse(&text, "s.toml").unwrap();
    let lines = |text: String, seeds: bool| -> Vec<String> {
        text.lines().filter(|line| line.starts_with("seeds_px") == seeds).map(str::to_owned).collect()
    };
    assert_eq!(lines(exact.setup_text(), false), lines(scene.setup_text(), false));
    assert_ne!(lines(exact.setup_text(), true), lines(scene.setup_text(), true));
    let again = Scene::parse(&text, "s.toml").unwrap();
    assert_eq!(again.centres(0), scene.centres(0));
    assert_ne!(again.with_seed(9).centres(0), scene.centres(0));
}

#[test]
fn a_box_can_be_told_of_a_part_of_the_circles() {
    let rig = Scene::builtin("rig").unwrap();
    let text = rig.setup_text_of(&|target, circle| target != 1 && circle < 5);
    let setup = gangway_setup::Setup::parse(&text, "setup.toml").unwrap();
    let settings = setup.settings();
    assert_eq!((settings.circles.len(), settings.seeds.len()), (15, 15));
    // The first of the second target that is left is the rig's third target's.
    let seed = settings.seeds[5].unwrap();
    let centre = rig.centres(0)[2][0].unwrap();
    assert!((seed[0] - centre[0]).abs() < 6e-4 && (seed[1] - centre[1]).abs() < 6e-4);
    assert!(!text.contains("front middle"));
}
