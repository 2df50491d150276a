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
