//! The ride on the box's own card, when the supply is cut in the middle of it.

use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

use e2e::gangway;
use e2e::guest::Guest;

use crate::said::Said;
use crate::show::{Show, camera};

/// A tool of the file system, which must succeed up to this exit code.
fn tool(name: &str, args: &[&str], up_to: i32) -> Vec<u8> {
    let output = Command::new(name).args(args).env("PATH", "/usr/sbin:/sbin:/usr/bin:/bin").output();
    let output = output.unwrap_or_else(|error| panic!("{name}: {error}"));
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.code().is_some_and(|code| code <= up_to), "{name}: {said}");
    output.stdout
}

/// The only ride in the folder of an image whose journal has been played back.
fn ride_on(card: &str, folder: &Path) -> Vec<u8> {
    tool("debugfs", &["-R", &format!("rdump /rides {}", folder.display()), card], 0);
    let rides: Vec<_> = std::fs::read_dir(folder.join("rides")).expect("rides").flatten().collect();
    let [ride] = rides.as_slice() else { panic!("{rides:?}") };
    std::fs::read(ride.path()).expect("a ride")
}

#[test]
#[ignore = "boots an emulated board; tests/board/prepare makes what it needs"]
fn a_ride_on_the_card_is_there_to_its_last_second_after_a_cut_of_the_supply() {
    let folder = tempfile::tempdir().expect("a folder");
    let card = folder.path().join("card.img");
    let name = card.display().to_string();
    std::fs::File::create(&card).and_then(|file| file.set_len(64 << 20)).expect("an empty card");
    tool("mke2fs", &["-q", "-t", "ext4", &name], 0);
    let show = Show::new("[board]\nlog_dir = \"/card/rides\"\n");
    let job = camera()
        + "while read module; do insmod /modules/$module || exit 1; done </modules/card
        until [ -e /dev/mmcblk0 ]; do sleep 1; done
        mkdir /card; mount -t ext4 /dev/mmcblk0 /card || exit 1
        touch /tmp/go
        gangway-pi run --setup /setup.toml --to serial:/dev/ttyAMA0@921600 || exit 1";
    let files: [(&str, &[u8]); 2] = [("setup.toml", show.setup.as_bytes()), ("frames.raw", &show.raw)];
    let mut board = Guest::boot_with_card(&job, &files, Some(&card));
    board.expect("gangway-pi: measuring to serial:/dev/ttyAMA0@921600");
    // What went over the line until then is what should be there.
    let heard = |board: &Guest| Said::of(&std::fs::read(board.uart()).unwrap_or_default());
    let since = Instant::now();
    while heard(&board).poses.len() < 40 {
        assert!(since.elapsed() < Duration::from_secs(300), "too few frames came");
        std::thread::sleep(Duration::from_millis(200));
    }
    board.cut();
    let sent = heard(&board);

    // As the next start does it: 1 says that something was put in order.
    tool("e2fsck", &["-f", "-y", &name], 1);
    let ride = ride_on(&name, folder.path());
    let kept = Said::of(&ride);
    let newest = |said: &Said| said.poses.values().map(|(time_ns, _, _)| *time_ns).max().unwrap_or_default();
    let lost_ns = newest(&sent).saturating_sub(newest(&kept));
    println!(
        "{} of {} frames are on the card, to {:.2} s before the cut",
        kept.poses.len(),
        sent.poses.len(),
        lost_ns as f64 / 1e9
    );
    assert_eq!(kept.damaged, 0);
    for (frame, (time_ns, _, body)) in &sent.poses {
        let is_kept = kept.poses.get(frame).map(|(_, _, body)| body) == Some(body);
        assert!(is_kept || time_ns + 1_000_000_000 > newest(&sent), "frame {frame} is not on the card");
    }
    let capture = folder.path().join("ride.gw");
    std::fs::write(&capture, ride).expect("the ride");
    let opened = gangway().arg("evaluate").arg(&capture).output().expect("it evaluates");
    assert!(opened.status.success(), "{}", String::from_utf8_lossy(&opened.stderr));
}
