//! What must hold for every setup: good ones give the settings they say, bad ones a sentence a mistake.

use proptest::prelude::*;

use super::*;

mod mistakes;

const RIDE: &str = include_str!("../examples/ride.toml");

/// What is said about a text.
fn said(text: &str) -> String {
    match Setup::parse(text, "ride.toml") {
        Ok(_) => String::from("good"),
        Err(error) => error.to_string(),
    }
}

/// The example with one piece of it replaced.
fn with(from: &str, to: &str) -> String {
    assert!(RIDE.contains(from), "the example has no {from}");
    RIDE.replacen(from, to, 1)
}

/// The example without the seeds of its targets, but for the first `keep`.
fn seeded(keep: usize) -> Parts {
    let mut parts = Setup::parse(RIDE, "ride.toml").unwrap().parts().clone();
    parts.targets.iter_mut().skip(keep).for_each(|target| target.seeds_px.clear());
    parts
}

#[test]
fn the_example_is_good_and_gives_what_it_says() {
    let setup = Setup::parse(RIDE, "ride.toml").unwrap();
    let settings = setup.settings();
    assert_eq!(settings.name, "ride");
    assert_eq!(settings.picture, (1920, 1080));
    assert_eq!(settings.lens.distortion, [-0.0684, 0.0391, 0.0003, -0.0002, 0.0]);
    assert_eq!((settings.circles.len(), settings.seeds.len()), (19, 19));
    assert_eq!(settings.rest.frames, 25);
    assert_eq!(settings.vision, TrackerSettings::default());
    assert_eq!(settings.text, RIDE);
    // u is -y and v is z by default: the second circle lies to the right, so at negative y.
    let circle = settings.circles[1];
    assert_eq!([circle.point.x, circle.point.y, circle.point.z], [400.0, -60.0, 622.0]);
    assert_eq!([circle.normal.x, circle.normal.y, circle.normal.z], [-1.0, 0.0, 0.0]);
    assert_eq!((circle.outer_mm, circle.inner_mm, circle.target), (42.0, 21.0, 0));
    assert_eq!(settings.circles[18].target, 2);
    assert_eq!(settings.seeds[5], Some([505.3, 518.8]));
}

#[test]
fn what_the_example_shows_as_defaults_are_the_defaults() {
    let key_of = |line: &str| {
        line.strip_prefix("# ").and_then(|said| said.split_once(" = ")).map(|(key, _)| key.to_owned())
    };
    let known = reference();
    let uncommented: Vec<&str> = RIDE
        .lines()
        .map(|line| match key_of(line) {
            Some(key) if known.contains(&format!("| `{key}` |")) => &line[2..],
            _ => line,
        })
        .collect();
    let said = Setup::parse(&uncommented.join("\n"), "ride.toml").unwrap();
    assert_eq!(said.parts(), Setup::parse(RIDE, "ride.toml").unwrap().parts());
    // Left at their defaults: the coarse pose of the camera, which the seeds make needless; carbody, kind, u
    // and v of the second target, carbody and kind of the third.
    assert_eq!(said.table().iter().filter(|row| row.line.is_none()).count(), 4 + 6);
}

#[test]
fn the_digest_is_the_beginning_of_the_texts_sha_256() {
    // The SHA-256 of "abc" as FIPS 180-2 gives it in its appendix B.1.
    assert_eq!(digest("abc")[..4], [0xba, 0x78, 0x16, 0xbf]);
    let setup = Setup::parse(RIDE, "ride.toml").unwrap();
    assert_eq!(setup.settings().digest, digest(RIDE));
}

#[test]
fn axes_are_made_square_after_reading() {
    let settings = Setup::parse(RIDE, "ride.toml").unwrap().settings();
    let [a, b] = [settings.circles[12], settings.circles[13]];
    // Written to five digits, the axis is 4e-6 too short; the distance of 120 mm must not show it.
    assert!(((a.point - b.point).norm() - 120.0).abs() < 1e-12);
    assert!((a.normal.norm() - 1.0).abs() < 1e-15);
}

