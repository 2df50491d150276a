//! The demo as its user meets it: on a small scene, and when the disk fills up in the middle.

use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use gangway_store::Session;

/// 80 frames, of which the first 15 are at rest.
const SCENE: &str = include_str!("../../../tests/scenes/short.toml");

/// A demo that waits for something that never comes is ended after this time, which no demo takes.
const HANGS: Duration = Duration::from_secs(120);

/// Runs a shell's command line in `folder`, where the scene is; `$0` in it is the program.
fn run(folder: &Path, line: &str) -> Output {
    fs::write(folder.join("short.toml"), SCENE).unwrap();
    let mut shell = Command::new("sh");
    shell.current_dir(folder).args(["-c", line]).arg(env!("CARGO_BIN_EXE_gangway"));
    let mut child = shell.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let began = Instant::now();
    while child.try_wait().unwrap().is_none() {
        if began.elapsed() > HANGS {
            child.kill().unwrap();
            panic!("`{line}` hangs");
        }
        thread::sleep(Duration::from_millis(20));
    }
    child.wait_with_output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// Everything in quotes behind `key=` of a page.
fn quoted<'p>(page: &'p str, key: &'p str) -> impl Iterator<Item = &'p str> {
    page.split(key).skip(1).filter_map(|rest| rest.strip_prefix("=\"")?.split('"').next())
}

#[test]
fn the_demo_prints_its_table_and_says_where_everything_is() {
    let dir = tempfile::tempdir().unwrap();
    let output = run(dir.path(), "exec \"$0\" demo short.toml --out shown");
    let said = text(&output.stdout);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    for part in ["RMSE", "Frames: 80 in all, 71 compared, 9 waiting", "page         shown/index.html"] {
        assert!(said.contains(part), "{part}: {said}");
    }
    // Whatever it names is there.
    let named = said.lines().filter_map(|line| {
        ["session ", "pictures ", "page "].iter().find_map(|name| line.strip_prefix(name)).map(str::trim)
    });
    let named: Vec<_> = named.map(|path| dir.path().join(path)).collect();
    assert_eq!(named.len(), 3);
    assert!(named.iter().all(|path| path.exists()), "{named:?}");
    let (session, recovery) = Session::open(&named[0]).unwrap();
    assert!(recovery.is_whole() && session.poses().unwrap().len() == 80);
    for picture in ["motions.svg", "motions.png", "deviations.svg", "deviations.png"] {
        assert!(named[1].join(picture).is_file(), "{picture}");
    }
    // The page shows the same table, and all that it points to is beside it.
    let page = fs::read_to_string(&named[2]).unwrap();
    let rmse = said.lines().find(|line| line.starts_with("yaw")).unwrap().split_whitespace().nth(3).unwrap();
    assert!(page.contains(rmse), "{rmse}");
    let links: Vec<_> = quoted(&page, "href").chain(quoted(&page, "src")).collect();
    assert!(links.len() >= 6, "{links:?}");
    for link in links {
        assert!(dir.path().join("shown").join(link).exists(), "{link}");
    }
}

#[test]
fn a_disk_that_fills_up_ends_the_demo_with_one_sentence() {
    let dir = tempfile::tempdir().unwrap();
    // A limit on the size of files stands for the full disk: setup and truth fit, the session does not.
    let output = run(dir.path(), "ulimit -f 8; trap '' XFSZ; exec \"$0\" demo short.toml --frames 40");
    let said = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.lines().count() == 1 && said.contains("the disk is full"), "{said}");
    assert!(dir.path().join("demo/truth.csv").is_file());
    let session = fs::read_dir(dir.path().join("demo/rides")).unwrap().next().unwrap().unwrap().path();
    let (_, recovery) = Session::open(session).unwrap();
    assert!(recovery.cut_off && recovery.records > 10, "{recovery}");
}
