//! Golden bytes: every record, field by field. They pin the wire; a change here breaks every capture ever
//! made.
//!
//! The checksums were computed by zlib, so that they judge this crate.

use gangway_wire::*;

/// The frames of all golden records, in the order of this file, with running numbers from 0.
const CAPTURE: &[u8] = include_bytes!("version_1.gw");
/// Likewise, of records with fields that came behind those of the first capture.
const BEHIND: &[u8] = include_bytes!("version_1_behind.gw");

/// Checks `record`, number `sequence` of the golden capture, against its body's fields and its checksum.
fn check(record: &Record, sequence: u32, kind: u8, fields: &[&[u8]], checksum: u32) {
    check_in(CAPTURE, record, sequence, kind, fields, checksum);
}

fn check_in(capture: &[u8], record: &Record, sequence: u32, kind: u8, fields: &[&[u8]], checksum: u32) {
    let line = check_bytes(record, sequence, kind, fields, checksum);
    assert_eq!(capture.split_inclusive(|&byte| byte == 0).nth(sequence as usize), Some(&line[..]));
}

/// The same for a record that is younger than the captures; its bytes on the line.
fn check_bytes(record: &Record, sequence: u32, kind: u8, fields: &[&[u8]], checksum: u32) -> Vec<u8> {
    let expected = fields.concat();
    let mut body = [0; MAX_FRAME];
    let length = encode_body(record, &mut body).unwrap();
    assert_eq!(body[..length], expected, "body of {record:?}");
    assert_eq!(record.kind(), kind);

    let mut line = [0; MAX_FRAME];
    let length = encode(record, sequence, &mut line).unwrap();
    // Unstuffed by another implementation.
    let mut raw = [0; MAX_FRAME];
    let unstuffed = cobs::decode(&line[..length - 1], &mut raw).unwrap();
    let whole = [&sequence.to_le_bytes()[..], &[kind], &expected, &checksum.to_le_bytes()].concat();
    assert_eq!(raw[..unstuffed.frame_size()], whole, "frame of {record:?}");
    assert_eq!(line[length - 1], 0);

    let mut decoder = Decoder::new();
    let (decoded, rest) = decoder.feed(&line[..length]);
    let record = record.clone();
    assert_eq!(decoded, Some(Decoded::Record { sequence, kind, body: &expected, record, newer: false }));
    assert!(rest.is_empty());
    line[..length].to_vec()
}

#[test]
fn hello() {
    let record = Record::Hello(Hello {
        wire_version: 1,
        box_id: 0x0123_4567_89AB_CDEF,
        boot_id: 3,
        session_id: 0xFF00_0000_0000_0001,
        name: "Zug 7ä",
        firmware: "0.1.0",
        setup_digest: *b"0123456789abcdef",
    });
    let fields: &[&[u8]] = &[
        &[1],                                              // wire version 1
        &[0xEF, 0xCD, 0xAB, 0x89, 0x67, 0x45, 0x23, 0x01], // box
        &[3, 0, 0, 0, 0, 0, 0, 0],                         // boot
        &[1, 0, 0, 0, 0, 0, 0, 0xFF],                      // session
        &[7, b'Z', b'u', b'g', b' ', b'7', 0xC3, 0xA4],    // name: 7 bytes of UTF-8
        &[5, b'0', b'.', b'1', b'.', b'0'],                // firmware
        &[0x30, 0x31, 0x32, 0x33, 0x34, 0x35, 0x36, 0x37], // digest, first half
        &[0x38, 0x39, 0x61, 0x62, 0x63, 0x64, 0x65, 0x66], // digest, second half
    ];
    check(&record, 0, 1, fields, 0xF071_AD15);
}

