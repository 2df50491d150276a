//! The rooms and the one direction in which data walks through them: every arrow between the workspace's
//! crates is written down here, and any other fails.

use std::collections::BTreeMap;

use cargo_metadata::{DependencyKind, MetadataCommand};

/// These judge everything and may know everybody.
const JUDGES: &[&str] = &["e2e", "accuracy"];

/// Who may know whom.
const MAY_KNOW: &[(&str, &[&str])] = &[
    ("gangway-wire", &[]),
    ("gangway-device", &[]),
    ("gangway-pose", &[]),
    ("gangway-vision", &["gangway-device", "gangway-pose"]),
    ("gangway-engine", &["gangway-wire", "gangway-device", "gangway-pose", "gangway-vision"]),
    ("gangway-setup", FIRMWARE),
    ("gangway-link", FIRMWARE),
    (
        "gangway-bench",
        &[
            "gangway-wire",
            "gangway-device",
            "gangway-pose",
            "gangway-vision",
            "gangway-engine",
            "gangway-setup",
            "gangway-link",
        ],
    ),
    ("gangway-linux", &["gangway-device", "gangway-engine", "gangway-link", "gangway-setup"]),
    ("gangway-pi", &["gangway-device", "gangway-engine", "gangway-link", "gangway-setup", "gangway-linux"]),
    ("gangway-scene", &["gangway-setup"]),
    ("gangway-store", &["gangway-wire", "gangway-pose", "gangway-setup"]),
    ("gangway-report", &["gangway-wire", "gangway-pose", "gangway-setup", "gangway-store"]),
    ("gangway", &["gangway-setup", "gangway-scene", "gangway-store", "gangway-report", "gangway-bench"]),
];

const FIRMWARE: &[&str] =
    &["gangway-wire", "gangway-device", "gangway-pose", "gangway-vision", "gangway-engine"];

#[test]
fn every_arrow_between_rooms_is_one_of_the_plan() {
    let metadata = MetadataCommand::new().no_deps().exec().expect("cargo metadata runs");
    let plan: BTreeMap<_, _> = MAY_KNOW.iter().copied().collect();
    let members: Vec<_> = metadata.packages.iter().map(|package| package.name.to_string()).collect();
    let mut wrong = Vec::new();
    for package in &metadata.packages {
        if JUDGES.contains(&package.name.as_str()) {
            continue;
        }
        let Some(allowed) = plan.get(package.name.as_str()) else {
            wrong.push(format!("{} has no place in the plan", package.name));
            continue;
        };
        for dependency in package.dependencies.iter().filter(|d| d.kind != DependencyKind::Development) {
            if members.contains(&dependency.name) && !allowed.contains(&dependency.name.as_str()) {
                wrong.push(format!("{} must not know {}", package.name, dependency.name));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn firmware_is_no_std_forbids_unsafe_and_has_no_std_feature() {
    let metadata = MetadataCommand::new().no_deps().exec().expect("cargo metadata runs");
    for package in metadata.packages.iter().filter(|package| FIRMWARE.contains(&package.name.as_str())) {
        let root = package.manifest_path.with_file_name("src").join("lib.rs");
        let source = std::fs::read_to_string(&root).expect("a crate has a lib.rs");
        assert!(source.contains("#![no_std]"), "{root} is not no_std");
        assert!(source.contains("#![forbid(unsafe_code)]"), "{root} does not forbid unsafe code");
        assert!(!package.features.contains_key("std"), "{} has a std feature", package.name);
        // AVX2 is asked for at run time, by the standard library: nothing else may want that.
        let lines: Vec<&str> = source.lines().collect();
        for pair in lines.windows(2).filter(|pair| pair[1].contains("extern crate std")) {
            let only = ["#[cfg(test)]", r#"#[cfg(any(test, feature = "avx2"))]"#];
            assert!(only.contains(&pair[0]), "{root}: {} before {}", pair[0], pair[1]);
        }
    }
}
