//! A serial line that cannot carry everything: a terminal whose other end is read at 115,200 baud, in the
//! time of the frames and not of a clock.

use std::cmp::Ordering;
use std::collections::BTreeSet;
use std::convert::Infallible;
use std::io::Read as _;
use std::time::Duration;

use e2e::{Ride, engine};
use embedded_hal::digital::{ErrorType, OutputPin};
use gangway_device::{Camera, CameraErrorKind, Clock, Frame, Layout, Reading};
use gangway_engine::{Board, Inbox, Outbox};
use gangway_link::{Courier, Serial};
use gangway_wire::{Decoded, Decoder, Record, What};
use serialport::{SerialPort as _, TTYPort};

/// Ten bits a byte.
const BYTES_A_SECOND: usize = 11_520;

struct Pictures<'r> {
    ride: &'r Ride,
    number: u32,
    period_ns: u64,
}

impl Camera for Pictures<'_> {
    type Error = CameraErrorKind;

    fn next_frame(&mut self) -> Result<Frame<'_>, CameraErrorKind> {
        // To and fro, so that the motion has no jumps where the recording begins again.
        let last = self.ride.frames.len() - 1;
        let place = self.number as usize % (2 * last);
        let bytes = &self.ride.frames[if place <= last { place } else { 2 * last - place }];
        let (size, time_ns) = (self.ride.settings.picture, u64::from(self.number) * self.period_ns);
        self.number += 1;
        Frame::new(bytes, size, usize::from(size.0), Layout::GREY, self.number - 1, time_ns)
            .map_err(|_| CameraErrorKind::Corrupt)
    }
}

struct Still;

impl Clock for Still {
    fn now_ns(&self) -> u64 {
        0
    }

    fn utc_offset_ns(&self) -> Option<(i64, u64)> {
        None
    }
}

/// There is none, but it has a type.
struct TestLamp;

impl ErrorType for TestLamp {
    type Error = Infallible;
}

impl OutputPin for TestLamp {
    fn set_low(&mut self) -> Result<(), Infallible> {
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}

/// What came over the line.
#[derive(Debug, Default)]
struct Heard {
    poses: BTreeSet<u32>,
    markers: usize,
    /// Records that events say were left out.
    told: u64,
    damaged: u64,
    bytes: usize,
}

/// Plays `frames` frames at `rate_hz` over a line that is read at `bytes_a_second`; what came until nothing
/// was left, and how many records the courier thinned and the loop lost.
fn play(ride: &Ride, frames: u32, rate_hz: usize, bytes_a_second: usize) -> (Heard, u64, u64) {
    let (mut host, slave) = TTYPort::pair().expect("a terminal");
    host.set_timeout(Duration::from_secs(10)).expect("a timeout");
    let link = Serial::open(&slave.name().expect("its name"), 115_200).expect("the line");
    let mut engine = engine(&ride.settings);
    let (mut outbox, mut inbox) = (Box::new(Outbox::new()), Inbox::new());
    let ((mut put, taken), (given, mut commands)) = (outbox.split(), inbox.split());
    let mut courier = Courier::new(taken, given, link).thinning();
    let mut camera = Pictures { ride, number: 0, period_ns: 1_000_000_000 / rate_hz as u64 };
    let (mut heard, mut decoder) = (Heard::default(), Box::new(Decoder::new()));
    let mut lamps: Vec<TestLamp> = Vec::new();
    let (mut credit, mut steps) = (0, 0);
    loop {
        let board = &mut Board {
            camera: &mut camera,
            clock: &Still,
            vitals: &mut Reading::default(),
            lamps: &mut lamps,
        };
        match steps.cmp(&frames) {
            Ordering::Less => _ = engine.step(board, &mut commands, &mut put),
            Ordering::Equal => engine.end(board, &mut put),
            Ordering::Greater => {}
        }
        steps += 1;
        while courier.turn().expect("the line is there") {}
        // In the time of a frame so many bytes pass; a delimiter went ahead of the first record.
        credit += bytes_a_second / rate_hz;
        let waiting = courier.carried().bytes as usize + 1 - heard.bytes;
        let mut bytes = vec![0; credit.min(waiting)];
        host.read_exact(&mut bytes).expect("what was sent comes");
        credit = if bytes.len() == credit { 0 } else { bytes_a_second / rate_hz };
        heard.bytes += bytes.len();
        let mut bytes = bytes.as_slice();
        while !bytes.is_empty() {
            let (decoded, rest) = decoder.feed(bytes);
            bytes = rest;
            match decoded {
                Some(Decoded::Record { record: Record::Pose(pose), .. }) => {
                    heard.poses.insert(pose.frame);
                }
                Some(Decoded::Record { record: Record::Markers(_), .. }) => heard.markers += 1,
                Some(Decoded::Record { record: Record::Event(event), .. }) => {
                    if let What::QueueOverflow { count } = event.what {
                        heard.told += u64::from(count);
                    }
                }
                _ => {}
            }
        }
        if steps > frames && courier.left() == 0 && heard.bytes == courier.carried().bytes as usize + 1 {
            break;
        }
    }
    heard.damaged = decoder.counts().damaged;
    (heard, courier.carried().thinned, engine.records_lost().into())
}

#[test]
fn a_line_too_narrow_for_everything_loses_markers_and_no_pose() {
    let ride = Ride::short();
    // 130 frames a second of 15 circles are more than 115,200 baud carry; their poses alone are not.
    let (heard, thinned, lost) = play(&ride, 300, 130, BYTES_A_SECOND);
    println!("{} poses, {} centres records of 300; {thinned} left out", heard.poses.len(), heard.markers);
    assert_eq!(heard.poses, (0..300).collect(), "every pose");
    assert_eq!(lost, 0);
    assert!(thinned > 50 && heard.markers > 50, "{thinned} {}", heard.markers);
    assert_eq!(heard.markers as u64 + thinned, 300, "only centres were left out");
    // What was left out in the last moments is told to a loop that has ended.
    assert!(heard.told > 0 && heard.told <= thinned && thinned - heard.told < 100, "{} told", heard.told);
    assert_eq!(heard.damaged, 0);
}

#[test]
fn a_line_too_narrow_for_the_poses_alone_loses_them_last_and_says_so() {
    let ride = Ride::short();
    let (heard, thinned, lost) = play(&ride, 500, 100, BYTES_A_SECOND / 4);
    println!(
        "{} poses, {} centres records of 500; {thinned} left out, {lost} lost",
        heard.poses.len(),
        heard.markers
    );
    assert!(lost > 0 && heard.poses.len() < 500);
    assert!(heard.poses.len() > 2 * heard.markers, "centres go first");
    assert!(heard.told > 0 && heard.told <= thinned + lost, "{} told of {}", heard.told, thinned + lost);
    assert_eq!(heard.damaged, 0);
}