#[test]
fn setup() {
    let text = "[camera]\nwidth_px = 1920\n";
    let record = Record::Setup(SetupPiece { digest: [0x5A; 16], index: 1, count: 300, text });
    let fields: &[&[u8]] = &[
        &[0x5A; 16],   // digest
        &[1],          // index 1
        &[0xAC, 0x02], // count 300 = 0x2C + 2 * 128
        &[25],         // 25 bytes of text
        text.as_bytes(),
    ];
    check(&record, 1, 2, fields, 0x8F1D_B65C);
}

#[test]
fn rest() {
    let mut covariance = [0.0; 21];
    covariance[0] = 1.0;
    covariance[20] = -0.5;
    let record = Record::Rest(Rest {
        first_frame: 100,
        last_frame: 129,
        frames: 10,
        rotation: [1.0, 0.0, -0.5, 0.25],
        translation_mm: [1500.0, 0.1, -2.0],
        covariance,
    });
    let fields: &[&[u8]] = &[
        &[100],                                            // first frame
        &[0x81, 0x01],                                     // last frame 129
        &[10],                                             // frames
        &[0, 0, 0, 0, 0, 0, 0xF0, 0x3F],                   // w = 1
        &[0; 8],                                           // x = 0
        &[0, 0, 0, 0, 0, 0, 0xE0, 0xBF],                   // y = -0.5
        &[0, 0, 0, 0, 0, 0, 0xD0, 0x3F],                   // z = 0.25
        &[0, 0, 0, 0, 0, 0x70, 0x97, 0x40],                // 1500 mm
        &[0x9A, 0x99, 0x99, 0x99, 0x99, 0x99, 0xB9, 0x3F], // 0.1 mm
        &[0, 0, 0, 0, 0, 0, 0x00, 0xC0],                   // -2 mm
        &[0, 0, 0x80, 0x3F],                               // variance of x: 1 mm^2
        &[0; 19 * 4],                                      // the next 19 of the upper triangle
        &[0, 0, 0x00, 0xBF],                               // the last one: -0.5
    ];
    check(&record, 2, 3, fields, 0xB6FB_996D);
}

#[test]
fn pose() {
    let record = Record::Pose(Pose {
        frame: 50_000,
        time_ns: 1_000_000_000_000,
        flags: PoseFlags::OUTLIERS | PoseFlags::AFTER_GAP,
        markers: 14,
        motion: Some(Motion {
            displacement_mm: [1.5, -20.25, 0.0],
            rotation_deg: [-0.1, 4.0, 15.0],
            sigma: [1.0, 0.5, 2.0, 0.0, f32::INFINITY, 0.011_718_75],
            residual_px: 0.125,
        }),
    });
    let fields: &[&[u8]] = &[
        &[0xD0, 0x86, 0x03],                      // frame 50,000 = 0x50 + 6 * 128 + 3 * 16,384
        &[0x00, 0x10, 0xA5, 0xD4, 0xE8, 0, 0, 0], // 10^12 ns
        &[0x50],                                  // flags: bits 4 and 6
        &[14],                                    // circles used
        &[1],                                     // there is a motion
        &[0, 0, 0xC0, 0x3F],                      // x = 1.5 mm
        &[0, 0, 0xA2, 0xC1],                      // y = -20.25 mm
        &[0, 0, 0, 0],                            // z = 0 mm
        &[0xCD, 0xCC, 0xCC, 0xBD],                // roll = -0.1 degrees
        &[0, 0, 0x80, 0x40],                      // pitch = 4 degrees
        &[0, 0, 0x70, 0x41],                      // yaw = 15 degrees
        &[0x00, 0x7F],                            // sigma x = 1: 0x3F800000 >> 15
        &[0x00, 0x7E],                            // sigma y = 0.5
        &[0x00, 0x80],                            // sigma z = 2
        &[0, 0],                                  // sigma roll = 0
        &[0x00, 0xFF],                            // sigma pitch is infinite
        &[0x80, 0x78],                            // sigma yaw = 0.01171875 = 1.5 / 128
        &[0x00, 0x7C],                            // residual = 0.125 px
    ];
    check(&record, 3, 4, fields, 0x09FB_6214);
}

