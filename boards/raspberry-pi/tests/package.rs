//! What the Debian package is made of, as far as it shows without a Debian root: the files are there, the
//! service names what is installed, and systemd takes it. `tests/board/package` and `tests/board/service`
//! install and run it.

use std::path::Path;
use std::process::Command;

const CRATE: &str = env!("CARGO_MANIFEST_DIR");
const MANIFEST: &str = include_str!("../Cargo.toml");
const UNIT: &str = include_str!("../package/gangway.service");

/// File in the sources, and where it is installed, of every asset.
fn assets() -> Vec<(&'static str, String)> {
    let (_, list) = MANIFEST.split_once("assets = [").expect("assets");
    let (list, _) = list.split_once("\n]").expect("the end of the assets");
    let asset = |line: &'static str| {
        let parts: Vec<&str> = line.split('"').collect();
        let &[_, from, _, to, ..] = parts.as_slice() else { return None };
        let name = Path::new(from).file_name()?.to_str()?;
        Some((from, if to.ends_with('/') { format!("/{to}{name}") } else { format!("/{to}") }))
    };
    list.lines().filter_map(asset).collect()
}

#[test]
fn every_file_of_the_package_is_there_and_the_service_names_those_that_are_installed() {
    let assets = assets();
    assert!(assets.len() >= 6, "{assets:?}");
    for (from, _) in &assets {
        // The program is what the package is built for.
        assert!(from.starts_with("target/") || Path::new(CRATE).join(from).exists(), "{from}");
    }
    let is_installed = |path: &str| assets.iter().any(|(_, to)| to == path);
    let value = |key: &str| UNIT.lines().find_map(|line| line.strip_prefix(key)).expect("the key");
    assert!(is_installed(value("ExecStart=").split(' ').next().unwrap_or_default()));
    assert!(is_installed(value("EnvironmentFile=")));
    assert!(is_installed(value("Documentation=file://")));
    let (_, kept) = MANIFEST.split_once("conf-files = [").expect("conf-files");
    let (kept, _) = kept.split_once(']').expect("the end of the conf-files");
    let kept: Vec<&str> = kept.split('"').skip(1).step_by(2).collect();
    assert!(!kept.is_empty() && kept.iter().all(|path| is_installed(path)), "{kept:?}");
}

#[test]
fn systemd_takes_the_service() {
    let folder = tempfile::tempdir().expect("a folder");
    let unit = folder.path().join("gangway.service");
    // It looks for the program, and for the documentation where that is installed.
    let here = UNIT.replace("/usr/bin/gangway-pi", env!("CARGO_BIN_EXE_gangway-pi"));
    std::fs::write(&unit, here).expect("the unit");
    let Ok(verified) = Command::new("systemd-analyze").args(["verify", "--man=no"]).arg(&unit).output()
    else {
        eprintln!("left out: systemd-analyze is not installed");
        return;
    };
    let said = String::from_utf8_lossy(&verified.stderr);
    let about: Vec<&str> = said.lines().filter(|line| line.contains("gangway")).collect();
    assert!(verified.status.success() && about.is_empty(), "{said}");
}

#[test]
fn the_service_is_kept_from_nothing_that_libcamera_opens() {
    // Process::isolate() of libcamera: unshare(CLONE_NEWUSER | CLONE_NEWNET), for an algorithm whose
    // signature does not match; its sockets to it, and udev's.
    assert!(UNIT.contains("\nRestrictNamespaces=user net\n"), "{UNIT}");
    let families = UNIT.lines().find(|line| line.starts_with("RestrictAddressFamilies=")).expect("families");
    assert!(["AF_UNIX", "AF_NETLINK"].iter().all(|family| families.contains(family)), "{families}");
    // Its devices are those of the groups and rules: the unit itself leaves all of them in sight.
    for key in ["PrivateDevices=", "DeviceAllow=", "DevicePolicy=", "SystemCallFilter=", "PrivateNetwork="] {
        assert!(!UNIT.lines().any(|line| line.starts_with(key)), "{key}");
    }
    let rules = include_str!("../package/60-gangway.rules");
    for what in ["video4linux", "media", "dma_heap", "udmabuf"] {
        let rule = rules.lines().find(|line| line.contains(&format!("\"{what}\""))).expect(what);
        assert!(rule.contains("GROUP=\"video\"") && rule.contains("MODE=\"0660\""), "{rule}");
    }
}
