//! The programs as a user calls them.

use std::path::PathBuf;
use std::process::{Command, Output};
use std::sync::Once;

/// `gangway`.
pub fn gangway() -> Command {
    Command::new(program("gangway"))
}

/// `gangway-bench`.
pub fn bench() -> Command {
    Command::new(program("gangway-bench"))
}

/// The box's `gangway-bench` for arm64 under user emulation; `tests/board/prepare` builds it.
pub fn emulated_bench() -> Command {
    let root = "/usr/aarch64-linux-gnu";
    let mut command = Command::new("qemu-aarch64");
    // The loader of the cross packages and the C library of Debian's arm64 packages may be of different
    // builds: then the first thread that is started searches a list of stacks that has no end.
    command.args(["-L", root, "-E", &format!("LD_LIBRARY_PATH={root}/lib")]);
    command.arg(crate::guest::cache().join("programs/gangway-bench"));
    command
}

/// The one sentence on standard error of a program that failed with `code`.
pub fn sentence(output: &Output, code: i32) -> String {
    let said = String::from_utf8_lossy(&output.stderr).trim().to_owned();
    assert_eq!(output.status.code(), Some(code), "{said}");
    assert_eq!(said.lines().count(), 1, "one sentence: {said}");
    assert!(!said.contains("panicked"), "{said}");
    said
}

/// Where cargo puts programs beside this test. `cargo test --workspace` has built them just now; where they
/// are missing they are built here. A run of these tests alone takes them as they are.
fn program(name: &str) -> PathBuf {
    static BUILD: Once = Once::new();
    let test = std::env::current_exe().expect("a test knows where it is");
    let folder = test.parent().and_then(|deps| deps.parent()).expect("target/PROFILE/deps");
    BUILD.call_once(|| {
        if ["gangway", "gangway-bench"].iter().all(|program| folder.join(program).exists()) {
            return;
        }
        let profile = match folder.file_name().and_then(|name| name.to_str()) {
            Some("debug") | None => "dev",
            Some(profile) => profile,
        };
        let built = Command::new(env!("CARGO"))
            .args([
                "build",
                "--quiet",
                "-p",
                "gangway",
                "-p",
                "gangway-bench",
                "--bins",
                "--profile",
                profile,
            ])
            .status();
        assert!(built.is_ok_and(|status| status.success()), "the programs build");
    });
    folder.join(name)
}