#[test]
fn pose_without_a_motion() {
    let record = Record::Pose(Pose {
        frame: 7,
        time_ns: 255,
        flags: PoseFlags::FEW_MARKERS | PoseFlags::CORRUPT,
        markers: 3,
        motion: None,
    });
    let fields: &[&[u8]] = &[
        &[7],                         // frame
        &[0xFF, 0, 0, 0, 0, 0, 0, 0], // time
        &[0x82, 0x01],                // flags: bits 1 and 7, 130 = 2 + 1 * 128
        &[3],                         // circles
        &[0],                         // no motion
    ];
    check(&record, 4, 4, fields, 0x53CA_A729);
}

#[test]
fn markers() {
    let mut centres = Centres::new();
    let first = Marker { at_px: [956.5, 4095.999], sigma_px: [1.0, 0.015_625], correlation: 0.5 };
    let second = Marker { at_px: [-0.25, 0.0], sigma_px: [f32::INFINITY, 0.0], correlation: -1.0 };
    assert!(centres.push(0, &first, true));
    assert!(centres.push(9, &second, false));
    let record = Record::Markers(centres.markers(50_000));
    let fields: &[&[u8]] = &[
        &[0xD0, 0x86, 0x03], // frame 50,000
        &[0x81, 0x04],       // seen: bits 0 and 9, 513 = 1 + 4 * 128
        &[0x01],             // used: bit 0
        &[18],               // 18 bytes of centres
        &[0x00, 0xF2, 0x0E], // circle 0: u = 956.5 px * 1024 = 979,456
        &[0xFF, 0xFF, 0x3F], //           v = 4095 + 1023/1024 px
        &[192],              //           sigma u = 2^0 px
        &[96],               //           sigma v = 2^-6 px
        &[64],               //           correlation 64/128
        &[0x00, 0xFF, 0xFF], // circle 9: u = -256/1024 px
        &[0, 0, 0],          //           v = 0 px
        &[255],              //           sigma u not known
        &[0],                //           sigma v at most 2^-12 px
        &[0x81],             //           correlation -127/128
    ];
    check(&record, 5, 5, fields, 0xAA76_8DCD);
}

/// Frame 300 at 2^32 ns, as every golden event starts: 300 = 0x2C + 2 * 128.
const EVENT_START: &[u8] = &[0xAC, 0x02, 0, 0, 0, 0, 1, 0, 0, 0];

