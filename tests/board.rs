//! The box on an emulated Raspberry Pi 3: frames through a real V4L2 device, records over a real network and a real
//! UART, pins in real registers. `tests/board/prepare` makes what these tests boot; without it they are left out.

use std::collections::BTreeMap;
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use e2e::guest::{self, Guest};
use e2e::{Ride, bench, emulated_bench, gangway};
use gangway_scene::Scene;
use gangway_wire::{Decoded, Decoder, Histogram, Latency, Record, What};

/// Frames a second that the emulation keeps up with on two cores, with room for a machine that does other things.
const RATE_HZ: u32 = 4;

/// The short ride as raw pictures, with a setup of the emulation's rate.
struct Show {
    ride: Ride,
    setup: String,
    raw: Vec<u8>,
}

impl Show {
    fn new(more: &str) -> Self {
        let scene =
            Scene::parse(include_str!("scenes/short.toml"), "short.toml").expect("the scene is right");
        let ride = Ride::of(&scene);
        let setup = scene.setup_text().replace("rate_hz = 50.0", &format!("rate_hz = {RATE_HZ}.0"));
        assert!(setup.contains(&format!("rate_hz = {RATE_HZ}.0")), "{setup}");
        let raw = ride.frames.concat();
        Self { ride, setup: format!("{setup}\n{more}"), raw }
    }

    fn boot(&self, job: &str) -> Guest {
        Guest::boot(job, &[("setup.toml", self.setup.as_bytes()), ("frames.raw", &self.raw)])
    }

    /// The picture that was fed under a number.
    fn picture(&self, number: u32, first: u32) -> &[u8] {
        let place = number.saturating_sub(first) as usize;
        &self.ride.frames[place.min(self.ride.frames.len() - 1)]
    }
}

/// What a box said: the bodies of what its frames caused, and its events.
#[derive(Default)]
struct Said {
    poses: BTreeMap<u32, (u64, bool, Vec<u8>)>,
    markers: BTreeMap<u32, Vec<u8>>,
    rests: Vec<Vec<u8>>,
    events: Vec<(u32, String)>,
    /// Frames that an event says are missing.
    missed: u32,
    damaged: u64,
    /// All latencies of the health records.
    latency: Latency,
}

impl Said {
    fn of(stream: &[u8]) -> Self {
        let mut said = Self::default();
        let mut decoder = Box::new(Decoder::new());
        let mut bytes = stream;
        while !bytes.is_empty() {
            let (decoded, rest) = decoder.feed(bytes);
            bytes = rest;
            let Some(Decoded::Record { body, record, .. }) = decoded else { continue };
            match record {
                Record::Pose(pose) => {
                    let motion = pose.motion.is_some();
                    said.poses.insert(pose.frame, (pose.time_ns, motion, body.to_vec()));
                }
                Record::Markers(markers) => {
                    said.markers.insert(markers.frame, body.to_vec());
                }
                // A rest pose comes again with every announcement.
                Record::Rest(_) if !said.rests.contains(&body.to_vec()) => said.rests.push(body.to_vec()),
                Record::Event(event) => {
                    if let What::FramesMissed { count } = event.what {
                        said.missed += count;
                    }
                    said.events.push((event.frame, format!("{:?}", event.what)));
                }
                Record::Health(health) => {
                    let Latency { wake_up, exposure_to_line } = health.latency.unwrap_or_default();
                    said.latency.wake_up.merge(&wake_up);
                    said.latency.exposure_to_line.merge(&exposure_to_line);
                }
                _ => {}
            }
        }
        said.damaged = decoder.counts().damaged;
        said
    }

    fn has(&self, what: &str) -> bool {
        self.events.iter().any(|(_, event)| event.contains(what))
    }

    /// Every frame from the first to the last one has its record, or is told to be missing.
    fn assert_accounted(&self) {
        let (first, last) = (self.poses.keys().next(), self.poses.keys().last());
        let (Some(first), Some(last)) = (first, last) else { panic!("no frame was measured") };
        assert_eq!(self.poses.len() as u32 + self.missed, last - first + 1, "{:?}", self.events);
        assert_eq!(self.damaged, 0);
    }
}

