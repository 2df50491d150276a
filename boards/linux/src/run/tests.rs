//! A box without a camera: its watchdog, its lamps, its log.

use std::convert::Infallible;
use std::os::unix::net::UnixDatagram;
use std::sync::Arc;

use embedded_hal::digital::{ErrorType, OutputPin};
use gangway_device::Frame;
use gangway_engine::Identity;
use gangway_link::Address;
use gangway_setup::Setup;

use super::*;

/// A camera that never comes.
struct Away;

impl Camera for Away {
    type Error = CameraErrorKind;

    fn next_frame(&mut self) -> Result<Frame<'_>, CameraErrorKind> {
        thread::sleep(Duration::from_millis(1));
        Err(CameraErrorKind::Waiting)
    }
}

/// A lamp that somebody has lit.
struct Lit(Arc<AtomicBool>);

impl ErrorType for Lit {
    type Error = Infallible;
}

impl OutputPin for Lit {
    fn set_low(&mut self) -> Result<(), Infallible> {
        self.0.store(false, Ordering::Release);
        Ok(())
    }
    fn set_high(&mut self) -> Result<(), Infallible> {
        self.0.store(true, Ordering::Release);
        Ok(())
    }
}

/// Runs a box without a camera. `slow` is told how many signs of life systemd has heard. Tells whether the
/// lamp still shines, and all that systemd heard.
fn play(mut slow: impl FnMut(&Signals, usize)) -> (bool, Vec<String>, thread::Result<Summary>) {
    let place = tempfile::tempdir().unwrap();
    let socket = UnixDatagram::bind(place.path().join("notify")).unwrap();
    socket.set_nonblocking(true).unwrap();
    let is_lit = Arc::new(AtomicBool::new(true));
    let text = include_str!("../../../setup/examples/ride.toml");
    let settings = Setup::parse(text, "ride.toml").unwrap().settings();
    let identity = Identity { box_id: 1, boot_id: 2, session_id: 3, firmware: "test" };
    // Its copies while it is made are more than a test's own thread has room for.
    let roomy = thread::Builder::new().stack_size(8 << 20);
    let engine = roomy.spawn(move || Engine::new(settings, identity).map(Box::new)).unwrap();
    let (signals, status, next) = (Signals::default(), Status::default(), Next::default());
    let (notices, said) = Notices::channel();
    let name = place.path().join("notify");
    let parts = Parts {
        engine: engine.join().unwrap().unwrap(),
        camera: Away,
        lamps: vec![Lit(Arc::clone(&is_lit))],
        line: Address::File(place.path().join("box.gw")).open().unwrap(),
        log: Some(log::file(place.path(), 3).unwrap()),
        vitals: SystemVitals::new(place.path()),
        watchdog: Watchdog::new(Some(name.as_os_str()), Some(Duration::from_millis(200))),
        board: BoardSettings { realtime_priority: 0, ..BoardSettings::default() },
        next: &next,
        signals: &signals,
        status: &status,
        notices,
        said,
    };
    let mut heard: Vec<String> = Vec::new();
    let hear = |heard: &mut Vec<String>| {
        let mut bytes = [0; 64];
        while let Ok(count) = socket.recv(&mut bytes) {
            heard.push(String::from_utf8_lossy(&bytes[..count]).into_owned());
        }
    };
    let ended = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
        let turn = || {
            hear(&mut heard);
            slow(&signals, heard.iter().filter(|heard| *heard == "WATCHDOG=1").count());
        };
        run(parts, turn, &|_| {}).unwrap()
    }));
    hear(&mut heard);
    let kept = std::fs::read(place.path().join("0000000000000003.gw")).unwrap();
    assert_eq!(kept, std::fs::read(place.path().join("box.gw")).unwrap(), "the log is what was sent");
    (is_lit.load(Ordering::Acquire), heard, ended)
}

#[test]
fn a_box_without_a_camera_lives_for_its_watchdog_and_ends_dark() {
    let (is_lit, heard, ended) = play(|signals, signs| {
        if signs > 2 {
            signals.stop();
        }
    });
    assert!(!is_lit);
    assert_eq!(heard.first().map(String::as_str), Some("READY=1"));
    assert_eq!(heard.last().map(String::as_str), Some("STOPPING=1"));
    let summary = ended.unwrap();
    assert_eq!((summary.frames, summary.unsent), (0, 0));
    assert!(summary.carried.records > 3, "it announced itself: {summary:?}");
}

#[test]
fn a_panic_in_another_thread_leaves_every_lamp_dark() {
    let (is_lit, _, ended) = play(|_, _| panic!("on purpose"));
    assert!(!is_lit);
    assert!(ended.is_err(), "and is not hidden");
}
