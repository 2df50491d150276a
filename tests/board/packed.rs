//! Pictures whose samples are packed as on the camera's bus, through a real device.

use e2e::bench;
use e2e::guest::Guest;

use crate::receiver::{Receiver, free_port};
use crate::same_bytes::{assert_same, replay};
use crate::show::{RATE_HZ, Show, begin};

/// Frames of the ride that are shown: rest, and the first motion.
const FRAMES: usize = 30;

/// A row of samples of two bytes as V4L2 packs them: the top 8 bits of each sample of a group, then a byte
/// with their low bits, the first sample's lowest.
fn pack(samples: &[u8], bits: u8, packed: &mut Vec<u8>) {
    let low = usize::from(bits - 8);
    let (samples, _) = samples.as_chunks();
    for group in samples.chunks(8 / low) {
        let group = group.iter().map(|sample| u16::from_le_bytes(*sample));
        packed.extend(group.clone().map(|sample| (sample >> low) as u8));
        let lows = group.enumerate().map(|(i, sample)| (sample & ((1 << low) - 1)) << (i * low));
        packed.push(lows.fold(0, |all, low| all | low) as u8);
    }
}

#[test]
#[ignore = "boots an emulated board; tests/board/prepare makes what it needs"]
fn packed_pictures_of_a_real_device_give_the_bytes_of_the_bench() {
    let folder = tempfile::tempdir().expect("a folder");
    let depths = [10, 12].map(|bits| {
        let mut show = Show::of_depth(bits, &format!("[capture]\nformat = \"y{bits}p\"\n"));
        show.ride.frames.truncate(FRAMES);
        let mut raw = Vec::new();
        for row in show.ride.frames.iter().flat_map(|frame| frame.chunks_exact(2 * 800)) {
            pack(row, bits, &mut raw);
        }
        let own = folder.path().join(bits.to_string());
        std::fs::create_dir(&own).expect("a folder");
        let port = free_port();
        let receiver = Receiver::start(&own, &format!("tcp-listen://127.0.0.1:{port}"));
        (bits, show, raw, own, port, receiver)
    });
    let mut job = String::from("insmod /modules/v4l2loopback.ko devices=1 video_nr=0 max_buffers=8\n");
    let mut files: Vec<(String, &[u8])> = Vec::new();
    for (bits, show, raw, _, port, _) in &depths {
        files.push((format!("{bits}.toml"), show.setup.as_bytes()));
        files.push((format!("{bits}.raw"), raw));
        job += &format!(
            "feed /dev/video0 /{bits}.raw Y{bits}P 800 450 {RATE_HZ} /tmp/go & FEED=$!
            sleep 1
            gangway-pi run --setup /{bits}.toml --to tcp-connect://10.0.2.2:{port} --box-id 7 & BOX=$!
            read go; touch /tmp/go
            read go; rm /tmp/go
            kill -TERM $BOX; wait $BOX; echo \"board: box ended with $?\"
            wait $FEED\n"
        );
    }
    let files: Vec<(&str, &[u8])> = files.iter().map(|(name, bytes)| (name.as_str(), *bytes)).collect();
    let mut board = Guest::boot(&job, &files);
    for (bits, show, _, own, _, receiver) in depths {
        receiver.wait_for(12);
        let first = begin(&mut board);
        board.go();
        board.expect("board: box ended with 0");
        let (_, said) = receiver.end();
        said.assert_accounted();
        let measured = said.poses.range(first..first + FRAMES as u32).count();
        println!("{bits} bits, packed: {measured} of {FRAMES} frames of the ride measured");
        // As for single bytes: a machine that does many other things may lose some.
        assert!(measured * 10 >= FRAMES * 8, "{measured} frames of the ride");
        assert!(said.has("RestSet") && said.poses.values().any(|(_, has_motion, _)| *has_motion));
        assert_same(&said, &replay(bench(), &show, &said, first, &own, "here.gw"));
    }
    board.wait();
}
