//! What the box costs its board: page faults, allocations, memory, size.

use e2e::guest::{self, Guest};

use crate::show::{RATE_HZ, Show, job};

#[test]
#[ignore = "boots an emulated board; tests/board/prepare makes what it needs"]
fn a_frame_costs_the_box_no_page_fault_and_no_allocation() {
    let show = Show::new("");
    // Counted from the 64th frame on, and page faults every 64 frames: some 200 frames of 240 bytes each.
    let job = job("file:/tmp/box.gw").replace("gangway-pi ", "gangway-pi-proof ")
        + "touch /tmp/go
        for i in $(seq 250); do [ $(stat -c %s /tmp/box.gw 2>/dev/null || echo 0) -lt 48000 ] || break; sleep 1; done
        kill -TERM $BOX; wait $BOX; echo \"board: box ended with $?\"
        kill $FEED";
    let mut board = show.boot(&job);
    let told = board.expect(" in the loop; to ");
    board.expect("board: box ended with 0");
    board.wait();
    println!("{told}");
    assert!(told.contains("; 0 page faults and 0 allocations in the loop"), "{told}");
    let frames: u32 = told.split(' ').next().and_then(|n| n.parse().ok()).expect("a count of frames");
    assert!(frames > 2 * 64, "{told}");
}

#[test]
#[ignore = "boots an emulated board; tests/board/prepare makes what it needs"]
fn a_box_at_1080p_stays_within_its_memory() {
    let setup = Show::setup_of_size(1920, 1080);
    let picture = vec![90; 1920 * 1080];
    // The kernel's buffers are of the device; with the program's own memory they are what the box takes.
    let job = format!(
        "insmod /modules/v4l2loopback.ko devices=1 video_nr=0 max_buffers=4
        feed /dev/video0 /frames.raw GREY 1920 1080 {RATE_HZ} /tmp/go &
        FEED=$!
        sleep 1
        gangway-pi run --setup /setup.toml --to file:/tmp/box.gw & BOX=$!
        sleep 8
        cat /proc/$BOX/smaps | awk '/video0/ {{ shown = 1 }} /^Size:/ && shown {{ size += $2 }} \
            /^Rss:/ && shown {{ rss += $2; shown = 0 }} END {{ print \"board: buffers\", size, \"shown\", rss }}'
        awk '/VmHWM/ {{ print \"board: resident\", $2 }}' /proc/$BOX/status
        kill -TERM $BOX; wait $BOX; kill $FEED"
    );
    let files: [(&str, &[u8]); 2] = [("setup.toml", setup.as_bytes()), ("frames.raw", &picture)];
    let mut board = Guest::boot(&job, &files);
    let numbers =
        |line: String| -> Vec<u64> { line.split_whitespace().filter_map(|word| word.parse().ok()).collect() };
    let buffers = numbers(board.expect("board: buffers"));
    let resident = numbers(board.expect("board: resident"));
    board.wait();
    let (&[size, shown], &[resident]) = (buffers.as_slice(), resident.as_slice()) else {
        panic!("{buffers:?}")
    };
    assert!(size >= 4 * 1920 * 1080 / 1024, "four buffers: {size} KiB");
    let all = resident + size - shown;
    println!("{resident} KiB resident, {size} KiB of buffers of which {shown} are in it: {all} KiB");
    assert!(all <= 24 * 1024, "{all} KiB");
    let program = std::fs::metadata(guest::cache().join("programs/gangway-pi")).expect("the program").len();
    println!("the program has {program} bytes");
    assert!(program <= 4 << 20, "{program} bytes");
}
