//! Lamps in the registers of the emulated pins: what they do, and that they are dark whenever the box does
//! not measure.

use std::time::Duration;

use e2e::guest::Guest;

use crate::said::Said;
use crate::show::{Show, camera};

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
    let job = camera()
        + &format!(
            "{start}; {LIGHT}; echo 'board: lit'; read go
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
    let job = camera()
        + "gangway-pi run --setup /setup.toml --to file:/tmp/box.gw & BOX=$!; sleep 6
        echo 'board: drives'; read go
        kill -TERM $BOX; wait $BOX; echo 'board: ended'; read go
        kill $FEED";
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
fn a_lamp_on_the_gpio_character_device_is_lit_and_dark_again_when_it_is_given_back() {
    let job = "lamp /dev/gpiochip0 17; echo 'board: given back'; read go";
    let mut board = Guest::boot(job, &[]);
    board.expect("lamp: lit");
    assert_eq!(board.word(GPLEV0) & LAMP, LAMP);
    board.go();
    board.expect("board: given back");
    assert_eq!(board.word(GPLEV0) & LAMP, 0);
    board.go();
    board.wait();
}

/// Pin 23 as an output, by whose latch the level of the button's input is made: GPFSEL2, GPSET0 and GPCLR0.
const BUTTON: &str = "
    latch() { devmem 0x3f200008 32 0x200; devmem $1 32 0x800000; }
    release() { latch 0x3f20001c; }
    press() { latch 0x3f200028; sleep $1; release; sleep 1; }
";

#[test]
#[ignore = "boots an emulated board; tests/board/prepare makes what it needs"]
fn a_short_press_of_the_button_sets_the_rest_pose_and_long_ones_mark_start_and_end() {
    let show = Show::new("[board]\nbutton_pin = 23\n");
    let job = BUTTON.to_owned()
        + &camera()
        + "release
        gangway-pi run --setup /setup.toml --to serial:/dev/ttyAMA0@115200 & BOX=$!; sleep 8
        press 0.3; press 3; press 3; sleep 4
        kill -TERM $BOX; wait $BOX; echo \"board: box ended with $?\"
        kill $FEED";
    let mut board = show.boot(&job);
    board.expect("board: box ended with 0");
    board.wait();
    let said = Said::of(&std::fs::read(board.uart()).expect("records"));
    let pressed: Vec<&str> = said
        .events
        .iter()
        .map(|(_, event)| event.as_str())
        .filter(|event| *event == "RestRequested" || event.contains("\"start\"") || event.contains("\"end\""))
        .collect();
    let [rest, start, end] = pressed.as_slice() else { panic!("{:?}", said.events) };
    assert!(*rest == "RestRequested" && start.contains("start") && end.contains("end"), "{pressed:?}");
}

/// A chip in the place of the board's own: pins that are pulled from outside, for QEMU raises no interrupts
/// of a pin.
const PULLED: &str = "
    insmod /modules/pulled.ko || exit 1
    mv $(ls /dev/gpiochip* | tail -n 1) /dev/gpiochip0
    PULL=/sys/module/pulled/parameters/pull
    pull() { echo \"24 $1\" >$PULL; echo \"board: pulled $(cat $PULL)\"; sleep 0.4; }
";

#[test]
#[ignore = "boots an emulated board; tests/board/prepare makes what it needs"]
fn edges_of_the_sync_input_are_in_the_records_with_the_time_at_which_the_pin_was_pulled() {
    let show = Show::new("[board]\nsync_pin = 24\n");
    let job = PULLED.to_owned()
        + &camera()
        + "gangway-pi run --setup /setup.toml --to serial:/dev/ttyAMA0@115200 & BOX=$!; sleep 8
        for level in 1 0 1 0 1 1 0; do pull $level; done; sleep 4
        kill -TERM $BOX; wait $BOX; echo \"board: box ended with $?\"
        kill $FEED";
    let mut board = show.boot(&job);
    board.expect("board: box ended with 0");
    board.wait();
    // Pin, level, and the monotonic clock's time before and after the pull.
    let pulls = board.log.iter().filter_map(|line| line.strip_prefix("board: pulled 24 ")).map(|pull| {
        let numbers: Vec<u64> = pull.split(' ').map(|number| number.parse().expect("a number")).collect();
        let [level, before_ns, after_ns] = numbers.as_slice() else { panic!("{pull}") };
        (if *level == 1 { "rise" } else { "fall" }, *before_ns..=*after_ns)
    });
    let mut pulls: Vec<_> = pulls.collect();
    assert_eq!(pulls.len(), 7);
    // Pulled up where it was up already: no edge.
    pulls.remove(5);

    let said = Said::of(&std::fs::read(board.uart()).expect("records"));
    let edges: Vec<(&str, u64)> = said
        .events
        .iter()
        .filter_map(|(_, event)| event.split_once("sync ")?.1.split_once('"')?.0.split_once(' '))
        .map(|(way, ns)| (way, ns.parse().expect("a time")))
        .collect();
    println!("edges {edges:?} of pulls {pulls:?}");
    assert_eq!(edges.len(), pulls.len(), "{:?}", said.events);
    for ((way, ns), (pulled, time_ns)) in edges.iter().zip(&pulls) {
        assert_eq!(way, pulled);
        assert!(time_ns.contains(ns), "the {way} at {ns} ns, pulled at {time_ns:?}");
    }
    assert!(edges.is_sorted_by(|one, next| one.1 < next.1));
}