#[test]
fn every_event() {
    use LostReason::*;
    let events: [(What, &[u8], u32); 28] = [
        (What::Started, &[1], 0xE5E2_66C5),
        (What::Ended, &[2], 0xD283_A6EE),
        (What::MarkerLost { circle: 14, reason: OutsidePicture }, &[3, 14, 0], 0xD7AF_FB12),
        (What::MarkerLost { circle: 14, reason: LowContrast }, &[3, 14, 1], 0x4FFA_7D65),
        (What::MarkerLost { circle: 14, reason: NotFound }, &[3, 14, 2], 0x3C75_F1BD),
        (What::MarkerLost { circle: 14, reason: CutByPicture }, &[3, 14, 3], 0xA420_77CA),
        (What::MarkerLost { circle: 14, reason: CutByWindow }, &[3, 14, 4], 0xDB6A_E80D),
        (What::MarkerLost { circle: 14, reason: Saturated }, &[3, 14, 5], 0x433F_6E7A),
        (What::MarkerLost { circle: 14, reason: Outline }, &[3, 14, 6], 0x30B0_E2A2),
        (What::MarkerLost { circle: 14, reason: Neighbour }, &[3, 14, 7], 0xA8E5_64D5),
        (What::MarkerLost { circle: 14, reason: Residual }, &[3, 14, 8], 0xE086_8134),
        (What::MarkerLost { circle: 14, reason: Other }, &[3, 14, 255], 0x2C0D_506A),
        (What::MarkerFound { circle: 200 }, &[4, 200], 0xB578_3BA1),
        (What::MarkerStillLost { circle: 0, reason: NotFound }, &[5, 0, 2], 0x70DB_E474),
        (What::FramesMissed { count: 129 }, &[6, 0x81, 0x01], 0x2822_A8F9),
        (What::FrameRepeated, &[7], 0xC36E_499C),
        (What::FrameCorrupt, &[8], 0x7A19_E0FF),
        (What::RestSet { frames: 250 }, &[9, 0xFA, 0x01], 0x0533_929B),
        (What::RestRequested, &[10], 0xB495_7778),
        (What::LightChanged { percent: 37 }, &[11, 37], 0x59D1_ADB1),
        (What::QueueOverflow { count: u32::MAX }, &[12, 0xFF, 0xFF, 0xFF, 0xFF, 0x0F], 0x19E6_2282),
        (What::CameraStalled, &[13], 0x0339_5629),
        (What::CameraLost, &[14], 0x67C9_FFE6),
        (What::CameraReopened, &[15], 0xBEA6_5EE1),
        (What::Mark { text: "Brücke" }, &[16, 7, b'B', b'r', 0xC3, 0xBC, b'c', b'k', b'e'], 0x858D_F81A),
        (What::Mark { text: "" }, &[16, 0], 0x1CD7_0564),
        (What::CommandRefused { kind: 140 }, &[17, 140], 0x1EB2_637C),
        (What::SetupChanged, &[18], 0x8B9A_A413),
    ];
    for (sequence, (what, fields, checksum)) in (6..).zip(events) {
        let record = Record::Event(Event { frame: 300, time_ns: 1 << 32, what });
        check(&record, sequence, 6, &[EVENT_START, fields], checksum);
        assert_eq!(what.number(), fields[0]);
    }
}

#[test]
fn lamps_and_exposure() {
    let dark = Pose {
        frame: 7,
        time_ns: 3,
        flags: PoseFlags::FEW_MARKERS | PoseFlags::DARK | PoseFlags::SWITCHED,
        markers: 0,
        motion: None,
    };
    let fields: &[&[u8]] = &[
        &[7],                      // frame
        &[3, 0, 0, 0, 0, 0, 0, 0], // time
        &[0x82, 0x0C],             // flags: bits 1, 9 and 10, 1538 = 2 + 12 * 128
        &[0],                      // circles used
        &[0],                      // no motion
    ];
    check(&Record::Pose(dark), 42, 4, fields, 0x75D3_6E95);
    let events: [(What, &[u8], u32); 2] = [
        (What::MarkerLost { circle: 2, reason: LostReason::Unlit }, &[3, 2, 9], 0xB506_69E8),
        // 4,000 us and a gain of 2.5.
        (
            What::ExposureChanged { exposure_us: 4000, gain_permille: 2500 },
            &[19, 0xA0, 0x1F, 0xC4, 0x13],
            0xB655_6B28,
        ),
    ];
    for (sequence, (what, fields, checksum)) in (43..).zip(events) {
        let record = Record::Event(Event { frame: 300, time_ns: 1 << 32, what });
        check(&record, sequence, 6, &[EVENT_START, fields], checksum);
        assert_eq!(what.number(), fields[0]);
    }
}