#[test]
fn a_target_may_go_without_seeds_while_others_have_enough() {
    let settings = Setup::parse(&seeded(1).to_toml(), "ride.toml").unwrap().settings();
    assert_eq!(settings.seeds.iter().flatten().count(), 5);
    assert_eq!(settings.seeds[5], None);
}

#[test]
fn a_setup_without_seeds_is_good_where_a_target_is_known_by_its_circles() {
    let settings = Setup::parse(&seeded(0).to_toml(), "ride.toml").unwrap().settings();
    assert_eq!(settings.seeds.iter().flatten().count(), 0);
    let mut single = seeded(0);
    single.targets.iter_mut().for_each(|target| target.circles_mm.truncate(3));
    assert_eq!(
        said(&single.to_toml()),
        "ride.toml: has no seeds_px, and no target with 4 circles or more, not on one line, by which it could be \
         found; give seeds_px"
    );
}

#[test]
fn reference_targets_need_a_pose_of_their_own() {
    let mut parts = seeded(3);
    let own = parts.targets[2].clone();
    parts.targets.push(Target { name: "own".to_owned(), carbody: 1, seeds_px: Vec::new(), ..own });
    let settings = Setup::parse(&parts.to_toml(), "ride.toml").unwrap().settings();
    assert_eq!(settings.own, 0b1111111 << 19, "in the place of another target, but on the other carbody");
    parts.targets[3].circles_mm.truncate(3);
    assert_eq!(
        said(&parts.to_toml()),
        "ride.toml: has 3 circles over all targets with carbody = 1; a pose needs at least 4"
    );
    let mut alone = seeded(3);
    alone.targets.iter_mut().for_each(|target| target.carbody = 1);
    assert_eq!(
        said(&alone.to_toml()),
        "ride.toml: has 0 circles over all targets with carbody = 2; a pose needs at least 4"
    );
}

#[test]
fn too_few_seeds_are_refused_in_one_sentence() {
    let needed = "at least 4 circles not on one line need them, or none at all";
    let mut few = seeded(1);
    few.targets[0].circles_mm.truncate(3);
    few.targets[0].seeds_px.truncate(3);
    assert_eq!(said(&few.to_toml()), format!("ride.toml: has only 3 seeds_px; {needed}"));
    let mut line = seeded(1);
    line.targets[0].seeds_px = (0..5).map(|i| [300.0 + 100.0 * f64::from(i), 400.0]).collect();
    assert_eq!(said(&line.to_toml()), format!("ride.toml: has all its seeds_px on one line; {needed}"));
}

#[test]
fn a_coarse_place_of_the_camera_becomes_the_reference() {
    let without = Setup::parse(&seeded(0).to_toml(), "ride.toml").unwrap().settings();
    assert_eq!(without.reference, None);
    let mut parts = seeded(0);
    parts.camera.position_mm = [-1300.0, 20.0, 300.0];
    parts.camera.pitch_deg = 5.0;
    let reference = Setup::parse(&parts.to_toml(), "ride.toml").unwrap().settings().reference.unwrap();
    let seen = reference.transform(&[-1300.0, 20.0, 300.0].into());
    assert!(seen.norm() < 1e-9, "the camera is its own origin: {seen}");
    // What is straight ahead of a camera that looks down by 5 degrees shows above the middle: v counts
    // downwards.
    let ahead = reference.transform(&[-300.0, 20.0, 300.0].into());
    assert!((ahead.y / ahead.z + 5f64.to_radians().tan()).abs() < 1e-12 && ahead.x.abs() < 1e-9, "{ahead}");
}

#[test]
fn more_circles_than_the_firmware_holds_are_refused() {
    let mut parts = seeded(1);
    parts.targets[1].circles_mm =
        (0..60).map(|i| [50.0 * f64::from(i % 10) - 225.0, 50.0 * f64::from(i / 10)]).collect();
    parts.targets.truncate(2);
    let said = said(&parts.to_toml());
    assert_eq!(said, "ride.toml: has 65 circles over all targets; it must be 64 at most");
    parts.targets[1].circles_mm.pop();
    let settings = Setup::parse(&parts.to_toml(), "ride.toml").unwrap().settings();
    assert_eq!(settings.circles.len(), 64);
}