/// `gangway receive` in a folder, from the address that the box is to be told.
struct Receiver {
    program: Child,
    folder: PathBuf,
}

impl Receiver {
    fn start(folder: &Path, from: &str) -> Self {
        let program = gangway()
            .args(["receive", "--from", from, "--into"])
            .arg(folder.join("rides"))
            .stderr(Stdio::null())
            .spawn()
            .expect("the receiver starts");
        Self { program, folder: folder.join("rides") }
    }

    /// The session's folder and bytes so far.
    fn stream(&self) -> Option<(PathBuf, Vec<u8>)> {
        let sessions = std::fs::read_dir(&self.folder).ok()?;
        let session =
            sessions.flatten().map(|entry| entry.path()).find(|path| path.join("stream.gw").exists())?;
        let bytes = std::fs::read(session.join("stream.gw")).ok()?;
        Some((session, bytes))
    }

    /// Frames that the box has measured so far.
    fn frames(&self) -> usize {
        self.stream().map_or(0, |(_, bytes)| Said::of(&bytes).poses.len())
    }

    /// Waits until the box has measured so many frames.
    fn wait_for(&self, frames: usize) {
        let since = Instant::now();
        while self.frames() < frames {
            assert!(since.elapsed() < Duration::from_secs(300), "no {frames} frames came");
            std::thread::sleep(Duration::from_millis(200));
        }
    }

    fn end(mut self) -> (PathBuf, Said) {
        self.program.wait().expect("the receiver ends with the session");
        let (session, bytes) = self.stream().expect("a session");
        (session, Said::of(&bytes))
    }
}

impl Drop for Receiver {
    fn drop(&mut self) {
        let _ = self.program.kill();
    }
}

fn free_port() -> u16 {
    TcpListener::bind("127.0.0.1:0").and_then(|socket| socket.local_addr()).expect("a port").port()
}

