//! `gangway evaluate` as it is called: what goes to which output, where the files lie, which exit code.

use std::fmt::Write as _;
use std::path::Path;
use std::process::{Command, Output};

use gangway_wire::{MAX_FRAME, Motion, Pose, PoseFlags, Record, encode};

fn evaluate(folder: &Path, args: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_gangway"));
    command.current_dir(folder).arg("evaluate").args(args).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

/// A capture of 40 frames, ten of them waiting, x always 0.25 mm too large, and its truth.
fn ride(folder: &Path) {
    let mut capture = Vec::new();
    let mut truth = "frame,dx_mm,dy_mm,dz_mm,roll_deg,pitch_deg,yaw_deg\n".to_owned();
    for frame in 0..40 {
        let waiting = frame < 10;
        let x = frame as f32;
        let motion = Motion {
            displacement_mm: [x + 0.25, 0.0, 0.0],
            rotation_deg: [0.0; 3],
            sigma: [0.5; 6],
            residual_px: 0.03,
        };
        let pose = Pose {
            frame,
            time_ns: u64::from(frame) * 20_000_000,
            flags: if waiting { PoseFlags::WAITING } else { PoseFlags::default() },
            markers: 15,
            motion: (!waiting).then_some(motion),
        };
        let mut bytes = [0; MAX_FRAME];
        let length = encode(&Record::Pose(pose), frame, &mut bytes).unwrap();
        capture.extend_from_slice(&bytes[..length]);
        writeln!(truth, "{frame},{x},0,0,0,0,0").unwrap();
    }
    std::fs::write(folder.join("ride.gw"), capture).unwrap();
    std::fs::write(folder.join("truth.csv"), truth).unwrap();
}

#[test]
fn the_table_is_printed_and_the_pictures_are_where_it_says() {
    let folder = tempfile::tempdir().unwrap();
    ride(folder.path());
    let output = evaluate(folder.path(), &["ride.gw", "--truth", "truth.csv"]);
    let (table, told) = (text(&output.stdout), text(&output.stderr));
    assert!(output.status.success(), "{told}");
    assert!(table.contains("x      mm   0.250  0.250  0.250  0.000"), "{table}");
    assert!(table.contains("40 in all, 30 compared, 10 waiting"), "{table}");
    let said: Vec<&str> = told.lines().filter_map(|l| l.strip_prefix("gangway: wrote ")).collect();
    assert_eq!(said.len(), 6, "{told}");
    for file in said {
        assert!(folder.path().join(file).is_file(), "{file}");
    }
    assert!(folder.path().join("ride.evaluation/deviations.png").is_file());
}

#[test]
fn json_has_standard_output_for_itself() {
    let folder = tempfile::tempdir().unwrap();
    ride(folder.path());
    let output = evaluate(folder.path(), &["ride.gw", "--truth", "truth.csv", "--json", "--out", "report"]);
    let json: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(json["deviation"]["x"]["max"], 0.25);
    assert_eq!(json["frames"]["waiting"], 10);
    assert!(folder.path().join("report/motions.svg").is_file());
}

#[test]
fn without_a_truth_there_are_motions_only() {
    let folder = tempfile::tempdir().unwrap();
    ride(folder.path());
    // What an earlier evaluation left does not stand beside them.
    evaluate(folder.path(), &["ride.gw", "--truth", "truth.csv", "--out", "report"]);
    assert!(folder.path().join("report/deviations.png").exists());
    let output = evaluate(folder.path(), &["ride.gw", "--out", "report"]);
    assert!(text(&output.stdout).starts_with("Motions of ride.gw, without a reference"));
    assert!(folder.path().join("report/motions.png").is_file());
    assert!(!folder.path().join("report/deviations.png").exists());
}

#[test]
fn a_mistake_is_one_sentence_and_exit_code_1() {
    let folder = tempfile::tempdir().unwrap();
    ride(folder.path());
    std::fs::write(
        folder.path().join("bad.csv"),
        "frame,dx_mm,dy_mm,dz_mm,roll_deg,pitch_deg,yaw_deg\n1,a,,,,,\n",
    )
    .unwrap();
    let cases = [
        (["ride.gw", "--truth", "bad.csv"], "bad.csv, line 2, column dx_mm: \"a\" is not a number"),
        (["ride.gw", "--truth", "none.csv"], "none.csv: cannot be read"),
        (["none", "--truth", "truth.csv"], "none"),
        // A file stands where the folder should be.
        (["ride.gw", "--out", "truth.csv"], "cannot be written"),
    ];
    for (args, expected) in cases {
        let output = evaluate(folder.path(), &args);
        let told = text(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{told}");
        let told: Vec<&str> = told.lines().filter(|l| !l.contains("recover")).collect();
        assert!(
            told.len() == 1 && told[0].starts_with("gangway: ") && told[0].contains(expected),
            "{told:?}"
        );
    }
    assert_eq!(evaluate(folder.path(), &[]).status.code(), Some(2), "used wrongly");
}

/// The ride's truth as a recorder would have it: at another rate, from another zero of time. The ride moves
/// on from a rest of 20 frames.
fn recorded_ride(folder: &Path) {
    let motion = |t: f64| if t < 0.4 { 0.0 } else { 30.0 * (5.0 * (t - 0.4)).sin() };
    let mut capture = Vec::new();
    for frame in 0..150 {
        let waiting = frame < 10;
        let motion = Motion {
            displacement_mm: [0.25, motion(f64::from(frame) / 50.0) as f32, 0.0],
            rotation_deg: [0.0; 3],
            sigma: [0.5; 6],
            residual_px: 0.03,
        };
        let pose = Pose {
            frame,
            time_ns: 7_000_000_000 + u64::from(frame) * 20_000_000,
            flags: if waiting { PoseFlags::WAITING } else { PoseFlags::default() },
            markers: 15,
            motion: (!waiting).then_some(motion),
        };
        let mut bytes = [0; MAX_FRAME];
        let length = encode(&Record::Pose(pose), frame, &mut bytes).unwrap();
        capture.extend_from_slice(&bytes[..length]);
    }
    std::fs::write(folder.join("ride.gw"), capture).unwrap();
    let mut recorder = "time_s,dx_mm,dy_mm,dz_mm,roll_deg,pitch_deg,yaw_deg\n".to_owned();
    for i in 0..400 {
        let s = f64::from(i) / 80.0;
        // The recorder began 1.5 s before the box.
        writeln!(recorder, "{},0,{},0,0,0,0", 1000.0 + s, motion(s - 1.5)).unwrap();
    }
    std::fs::write(folder.join("recorder.csv"), recorder).unwrap();
}

#[test]
fn a_recorder_of_another_rate_and_clock_is_synchronised() {
    let folder = tempfile::tempdir().unwrap();
    recorded_ride(folder.path());
    let output = evaluate(folder.path(), &["ride.gw", "--truth", "recorder.csv", "--sync", "--json"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let json: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let offset = json["sync"]["offset_s"].as_f64().unwrap();
    // Single precision of 30 mm at 150 mm/s, and a corner in the motion that a spline rounds off: well below
    // 0.1 ms.
    assert!((offset + 1.5).abs() < 1e-4, "{offset}");
    assert_eq!(json["frames"]["compared"], 140);
    assert!((json["deviation"]["x"]["mean"].as_f64().unwrap() - 0.25).abs() < 1e-6);
    assert!(json["deviation"]["y"]["rmse"].as_f64().unwrap() < 0.05);
    let table = text(&evaluate(folder.path(), &["ride.gw", "--truth", "recorder.csv", "--sync"]).stdout);
    assert!(table.contains("Synchronised: session time less recorder time -1.50"), "{table}");

    for (args, expected, code) in [
        (&["ride.gw", "--sync"][..], "--truth", 2),
        (&["ride.gw", "--truth", "recorder.csv"], "the column frame is missing", 1),
        (&["ride.gw", "--truth", "ride.gw", "--sync"], "ride.gw", 1),
    ] {
        let output = evaluate(folder.path(), args);
        assert_eq!(output.status.code(), Some(code), "{args:?}");
        assert!(text(&output.stderr).contains(expected), "{args:?}: {}", text(&output.stderr));
    }
}