#[test]
fn targets_in_one_place_are_refused() {
    let said = said(&with("origin_mm = [0.0, 380.0, 260.0]", "origin_mm = [400.0, 0.0, 560.0]"));
    assert!(
        said.starts_with("ride.toml:45: target[1] (\"left\") has circles in the place of those of target[0]")
    );
}

#[test]
fn seeds_that_no_pose_explains_are_refused() {
    let good = || Setup::parse(RIDE, "ride.toml").unwrap().parts().clone();
    let mut swapped = good();
    swapped.targets[1].seeds_px.swap(2, 3);
    let swapped = said(&swapped.to_toml());
    assert!(swapped.contains("target[1].seeds_px[2] is ") && swapped.contains("target[1].seeds_px[3] is "));
    assert_eq!(swapped.lines().count(), 2, "{swapped}");
    assert!(swapped.contains(", where the other seeds put its circle; it must be within 4"), "{swapped}");
    let mut shuffled = good();
    shuffled.targets.iter_mut().for_each(|target| target.seeds_px.rotate_left(2));
    assert!(said(&shuffled.to_toml()).contains("has seeds_px that no place of the carbody explains"));
    // One target seen from behind: its u axis and its circles mirrored, so that its seeds still fit.
    let mut behind = good();
    behind.targets[0].u = [0.0, 1.0, 0.0];
    behind.targets[0].circles_mm.iter_mut().for_each(|circle| circle[0] = -circle[0]);
    let behind = said(&behind.to_toml());
    assert!(
        behind.ends_with("target[0] (\"middle\") is seen from behind; u x v must point towards the camera")
    );
    assert_eq!(behind.lines().count(), 1, "{behind}");
}

#[test]
fn seeds_pointed_at_by_hand_are_good() {
    let mut parts = Setup::parse(RIDE, "ride.toml").unwrap().parts().clone();
    // Up to 7 px off to and fro, a sixth of the rings' diameter.
    for (i, seed) in parts.targets.iter_mut().flat_map(|target| &mut target.seeds_px).enumerate() {
        seed[0] += [5.0, -5.0, 0.0][i % 3];
        seed[1] += [-5.0, 5.0, 0.0, 3.0][i % 4];
    }
    assert_eq!(said(&parts.to_toml()), "good");
}

#[test]
fn circles_on_one_line_are_refused() {
    let mut parts = seeded(1);
    parts.targets.truncate(1);
    parts.targets[0].circles_mm = (0..5).map(|i| [60.0 * f64::from(i), 0.0]).collect();
    assert!(said(&parts.to_toml()).contains("has all its circles on one line"));
}

#[test]
fn a_file_that_cannot_be_taken_is_told_in_one_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("ride.toml");
    let said = || Setup::read(&path).unwrap_err().to_string();
    assert!(said().contains("ride.toml cannot be read: "), "{}", said());
    assert!(Setup::read(folder.path()).unwrap_err().to_string().contains(" cannot be read: "));
    std::fs::write(&path, b"name = \"ride\"\n# caf\xe9\n").unwrap();
    assert!(said().ends_with("ride.toml:2: byte 0xe9 is not UTF-8; save the file as UTF-8"), "{}", said());
    std::fs::write(&path, "").unwrap();
    assert!(said().contains("ride.toml: is empty"));
    std::fs::write(&path, "#".repeat(MAX_SETUP_TEXT + 1)).unwrap();
    let too_long = "ride.toml: is longer than 16384 bytes, the most that a box carries; shorten its comments";
    assert!(said().ends_with(too_long), "{}", said());
    let padded = format!("{RIDE}{}", "#".repeat(MAX_SETUP_TEXT - RIDE.len()));
    std::fs::write(&path, &padded).unwrap();
    assert_eq!(Setup::read(&path).unwrap().settings().text, padded.as_str());
}