#[test]
fn events_and_flags_of_a_moved_camera() {
    use MoveEvidence::*;
    let events: [(What, &[u8], u32); 5] = [
        (
            What::CameraMoved { evidence: References, shift_mm: 2.0, turn_deg: 0.25 },
            &[24, 0, 0, 0, 0, 0x40, 0, 0, 0x80, 0x3E],
            0xCE59_2681,
        ),
        (
            What::CameraMoved { evidence: Shock, shift_mm: 2.0, turn_deg: 0.25 },
            &[24, 1, 0, 0, 0, 0x40, 0, 0, 0x80, 0x3E],
            0x7CA9_A2CC,
        ),
        (
            What::CameraMoved { evidence: Standing, shift_mm: 2.0, turn_deg: 0.25 },
            &[24, 2, 0, 0, 0, 0x40, 0, 0, 0x80, 0x3E],
            0x8B74_62A1,
        ),
        (
            What::CameraMoved { evidence: Other, shift_mm: 2.0, turn_deg: 0.25 },
            &[24, 255, 0, 0, 0, 0x40, 0, 0, 0x80, 0x3E],
            0x4946_D662,
        ),
        (What::CameraShaking { shift_mm: 0.5, turn_deg: 0.0 }, &[25, 0, 0, 0, 0x3F, 0, 0, 0, 0], 0x1C08_1039),
    ];
    for (sequence, (what, fields, checksum)) in (42..).zip(events) {
        let record = Record::Event(Event { frame: 300, time_ns: 1 << 32, what });
        check_bytes(&record, sequence, 6, &[EVENT_START, fields], checksum);
        assert_eq!(what.number(), fields[0]);
    }
    let flags = PoseFlags::SPARSE | PoseFlags::CAMERA_MOVED | PoseFlags::UNREFERENCED;
    let record = Record::Pose(Pose { frame: 1, time_ns: 2, flags, markers: 0, motion: None });
    let fields: &[&[u8]] = &[
        &[1],                      // frame
        &[2, 0, 0, 0, 0, 0, 0, 0], // time
        &[0x80, 0x62],             // flags: bits 8, 12 and 13: 0x62 * 128 = 12,544
        &[0, 0],                   // no circles, no motion
    ];
    check_bytes(&record, 47, 4, fields, 0x4229_B261);
}

#[test]
fn health() {
    let mut loop_time = [0; LOOP_TIME_BUCKETS];
    (loop_time[1], loop_time[11], loop_time[15]) = (1, 49, 200);
    let record = Record::Health(Health {
        time_ns: 2,
        frames: 50_000,
        frames_missed: 1,
        records_lost: 0,
        queue_high_water: 128,
        loop_time,
        loop_time_max_ns: 2_100_000,
        temperature_centi_c: Some(-1250),
        free_bytes: Some(64 << 30),
        latency: None,
    });
    let fields: &[&[u8]] = &[
        &[2, 0, 0, 0, 0, 0, 0, 0],                       // time
        &[0xD0, 0x86, 0x03],                             // frames 50,000
        &[1],                                            // frames missed
        &[0],                                            // records lost
        &[0x80, 0x01],                                   // queue high water 128
        &[0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 49, 0, 0, 0], // loop times, buckets 0 to 14
        &[0xC8, 0x01],                                   // loop times, bucket 15: 200
        &[0xA0, 0x96, 0x80, 0x01],                       // longest: 2,100,000 ns
        &[1, 0xC3, 0x13],                                // -12.50 degrees: zigzag of -1250 is 2499
        &[1, 0x80, 0x80, 0x80, 0x80, 0x80, 0x02],        // 2^36 bytes free
    ];
    check(&record, 34, 7, fields, 0xE826_6893);

    let record = Record::Health(Health::default());
    // Time, three counts, high water, histogram, maximum, and the tags of two fields that are not there.
    check(&record, 35, 7, &[&[0; 8 + 3 + 1 + 16 + 1 + 2]], 0xAF30_1947);
}

