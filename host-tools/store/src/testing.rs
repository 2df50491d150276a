//! Small rides for tests.

use gangway_wire::{
    Centres, Event, Hello, MAX_FRAME, Marker, Motion, Pose, PoseFlags, Record, SetupPiece, What, encode,
};

/// Frames a second of a test ride.
pub(crate) const RATE: u64 = 50;

/// Appends a record with its running number.
pub(crate) fn put(bytes: &mut Vec<u8>, sequence: &mut u32, record: &Record<'_>) {
    let mut line = [0; MAX_FRAME];
    let length = encode(record, *sequence, &mut line).unwrap();
    bytes.extend_from_slice(&line[..length]);
    *sequence += 1;
}

pub(crate) fn hello(session_id: u64) -> Record<'static> {
    Record::Hello(Hello {
        wire_version: 1,
        box_id: 0xb0,
        boot_id: 1,
        session_id,
        name: "ride",
        firmware: "0.1.0",
        setup_digest: [0; 16],
    })
}

pub(crate) fn pose(frame: u32) -> Pose {
    let motion = Motion {
        displacement_mm: [frame as f32 * 0.5, -1.25, 0.125],
        rotation_deg: [0.5, -0.25, 0.0625],
        sigma: [0.5, 0.25, 0.25, 0.0625, 0.0625, 0.03125],
        residual_px: 0.0625,
    };
    let waiting = frame < 3;
    Pose {
        frame,
        time_ns: u64::from(frame) * 1_000_000_000 / RATE,
        flags: if waiting { PoseFlags::WAITING } else { PoseFlags::default() },
        markers: 5,
        motion: (!waiting).then_some(motion),
    }
}

/// A ride as a box of the next version of the wire might send it.
pub(crate) fn foreign_ride() -> Vec<u8> {
    let (mut bytes, mut sequence) = (Vec::new(), 0);
    let Record::Hello(hello) = hello(1) else { return bytes };
    put(&mut bytes, &mut sequence, &Record::Hello(Hello { wire_version: 2, ..hello }));
    put(&mut bytes, &mut sequence, &Record::Pose(pose(0)));
    bytes
}

/// Hello, a setup, started, `frames` times pose and markers, ended.
pub(crate) fn ride(session_id: u64, frames: u32) -> Vec<u8> {
    ride_of(session_id, 0..frames)
}

/// A ride of these frames.
pub(crate) fn ride_of(session_id: u64, frames: impl Iterator<Item = u32>) -> Vec<u8> {
    let (mut bytes, mut sequence) = (Vec::new(), 0);
    let mut put = |record: &Record<'_>| put(&mut bytes, &mut sequence, record);
    put(&hello(session_id));
    put(&Record::Setup(SetupPiece { digest: [9; 16], index: 0, count: 2, text: "name = 'ride'" }));
    put(&Record::Event(Event { frame: 0, time_ns: 0, what: What::Started }));
    let mut next = 0;
    for frame in frames {
        next = frame + 1;
        put(&Record::Pose(pose(frame)));
        let mut centres = Centres::new();
        for circle in 0..5 {
            let at_px = [100.5 + f32::from(circle), 200.25];
            let marker = Marker { at_px, sigma_px: [0.03125, 0.0625], correlation: 0.5 };
            assert!(centres.push(circle, &marker, circle != 2));
        }
        put(&Record::Markers(centres.markers(frame)));
    }
    put(&Record::Event(Event { frame: next, time_ns: pose(next).time_ns, what: What::Ended }));
    bytes
}