#[test]
fn a_text_that_went_over_the_wire_in_pieces_gives_the_same_settings() {
    use gangway_wire::{Decoded, Decoder, FRAME_LIMIT, MAX_SETUP_PIECE, Record, SetupPiece, encode};
    let setup = Setup::parse(RIDE, "ride.toml").unwrap();
    let pieces: Vec<&str> =
        RIDE.as_bytes().chunks(MAX_SETUP_PIECE).map(|piece| str::from_utf8(piece).unwrap()).collect();
    let mut line = Vec::new();
    for (i, text) in pieces.iter().enumerate() {
        let (index, count) = (i as u16, pieces.len() as u16);
        let record = Record::Setup(SetupPiece { digest: setup.digest(), index, count, text });
        let mut out = [0; FRAME_LIMIT];
        let written = encode(&record, u32::from(index), &mut out).unwrap();
        line.extend_from_slice(&out[..written]);
    }
    let (mut decoder, mut arrived, mut rest) = (Decoder::new(), String::new(), &line[..]);
    while !rest.is_empty() {
        let (decoded, left) = decoder.feed(rest);
        if let Some(Decoded::Record { record: Record::Setup(piece), .. }) = decoded {
            assert_eq!(piece.digest, setup.digest());
            arrived.push_str(piece.text);
        }
        rest = left;
    }
    assert_eq!(Setup::parse(&arrived, "the box's setup").unwrap().settings(), setup.settings());
}

#[test]
fn the_table_of_settings_shows_value_default_and_line() {
    let rows = Setup::parse(RIDE, "ride.toml").unwrap().table();
    let row = |path: &str| rows.iter().find(|row| row.path == path).unwrap().clone();
    let frames = row("rest.frames");
    assert_eq!(
        (frames.value, frames.default, frames.line),
        (Value::Whole(25), Some(Value::Whole(10)), Some(111))
    );
    assert_eq!((frames.unit, frames.source), ("frames", "5.3.2"));
    let gate = row("solver.gate_px");
    assert_eq!((gate.value, gate.line), (Value::Number(0.5), None));
    assert_eq!(row("camera.rate_hz").default, None);
    // 1 at the head, 13 of the camera, 10 a target, 7 + 4 + 4 + 10 + 7 + 8.
    assert_eq!(rows.len(), 1 + 13 + 3 * 10 + 25 + 15);
}

/// Taken apart without `..`: a field that is added to the firmware's settings and not to the table fails
/// here.
#[test]
fn every_setting_of_the_firmware_is_in_the_table() {
    let mut said = Parts::default();
    let TrackerSettings {
        window_diameters,
        median,
        opening,
        min_contrast,
        max_centroid_distance_px,
        area_tolerance,
        ratio_tolerance,
    } = &mut said.tracker;
    for number in [
        window_diameters,
        min_contrast,
        max_centroid_distance_px,
        area_tolerance,
        ratio_tolerance,
        &mut said.solver.gate_px,
        &mut said.solver.gate_sigmas,
        &mut said.rest.excursion_px,
        &mut said.rest.drift_px,
        &mut said.rest.layout_mm,
    ] {
        *number *= 0.99;
    }
    (said.camera.line_time_us, said.camera.exposure_ms) = (-9.5, 4.0);
    (*median, *opening) = (!*median, !*opening);
    let SolverSettings { method, min_circles, gate_sigmas: _, gate_px: _ } = &mut said.solver;
    (*method, *min_circles) = (Method::Epnp, 7);
    let RestSettings { frames, excursion_px: _, drift_px: _, layout_mm: _ } = &mut said.rest;
    *frames = 99;
    said.limits = Limits {
        min_mm: [-1.0, -2.0, -3.0],
        max_mm: [4.0, 5.0, 6.0],
        max_deg: [7.0, 8.0, 9.0],
        shock_mm_s2: 101.5,
        shock_deg_s2: 33.0,
        standing_mm: 3.5,
        standing_deg: 0.75,
    };
    said.capture = Capture {
        device: "serial:42".into(),
        format: SampleFormat::Bayer,
        exposure: ExposureMode::Auto,
        most_gain: 4.0,
        gain: 0.0,
        focus: 20.0,
        buffers: 6,
    };
    said.board = Board {
        lamp_pins: vec![17, 27],
        lamps: LampMode::Alternate,
        status_pin: 22,
        button_pin: 23,
        sync_pin: 24,
        realtime_priority: 0,
        core: 3.0,
        log_dir: "/var/lib/gangway".into(),
    };
    let text = said.to_toml();
    let parts = Parts {
        name: said.name.clone(),
        camera: said.camera,
        targets: Vec::new(),
        ..document::Document::new(&text).read().unwrap()
    };
    assert_eq!(parts, said, "{text}");
}