#[test]
fn health_with_latencies() {
    let (mut wake_up, mut exposure_to_line) = (Histogram::default(), Histogram::default());
    for ns in [700, 40_000, 41_000] {
        wake_up.note(ns, WAKE_UP_BITS);
    }
    for _ in 0..200 {
        exposure_to_line.note(30_000_000, EXPOSURE_TO_LINE_BITS);
    }
    let latency = Some(Latency { wake_up, exposure_to_line });
    let record = Record::Health(Health { time_ns: 2, frames: 3, latency, ..Health::default() });
    let fields: &[&[u8]] = &[
        &[2, 0, 0, 0, 0, 0, 0, 0],                         // time
        &[3],                                              // frames
        &[0; 2 + 1 + 16 + 1 + 2],                          // as in a record without them
        &[1, 0, 0, 0, 0, 0, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0], // wake-up: 512 ns on, 32,768 ns on
        &[0xA8, 0xC0, 0x02],                               // longest: 41,000 ns
        &[0, 0, 0, 0, 0, 0, 0, 0, 0xC8, 0x01],             // exposure to line, buckets 0 to 8: 16.8 ms on
        &[0; 7],                                           // buckets 9 to 15
        &[0x80, 0x87, 0xA7, 0x0E],                         // longest: 30,000,000 ns
    ];
    check_in(BEHIND, &record, 0, 7, fields, 0xF68D_61FE);
}

#[test]
fn time_sync() {
    let record = Record::TimeSync(TimeSync {
        time_ns: 0x0102_0304_0506_0708,
        utc_offset_ns: Some(1_700_000_000_000_000_000),
        uncertainty_ns: 1000,
    });
    let fields: &[&[u8]] = &[
        &[8, 7, 6, 5, 4, 3, 2, 1],                               // time
        &[1],                                                    // UTC is known
        &[0x80, 0x80, 0xD0, 0xE2, 0xC6, 0xBF, 0xCE, 0x97, 0x2F], // zigzag of 1.7 * 10^18 ns
        &[0xE8, 0x07],                                           // uncertainty 1000 ns
    ];
    check(&record, 36, 8, fields, 0x85AF_4F00);

    let record = Record::TimeSync(TimeSync { time_ns: 1, utc_offset_ns: None, uncertainty_ns: 0 });
    let fields: &[&[u8]] = &[
        &[1, 0, 0, 0, 0, 0, 0, 0], // time
        &[0],                      // UTC is not known
        &[0],                      // uncertainty
    ];
    check(&record, 37, 8, fields, 0x3990_0989);
}

#[test]
fn ping_and_pong() {
    let record = Record::Pong(Pong { number: 128, host_time_ns: 5, time_ns: 6 });
    let fields: &[&[u8]] = &[
        &[0x80, 0x01],             // number 128
        &[5, 0, 0, 0, 0, 0, 0, 0], // the host's clock
        &[6, 0, 0, 0, 0, 0, 0, 0], // the box's clock
    ];
    check(&record, 38, 9, fields, 0xD637_3E28);

    let record = Record::Ping(Ping { number: 128, host_time_ns: 5 });
    let fields: &[&[u8]] = &[
        &[0x80, 0x01],             // number 128
        &[5, 0, 0, 0, 0, 0, 0, 0], // the host's clock
    ];
    check(&record, 39, 130, fields, 0x5204_AD1B);
}

#[test]
fn set_rest_and_mark() {
    check(&Record::SetRest, 40, 128, &[], 0xDA2B_10F8);
    let record = Record::Mark(Mark { text: "end" });
    check(&record, 41, 129, &[&[3, b'e', b'n', b'd']], MARK_CRC);
}

#[test]
fn the_golden_capture_is_read_to_its_end() {
    let (found, counts) = crate::capture::decode(CAPTURE, || 11);
    assert_eq!(counts, Counts { records: 45, ..Counts::default() });
    assert_eq!(found.len(), 45);
}

#[test]
fn a_frame_byte_by_byte() {
    let mut line = [0; MAX_FRAME];
    let length = encode(&Record::Mark(Mark { text: "end" }), 41, &mut line).unwrap();
    let fields: &[&[u8]] = &[
        &[2],                    // block: one byte, then a zero
        &[41],                   // sequence 41
        &[1],                    // block: nothing, then a zero
        &[1],                    // block: nothing, then a zero
        &[10],                   // block: nine bytes, then the frame's end
        &[129],                  // kind
        &[3, b'e', b'n', b'd'],  // body
        &MARK_CRC.to_le_bytes(), // checksum, no zero in it
        &[0],                    // delimiter
    ];
    assert_eq!(line[..length], fields.concat());
    assert!(SPECIFICATION.contains("02 29 01 01 0A 81 03 65 6E 64"), "the specification shows these bytes");
}

