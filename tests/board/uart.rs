//! Records over a real UART.

use std::time::{Duration, Instant};

use e2e::guest::Guest;

use crate::receiver::Receiver;
use crate::said::Said;
use crate::show::{Show, job};

#[test]
#[ignore = "boots an emulated board; tests/board/prepare makes what it needs"]
fn records_come_over_the_uart_too() {
    let folder = tempfile::tempdir().expect("a folder");
    let show = Show::new("");
    let job = "gangway-pi check --setup /setup.toml --to serial:/dev/ttyAMA0@50000000\n".to_owned()
        + &job("serial:/dev/ttyAMA0@115200")
        + "read go
        kill -TERM $BOX; wait $BOX; echo \"board: box ended with $?\"
        kill $FEED";
    let mut board = show.boot(&job);
    let heard = |board: &Guest| Said::of(&std::fs::read(board.uart()).unwrap_or_default()).poses.len();
    // Its clock gives 3 million baud at most.
    let refused = board.expect("line: ");
    assert!(
        refused.starts_with("no    line: ") && refused.contains("it cannot do 50000000 baud"),
        "{refused}"
    );
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
