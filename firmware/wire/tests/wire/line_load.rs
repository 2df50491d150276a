//! The worst cases are reached by real records, and a serial line carries what it must.

use gangway_wire::*;

/// Bytes a second of a serial line: a start bit, eight data bits, a stop bit.
const fn bytes_a_second(baud: usize) -> usize {
    baud / 10
}

/// Length of the body, and of the frame with a number that has no zeros.
fn lengths(record: &Record) -> (usize, usize) {
    let mut line = [0; MAX_FRAME];
    let framed = encode(record, u32::MAX, &mut line).unwrap();
    (encode_body(record, &mut line).unwrap(), framed)
}

fn full_centres(circles: usize) -> Centres {
    let mut centres = Centres::new();
    // The last circles, so that the masks are at their longest.
    for circle in MAX_MARKERS - circles..MAX_MARKERS {
        assert!(centres.push(circle as u8, &Marker { at_px: [4095.9; 2], ..Marker::default() }, true));
    }
    centres
}

#[test]
fn no_record_is_longer_than_its_worst_case_and_some_record_is_as_long() {
    let text = "x".repeat(MAX_SETUP_PIECE);
    let reached = [
        (
            size::HELLO,
            Record::Hello(Hello {
                wire_version: u16::MAX,
                box_id: u64::MAX,
                boot_id: u64::MAX,
                session_id: u64::MAX,
                name: &text[..MAX_NAME],
                firmware: &text[..MAX_FIRMWARE],
                setup_digest: [255; 16],
            }),
        ),
        (
            size::SETUP,
            Record::Setup(SetupPiece { digest: [255; 16], index: u16::MAX, count: u16::MAX, text: &text }),
        ),
        (
            size::REST,
            Record::Rest(Rest {
                first_frame: u32::MAX,
                last_frame: u32::MAX,
                frames: u16::MAX,
                rotation: [f64::MAX; 4],
                translation_mm: [f64::MAX; 3],
                covariance: [f32::MAX; 21],
            }),
        ),
        (
            size::POSE,
            Record::Pose(Pose {
                frame: u32::MAX,
                time_ns: u64::MAX,
                flags: PoseFlags(u16::MAX),
                markers: u8::MAX,
                motion: Some(Motion {
                    displacement_mm: [f32::MAX; 3],
                    rotation_deg: [f32::MAX; 3],
                    sigma: [f32::MAX; 6],
                    residual_px: f32::MAX,
                }),
            }),
        ),
        (
            size::EVENT,
            Record::Event(Event {
                frame: u32::MAX,
                time_ns: u64::MAX,
                what: What::Mark { text: &text[..MAX_MARK] },
            }),
        ),
        (
            size::HEALTH,
            Record::Health(Health {
                time_ns: u64::MAX,
                frames: u32::MAX,
                frames_missed: u32::MAX,
                records_lost: u32::MAX,
                queue_high_water: u16::MAX,
                loop_time: [u16::MAX; LOOP_TIME_BUCKETS],
                loop_time_max_ns: u32::MAX,
                temperature_centi_c: Some(i16::MIN),
                free_bytes: Some(u64::MAX),
                latency: Some(Latency {
                    wake_up: Histogram { counts: [u16::MAX; LOOP_TIME_BUCKETS], longest_ns: u32::MAX },
                    exposure_to_line: Histogram {
                        counts: [u16::MAX; LOOP_TIME_BUCKETS],
                        longest_ns: u32::MAX,
                    },
                }),
            }),
        ),
        (
            size::TIME_SYNC,
            Record::TimeSync(TimeSync {
                time_ns: u64::MAX,
                utc_offset_ns: Some(i64::MIN),
                uncertainty_ns: u64::MAX,
            }),
        ),
        (size::PONG, Record::Pong(Pong { number: u32::MAX, host_time_ns: u64::MAX, time_ns: u64::MAX })),
        (size::SET_REST, Record::SetRest),
        (size::MARK, Record::Mark(Mark { text: &text[..MAX_MARK] })),
        (size::PING, Record::Ping(Ping { number: u32::MAX, host_time_ns: u64::MAX })),
    ];
    for (worst, record) in reached {
        let (body, framed) = lengths(&record);
        assert_eq!(size::framed(body), worst, "{record:?}");
        // Up to 254 bytes the stuffing takes one byte whatever they are.
        assert_eq!(framed, worst, "{record:?}");
        assert!(worst <= MAX_FRAME);
    }
    for circles in [1, 14, 15, 28, 64] {
        let (body, framed) = lengths(&Record::Markers(full_centres(circles).markers(u32::MAX)));
        assert_eq!(size::framed(body), size::markers(circles), "{circles} circles");
        // Beyond 254 bytes a zero in the right place can save a byte of stuffing.
        assert!(framed <= size::markers(circles), "{circles} circles");
    }
    assert_eq!(size::markers(MAX_MARKERS), MAX_FRAME);
}

#[test]
fn a_serial_line_carries_poses_and_markers() {
    let pose = size::POSE;
    let markers = size::markers(15);
    assert!(pose <= 72 && markers <= 175);
    // 115,200 baud: poses at 50 Hz and markers at 25 Hz leave 30 % for everything else.
    let load = 50 * pose + 25 * markers;
    assert!(load * 100 <= 70 * bytes_a_second(115_200), "{load} bytes/s");
    // 230,400 baud carry both at 50 Hz, again with room.
    let load = 50 * (pose + markers);
    assert!(load * 100 <= 70 * bytes_a_second(230_400), "{load} bytes/s");
}

#[test]
fn what_does_not_fit_is_refused_with_its_length() {
    let text = "x".repeat(MAX_SETUP_PIECE + 1);
    let mut line = [0; MAX_FRAME];
    let mark = Record::Mark(Mark { text: &text[..MAX_MARK + 1] });
    let error = encode(&mark, 0, &mut line).unwrap_err();
    assert_eq!(error, EncodeError::TooLong { what: "mark", length: 65, limit: 64 });
    assert_eq!(error.to_string(), "the mark has 65 bytes; at most 64 can be sent");
    let event = Record::Event(Event { frame: 0, time_ns: 0, what: What::Mark { text: &text[..65] } });
    assert!(matches!(encode(&event, 0, &mut line), Err(EncodeError::TooLong { .. })));
    let piece = Record::Setup(SetupPiece { digest: [0; 16], index: 0, count: 1, text: &text });
    assert!(matches!(encode(&piece, 0, &mut line), Err(EncodeError::TooLong { limit: 192, .. })));
    let markers = Markers { frame: 0, visible: 3, used: 1, packed: &[0; 9] };
    assert_eq!(encode(&Record::Markers(markers), 0, &mut line), Err(EncodeError::Masks));
    let markers = Markers { frame: 0, visible: 1, used: 2, packed: &[0; 9] };
    assert_eq!(encode(&Record::Markers(markers), 0, &mut line), Err(EncodeError::Masks));
    for room in 0..size::SET_REST {
        assert_eq!(encode(&Record::SetRest, u32::MAX, &mut line[..room]), Err(EncodeError::Room));
    }
    assert_eq!(encode(&Record::SetRest, u32::MAX, &mut line[..size::SET_REST]), Ok(size::SET_REST));
}