#[test]
fn the_specification_gives_every_number() {
    let kinds = [
        ("Hello", kind::HELLO),
        ("Setup", kind::SETUP),
        ("Rest", kind::REST),
        ("Pose", kind::POSE),
        ("Markers", kind::MARKERS),
        ("Event", kind::EVENT),
        ("Health", kind::HEALTH),
        ("TimeSync", kind::TIME_SYNC),
        ("Pong", kind::PONG),
        ("SetRest", kind::SET_REST),
        ("Mark", kind::MARK),
        ("Ping", kind::PING),
    ];
    for (name, number) in kinds {
        assert!(SPECIFICATION.contains(&format!("\n### {number} {name}\n")), "{number} {name}");
    }
    let sizes = [
        format!("| Pose | {} |", size::POSE),
        format!("| Markers, 15 circles | {} |", size::markers(15)),
        format!("| Markers, 64 circles | {} |", size::markers(64)),
        format!("| Hello | {} |", size::HELLO),
        format!("| Setup | {} |", size::SETUP),
        format!("| Rest | {} |", size::REST),
        format!("| Event | {} |", size::EVENT),
        format!("| Health | {} |", size::HEALTH),
        format!("| TimeSync | {} |", size::TIME_SYNC),
        format!("| Pong | {} |", size::PONG),
        format!("| SetRest | {} |", size::SET_REST),
        format!("| Mark | {} |", size::MARK),
        format!("| Ping | {} |", size::PING),
    ];
    for row in sizes {
        assert!(SPECIFICATION.contains(&row), "{row}");
    }
    let flags = [
        (PoseFlags::WAITING, "waiting"),
        (PoseFlags::FEW_MARKERS, "too few circles"),
        (PoseFlags::NO_SOLUTION, "enough circles, but no solution"),
        (PoseFlags::AMBIGUOUS, "ambiguous"),
        (PoseFlags::OUTLIERS, "outliers"),
        (PoseFlags::BEYOND_LIMITS, "the motion is beyond"),
        (PoseFlags::AFTER_GAP, "frames are missing before this one"),
        (PoseFlags::CORRUPT, "the frame was torn"),
        (PoseFlags::SPARSE, "fewer than 7 in 10"),
        (PoseFlags::DARK, "dark"),
        (PoseFlags::SWITCHED, "the lamps were switched"),
        (PoseFlags::CAMERA_MOVED, "the camera may have moved"),
        (PoseFlags::UNREFERENCED, "there are reference targets"),
    ];
    for (PoseFlags(flag), says) in flags {
        let row = format!("\n| {} | {flag} | {says}", flag.ilog2());
        assert!(SPECIFICATION.contains(&row), "{row}");
    }
    let reasons = [
        (LostReason::OutsidePicture, "its window is outside the picture"),
        (LostReason::LowContrast, "there is too little contrast"),
        (LostReason::NotFound, "no ring is in the window"),
        (LostReason::CutByPicture, "it is cut by the picture's edge"),
        (LostReason::CutByWindow, "it is cut by the window's edge"),
        (LostReason::Saturated, "it is saturated"),
        (LostReason::Outline, "size, ratio or outline do not fit"),
        (LostReason::Neighbour, "it could be a neighbour"),
        (LostReason::Residual, "it does not fit the pose of the others"),
        (LostReason::Unlit, "its lamp does not shine"),
        (LostReason::Other, "other"),
    ];
    for (reason, says) in reasons {
        let row = format!("\n| {} | {says} |", reason as u8);
        assert!(SPECIFICATION.contains(&row), "{row}");
    }
}

/// Checksum of the golden `Mark`.
const MARK_CRC: u32 = 0xA9D5_FC39;

const SPECIFICATION: &str = include_str!("../../WIRE.md");