#[test]
fn every_default_is_within_its_bounds() {
    let defaults = Parts { targets: vec![Target::default()], ..Parts::default() };
    for section in table::SECTIONS {
        for key in section.keys.iter().filter(|key| !key.required) {
            let value = key.value(&defaults);
            let numbers = match &value {
                Value::Whole(number) => vec![f64::from(*number)],
                Value::Number(number) => vec![*number],
                Value::Numbers(numbers) => numbers.clone(),
                _ => continue,
            };
            assert!(numbers.iter().all(|number| key.within(*number)), "{} is {value} by default", key.name);
        }
    }
}

#[test]
fn the_documentation_carries_the_table_of_settings() {
    let documentation = include_str!("../SETUP.md");
    let (_, tables) = documentation.split_once("### ").unwrap();
    assert_eq!(
        format!("### {tables}").trim_end(),
        reference().trim_end(),
        "SETUP.md must end with the right"
    );
}

/// Any finite number between two bounds, not only round ones.
fn number(least: f64, greatest: f64) -> impl Strategy<Value = f64> {
    (0.0..=1.0).prop_map(move |share: f64| (least + share * (greatest - least)).clamp(least, greatest))
}

prop_compose! {
    /// The example, moved about: whatever a simulator may write.
    fn parts()(
        name in "[a-zäß\"\\\\ 'x]{1,8}",
        rate_hz in number(1.0, 1000.0),
        focal in number(1400.0, 1500.0),
        k1 in number(-0.05, 0.05),
        shift in number(-1.0, 1.0),
        (origin, angle) in (number(-3.0, 3.0), number(-0.05, 0.05)),
        window_diameters in number(2.0, 3.0),
        gate_px in number(0.05, 10.0),
        frames in 10..=250_u16,
        (median, method) in (any::<bool>(), prop_oneof![Just(Method::Auto), Just(Method::Dlt), Just(Method::Epnp)]),
        roll in number(0.01, 89.0),
    ) -> Parts {
        let mut parts = Setup::parse(RIDE, "ride.toml").unwrap().parts().clone();
        parts.name = name;
        parts.camera.rate_hz = rate_hz;
        parts.camera.focal_px[0] = focal;
        parts.camera.distortion[0] = k1;
        for target in &mut parts.targets {
            target.seeds_px.iter_mut().for_each(|seed| seed[0] += shift);
        }
        parts.targets[1].origin_mm[2] += origin;
        parts.targets[1].u = [angle.sin(), -angle.cos(), 0.0];
        parts.tracker.window_diameters = window_diameters;
        parts.tracker.median = median;
        parts.solver.gate_px = gate_px;
        parts.solver.method = method;
        parts.rest.frames = frames;
        parts.limits.max_deg[0] = roll;
        parts
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn what_is_written_reads_back_bit_by_bit(parts in parts()) {
        let text = parts.to_toml();
        let read = Setup::parse(&text, "written.toml").unwrap_or_else(|error| panic!("{error}\n{text}"));
        prop_assert_eq!(read.parts(), &parts);
        prop_assert_eq!(read.parts().to_toml(), text);
    }

    #[test]
    fn random_bytes_never_panic(bytes in proptest::collection::vec(any::<u8>(), 0..400)) {
        let _ = said(&String::from_utf8_lossy(&bytes));
    }

    #[test]
    fn a_damaged_example_never_panics_and_always_has_a_sentence(
        at in 0..RIDE.len(), length in 0..60_usize, put in "[-0-9a-z_.\\[\\]{}=,\"'#\\n é]{0,12}"
    ) {
        let bytes = RIDE.as_bytes();
        let mut damaged = bytes[..at].to_vec();
        damaged.extend_from_slice(put.as_bytes());
        damaged.extend_from_slice(&bytes[(at + length).min(bytes.len())..]);
        let said = said(&String::from_utf8_lossy(&damaged));
        for line in said.lines() {
            prop_assert!(line == "good" || line.starts_with("ride.toml:"), "{}", line);
        }
    }
}