/// The same frames with the same numbers and times through a bench, with the capture's name in the folder.
fn replay(mut bench: Command, show: &Show, said: &Said, first: u32, folder: &Path, name: &str) -> Said {
    let mut y4m = format!("YUV4MPEG2 W{} H{} F{RATE_HZ}:1 Cmono\n", 800, 450).into_bytes();
    let mut times = String::from("frame,time_ns\n");
    for (number, (time_ns, _, _)) in &said.poses {
        y4m.extend_from_slice(b"FRAME\n");
        y4m.extend_from_slice(show.picture(*number, first));
        times.push_str(&format!("{number},{time_ns}\n"));
    }
    std::fs::write(folder.join("frames.y4m"), y4m).expect("the frames");
    std::fs::write(folder.join("times.csv"), times).expect("their times");
    std::fs::write(folder.join("setup.toml"), &show.setup).expect("the setup");
    let to = folder.join(name);
    let output = bench
        .current_dir(folder)
        .args(["--setup", "setup.toml", "--frames", "frames.y4m", "--times", "times.csv", "--to"])
        .arg(format!("file:{}", to.display()))
        .output()
        .expect("the bench runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    Said::of(&std::fs::read(to).expect("a capture"))
}

/// Every pose, every centre and the rest pose are the same bytes.
fn assert_same(one: &Said, other: &Said) {
    for (frame, (_, _, body)) in &one.poses {
        assert_eq!(other.poses.get(frame).map(|(_, _, body)| body), Some(body), "pose of frame {frame}");
        assert_eq!(other.markers.get(frame), one.markers.get(frame), "markers of frame {frame}");
    }
    assert_eq!(one.poses.len(), other.poses.len());
    assert_eq!(one.rests, other.rests);
}

/// A loop-back camera that shows the ride, and the box in front of it. The job goes on line by line.
fn job(to: &str) -> String {
    format!(
        "insmod /modules/v4l2loopback.ko devices=1 video_nr=0 max_buffers=8
        feed /dev/video0 /frames.raw 800 450 {RATE_HZ} /tmp/go &
        FEED=$!
        sleep 1
        gangway-pi run --setup /setup.toml --to {to} --box-id 7 &
        BOX=$!
        "
    )
}

#[test]
#[ignore = "boots an emulated board; tests/board/prepare makes what it needs"]
fn the_emulated_box_gives_the_bytes_of_the_bench_over_tcp() {
    let folder = tempfile::tempdir().expect("a folder");
    let show = Show::new("");
    let port = free_port();
    let receiver = Receiver::start(folder.path(), &format!("tcp-listen://127.0.0.1:{port}"));
    let job = job(&format!("tcp-connect://10.0.2.2:{port}"))
        + "read go; touch /tmp/go
        read go; rm /tmp/go
        grep -E 'VmHWM|Threads' /proc/$BOX/status
        kill -TERM $BOX; wait $BOX; echo \"board: box ended with $?\"";
    let mut board = show.boot(&job);
    receiver.wait_for(12);
    board.go();
    let line = board.expect("fed from");
    let first: u32 =
        line.rsplit(' ').next().and_then(|n| n.parse().ok()).expect("the number of the first frame");
    board.go();
    board.expect("board: box ended with 0");
    board.wait();

    let (session, said) = receiver.end();
    said.assert_accounted();
    let last = first + show.ride.frames.len() as u32 - 1;
    let measured = said.poses.range(first..=last).count();
    println!("{measured} of {} frames of the ride measured, the others told missing", show.ride.frames.len());
    assert!(said.has("RestSet") && said.has("Ended"), "{:?}", said.events);
    let told = |what: &str, times: &Histogram| {
        println!("{what}: {:?}, at most {:.1} ms", times.counts, f64::from(times.longest_ns) / 1e6);
        times.total() as usize
    };
    let woken = told("frame complete to loop", &said.latency.wake_up);
    let handed = told("exposure to line", &said.latency.exposure_to_line);
    // The loop-back device does not say by which clock it notes its times.
    let all = if said.has("clock is not monotonic") { 0 } else { said.poses.len() };
    assert_eq!(woken, all);
    // The link tells the loop every half second what it has handed over.
    let least = said.poses.len() - RATE_HZ as usize;
    assert!((least..=said.poses.len()).contains(&handed), "{handed} poses of {}", said.poses.len());
    // A machine that does many other things may lose some; most of the ride must be there to prove anything.
    assert!(measured * 10 >= show.ride.frames.len() * 8, "{measured} frames of the ride");

    let here = replay(bench(), &show, &said, first, folder.path(), "here.gw");
    assert_same(&said, &here);
    // And the same program for arm64 without a board.
    assert_same(&said, &replay(emulated_bench(), &show, &said, first, folder.path(), "arm64.gw"));

    // Against the truth, moved to the box's frame numbers: as the bench, to the last digit.
    let mut truth = String::from("frame,dx_mm,dy_mm,dz_mm,roll_deg,pitch_deg,yaw_deg\n");
    for (frame, at) in (first..).zip(&show.ride.truth) {
        let [x, y, z] = at.displacement_mm;
        let [roll, pitch, yaw] = at.rotation_deg;
        truth.push_str(&format!("{frame},{x},{y},{z},{roll},{pitch},{yaw}\n"));
    }
    std::fs::write(folder.path().join("truth.csv"), truth).expect("the truth");
    let evaluate = |what: &Path| {
        let output = gangway()
            .arg("evaluate")
            .arg(what)
            .arg("--truth")
            .arg(folder.path().join("truth.csv"))
            .arg("--json")
            .output()
            .expect("it evaluates");
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let mut json: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
        let object = json.as_object_mut().expect("an object");
        object.retain(|key, _| key != "session" && key != "reference");
        json
    };
    let (box_, bench) = (evaluate(&session), evaluate(&folder.path().join("here.gw")));
    assert_eq!(box_, bench);
    println!("{}", box_["deviation"]);
}

#[test]
#[ignore = "needs the programs for arm64; tests/board/prepare builds them"]
fn the_bench_for_arm64_gives_the_bytes_of_the_bench_of_this_machine() {
    let folder = tempfile::tempdir().expect("a folder");
    let show = Show::new("");
    let mut said = Said::default();
    // Uneven times, as of a real camera.
    for (number, time_ns) in
        (7..).zip((0..show.ride.frames.len() as u64).map(|i| i * 20_000_000 + i * i % 7_919))
    {
        said.poses.insert(number, (time_ns, false, Vec::new()));
    }
    let here = replay(bench(), &show, &said, 7, folder.path(), "here.gw");
    let arm64 = replay(emulated_bench(), &show, &said, 7, folder.path(), "arm64.gw");
    assert_eq!(here.poses.len(), show.ride.frames.len());
    assert!(here.poses.values().any(|(_, has_motion, _)| *has_motion) && here.has("RestSet"));
    assert_same(&here, &arm64);
    println!("{} poses and centres are the same bytes", here.poses.len());
}

/// The lamp and the status lamp of the pin tests, as bits of the level register GPLEV0.
const LAMP: u32 = 1 << 17;
const STATUS: u32 = 1 << 22;
const GPLEV0: u32 = 0x3f20_0034;
const PINS: &str = "[board]\nlamp_pins = [17]\nlamps = \"off\"\nstatus_pin = 22\n";
const ALTERNATE: &str = "[board]\nlamp_pins = [17]\nlamps = \"alternate\"\nstatus_pin = 22\n";
/// Lights the lamp behind the box's back: GPSET0, bit 17.
const LIGHT: &str = "devmem 0x3f20001c 32 0x20000";

#[test]
#[ignore = "boots an emulated board; tests/board/prepare makes what it needs"]
fn lamps_are_dark_after_the_end_a_panic_and_a_kill_with_a_new_start() {
    let show = Show::new(PINS);
    let run = "run --setup /tmp/setup.toml --to file:/tmp/box.gw & BOX=$!; sleep 6";
    let start = format!("cp /setup.toml /tmp/setup.toml; gangway-pi {run}");
    let panics = format!("gangway-pi-proof {run}");
    let job = format!(
        "insmod /modules/v4l2loopback.ko devices=1 video_nr=0 max_buffers=8
        feed /dev/video0 /frames.raw 800 450 {RATE_HZ} /tmp/go &
        FEED=$!
        sleep 1
        {start}; {LIGHT}; echo 'board: lit'; read go
        kill -TERM $BOX; wait $BOX; echo 'board: ended'; read go
        {panics}; {LIGHT}; echo 'board: lit once more'; read go
        rm /tmp/setup.toml; kill -HUP $BOX; wait $BOX; echo \"board: panicked with $?\"; read go
        {start}; {LIGHT}; kill -KILL $BOX; wait $BOX; echo 'board: killed'; read go
        {start}; echo 'board: again'; read go
        kill -TERM $BOX; wait $BOX
        kill $FEED"
    );
    let mut board = show.boot(&job);
    board.expect("board: lit");
    assert_eq!(board.word(GPLEV0) & (LAMP | STATUS), LAMP | STATUS, "the box measures and the lamp shines");
    board.go();
    board.expect("board: ended");
    assert_eq!(board.word(GPLEV0) & (LAMP | STATUS), 0, "dark after SIGTERM");
    board.go();
    board.expect("board: lit once more");
    assert_eq!(board.word(GPLEV0) & LAMP, LAMP, "the lamp shines");
    board.go();
    board.expect("board: panicked with 101");
    assert_eq!(
        board.word(GPLEV0) & (LAMP | STATUS),
        0,
        "dark after a panic in another thread than the frames'"
    );
    board.go();
    board.expect("board: killed");
    assert_eq!(board.word(GPLEV0) & LAMP, LAMP, "nobody puts out the lamp of a box that was killed");
    board.go();
    board.expect("board: again");
    assert_eq!(board.word(GPLEV0) & (LAMP | STATUS), STATUS, "the next start puts it out");
    board.go();
    board.wait();
}

#[test]
#[ignore = "boots an emulated board; tests/board/prepare makes what it needs"]
fn lamps_that_alternate_do_so_on_their_pin_and_are_dark_at_the_end() {
    let show = Show::new(ALTERNATE);
    let job = format!(
        "insmod /modules/v4l2loopback.ko devices=1 video_nr=0 max_buffers=8
        feed /dev/video0 /frames.raw 800 450 {RATE_HZ} /tmp/go &
        FEED=$!
        sleep 1
        gangway-pi run --setup /setup.toml --to file:/tmp/box.gw & BOX=$!; sleep 6
        echo 'board: drives'; read go
        kill -TERM $BOX; wait $BOX; echo 'board: ended'; read go
        kill $FEED"
    );
    let mut board = show.boot(&job);
    board.expect("board: drives");
    // Read at times that have nothing to do with the frames'.
    let lit: Vec<bool> = (0..60)
        .map(|_| {
            std::thread::sleep(Duration::from_millis(173));
            board.word(GPLEV0) & LAMP != 0
        })
        .collect();
    let count = lit.iter().filter(|lit| **lit).count();
    // Half of them; five standard deviations of a coin thrown sixty times.
    assert!((10..50).contains(&count), "{count} of {} lit: {lit:?}", lit.len());
    println!("lit in {count} of {} readings of the level register", lit.len());
    board.go();
    board.expect("board: ended");
    assert_eq!(board.word(GPLEV0) & (LAMP | STATUS), 0, "dark after SIGTERM");
    board.go();
    board.wait();
}

#[test]
#[ignore = "boots an emulated board; tests/board/prepare makes what it needs"]
fn a_stalled_and_a_vanished_camera_come_back_and_every_gap_is_in_the_records() {
    let folder = tempfile::tempdir().expect("a folder");
    let show = Show::new("");
    let port = free_port();
    let receiver = Receiver::start(folder.path(), &format!("tcp-listen://127.0.0.1:{port}"));
    let camera = format!(
        "insmod /modules/v4l2loopback.ko devices=1 video_nr=0 max_buffers=8
        feed /dev/video0 /frames.raw 800 450 {RATE_HZ} /tmp/go &
        FEED=$!"
    );
    let job = job(&format!("tcp-connect://10.0.2.2:{port}"))
        + &format!(
            "read go
            kill -STOP $FEED; sleep 5; kill -CONT $FEED; echo 'board: stalled'
            read go
            kill -STOP $FEED; sleep 3; kill -KILL $FEED; wait $FEED
            until rmmod v4l2loopback; do sleep 1; done; echo 'board: vanished'
            sleep 2
            {camera}
            read go
            kill -TERM $BOX; wait $BOX; echo \"board: box ended with $?\"
            kill $FEED"
        );
    let mut board = show.boot(&job);
    receiver.wait_for(12);
    board.go();
    board.expect("board: stalled");
    let before = receiver.frames();
    receiver.wait_for(before + 12);
    board.go();
    board.expect("board: vanished");
    let before = receiver.frames();
    receiver.wait_for(before + 12);
    board.go();
    board.expect("board: box ended with 0");
    board.wait();
    let (_, said) = receiver.end();
    said.assert_accounted();
    let told: Vec<&str> = said.events.iter().map(|(_, event)| event.as_str()).collect();
    let count = |what: &str| told.iter().filter(|told| told.contains(what)).count();
    assert!(count("CameraStalled") >= 2 && count("CameraReopened") >= 2, "{told:?}");
    // 5 s at the rate of the feed, less the three periods until the stall is noticed and one of rounding.
    let gaps = told
        .iter()
        .filter_map(|told| told.strip_prefix("FramesMissed { count: ")?.strip_suffix(" }")?.parse().ok());
    assert!(gaps.clone().any(|gap: u32| gap >= 5 * RATE_HZ - 4), "{told:?}");
}

#[test]
#[ignore = "boots an emulated board; tests/board/prepare makes what it needs"]
fn records_come_over_the_uart_too() {
    let folder = tempfile::tempdir().expect("a folder");
    let show = Show::new("");
    let job = job("serial:/dev/ttyAMA0@115200")
        + "read go
        kill -TERM $BOX; wait $BOX; echo \"board: box ended with $?\"
        kill $FEED";
    let mut board = show.boot(&job);
    let heard = |board: &Guest| Said::of(&std::fs::read(board.uart()).unwrap_or_default()).poses.len();
    board.expect("gangway-pi: measuring to serial:/dev/ttyAMA0@115200");
    let since = Instant::now();
    while heard(&board) < 12 {
        assert!(since.elapsed() < Duration::from_secs(300), "{} frames came", heard(&board));
        std::thread::sleep(Duration::from_millis(200));
    }
    board.go();
    board.expect("board: box ended with 0");
    board.wait();
    let receiver = Receiver::start(folder.path(), &format!("file:{}", board.uart().display()));
    let (_, said) = receiver.end();
    said.assert_accounted();
    assert!(said.has("RestSet"), "{:?}", said.events);
    assert!(said.poses.values().any(|(_, has_motion, _)| *has_motion));
}

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

/// A vivid device of 1280 x 720 at the emulation's rate, whose controls are real.
fn vivid_setup(capture: &str) -> String {
    let mut setup = Show::new("").setup;
    for (from, to) in [("width_px = 800", "width_px = 1280"), ("height_px = 450", "height_px = 720")] {
        assert!(setup.contains(from));
        setup = setup.replace(from, to);
    }
    format!("{setup}\n[capture]\n{capture}\n")
}

#[test]
#[ignore = "boots an emulated board; tests/board/prepare makes what it needs"]
fn a_control_that_the_driver_refuses_is_told_and_a_camera_with_a_clock_shows_how_late_the_loop_is() {
    let job = "insmod /modules/vivid.ko n_devs=1 node_types=0x0001
        gangway-pi run --setup /refused.toml --to file:/tmp/no.gw; echo \"board: refused with $?\"
        gangway-pi run --setup /setup.toml --to serial:/dev/ttyAMA0@115200 & BOX=$!
        sleep 8
        kill -TERM $BOX; wait $BOX; echo \"board: box ended with $?\"";
    let (setup, refused) = (vivid_setup(""), vivid_setup("gain = 1000"));
    let mut board =
        Guest::boot(job, &[("setup.toml", setup.as_bytes()), ("refused.toml", refused.as_bytes())]);
    let told = board.expect("the control 'Gain'");
    println!("{told}");
    assert!(told.contains("is 255 after 1000 was written; it takes 0 to 255 in steps of 1"), "{told}");
    board.expect("board: refused with 1");
    board.expect("board: box ended with 0");
    board.wait();
    let said = Said::of(&std::fs::read(board.uart()).expect("records"));
    let (frames, woken) = (said.poses.len(), said.latency.wake_up.total() as usize);
    println!("{woken} of {frames} frames: {:?}", said.latency.wake_up);
    assert!(frames >= 2 * RATE_HZ as usize, "{frames}");
    // The module notes the end of a frame ahead of it: a time to come is none of the monotonic clock's, and is told.
    let is_told = said.has("clock is not monotonic");
    assert!(woken == frames || (woken < frames && is_told), "{woken} of {frames}, {:?}", said.events);
}

#[test]
#[ignore = "boots an emulated board; tests/board/prepare makes what it needs"]
fn a_box_at_1080p_stays_within_its_memory() {
    let mut setup = Show::new("").setup;
    for (from, to) in [("width_px = 800", "width_px = 1920"), ("height_px = 450", "height_px = 1080")] {
        assert!(setup.contains(from));
        setup = setup.replace(from, to);
    }
    let picture = vec![90; 1920 * 1080];
    // The kernel's buffers are of the device; with the program's own memory they are what the box takes.
    let job = format!(
        "insmod /modules/v4l2loopback.ko devices=1 video_nr=0 max_buffers=4
        feed /dev/video0 /frames.raw 1920 1080 {RATE_HZ} /tmp/go &
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
