//! This decoder against records of versions to come.

use gangway_wire::*;

fn framed(kind: u8, body: &[u8]) -> Vec<u8> {
    let mut line = [0; FRAME_LIMIT];
    let length = frame(kind, body, 5, &mut line).unwrap();
    line[..length].to_vec()
}

fn body(record: &Record) -> Vec<u8> {
    let mut body = [0; MAX_FRAME];
    let length = encode_body(record, &mut body).unwrap();
    body[..length].to_vec()
}

fn event(number: u8, fields: &[u8]) -> Vec<u8> {
    let mut body = body(&Record::Event(Event { frame: 3, time_ns: 4, what: What::Started }));
    *body.last_mut().unwrap() = number;
    body.extend_from_slice(fields);
    body
}

/// What a decoder does that knows `Health` without its latencies: they are bytes behind the known fields. And
/// the other way round: a record without them is whole.
#[test]
fn health_of_a_box_that_did_not_count_latencies_is_whole() {
    let latency =
        Some(Latency { wake_up: Histogram { counts: [7; 16], longest_ns: 9 }, ..Latency::default() });
    let now = body(&Record::Health(Health { frames: 5, latency, ..Health::default() }));
    let before = body(&Record::Health(Health { frames: 5, ..Health::default() }));
    assert_eq!(now[..before.len()], before);
    assert_eq!(now.len(), before.len() + 2 * 17);
    assert!(
        matches!(decode_body(kind::HEALTH, &before), Ok((Record::Health(health), false)) if health.latency.is_none())
    );
    // Not all of them: that is no record of any version.
    for end in before.len() + 1..now.len() {
        assert_eq!(decode_body(kind::HEALTH, &now[..end]), Err(BodyError::Malformed), "{end} bytes");
    }
}

#[test]
fn an_unknown_kind_is_skipped_and_counted_apart() {
    // As long as a frame may be, which is longer than any record of this version.
    for body in [vec![], vec![0xA5; 1009]] {
        let line = framed(77, &body);
        let mut decoder = Decoder::new();
        let (decoded, rest) = decoder.feed(&line);
        assert_eq!(decoded, Some(Decoded::Newer { sequence: 5, kind: 77, body: &body }));
        assert!(rest.is_empty());
        assert_eq!(decoder.counts(), &Counts { newer: 1, ..Counts::default() });
    }
    assert_eq!(frame(77, &[0; 1010], 0, &mut [0; 2000]), Err(EncodeError::Room));
}

#[test]
fn an_unknown_event_is_skipped_and_counted_apart() {
    for number in [0, 99, 200, 255] {
        let line = framed(kind::EVENT, &event(number, &[1, 2, 3]));
        let mut decoder = Decoder::new();
        assert!(matches!(decoder.feed(&line).0, Some(Decoded::Newer { kind: kind::EVENT, .. })));
        assert_eq!(decoder.counts(), &Counts { newer: 1, ..Counts::default() });
    }
}

#[test]
fn an_unknown_reason_is_another_reason() {
    let line = framed(kind::EVENT, &event(3, &[14, 99]));
    let mut decoder = Decoder::new();
    let Some(Decoded::Record { record: Record::Event(event), newer, .. }) = decoder.feed(&line).0 else {
        panic!("no event");
    };
    assert_eq!(event.what, What::MarkerLost { circle: 14, reason: LostReason::Other });
    assert!(!newer);
}

#[test]
fn unknown_evidence_of_a_move_is_other_evidence() {
    let line = framed(kind::EVENT, &event(24, &[99, 0, 0, 0, 0x40, 0, 0, 0, 0]));
    let mut decoder = Decoder::new();
    let Some(Decoded::Record { record: Record::Event(event), newer, .. }) = decoder.feed(&line).0 else {
        panic!("no event");
    };
    assert_eq!(event.what, What::CameraMoved { evidence: MoveEvidence::Other, shift_mm: 2.0, turn_deg: 0.0 });
    assert!(!newer);
}

#[test]
fn unknown_flags_are_kept() {
    let pose = Pose { frame: 1, time_ns: 2, flags: PoseFlags(0x8000), markers: 0, motion: None };
    let line = framed(kind::POSE, &body(&Record::Pose(pose)));
    let mut decoder = Decoder::new();
    assert!(
        matches!(decoder.feed(&line).0, Some(Decoded::Record { record: Record::Pose(got), .. }) if got == pose)
    );
}

#[test]
fn fields_behind_the_known_ones_do_not_hide_the_record() {
    let mut centres = Centres::new();
    assert!(centres.push(4, &Marker::default(), true));
    let records = [
        Record::Hello(Hello {
            wire_version: 1,
            box_id: 1,
            boot_id: 2,
            session_id: 3,
            name: "ride",
            firmware: "0.1.0",
            setup_digest: [7; 16],
        }),
        Record::Setup(SetupPiece { digest: [7; 16], index: 0, count: 1, text: "name = \"ride\"" }),
        Record::Rest(Rest {
            first_frame: 0,
            last_frame: 9,
            frames: 10,
            rotation: [1.0, 0.0, 0.0, 0.0],
            translation_mm: [0.0; 3],
            covariance: [0.0; 21],
        }),
        Record::Pose(Pose { frame: 1, time_ns: 2, flags: PoseFlags(0), markers: 0, motion: None }),
        Record::Markers(centres.markers(1)),
        Record::Event(Event { frame: 1, time_ns: 2, what: What::FramesMissed { count: 3 } }),
        Record::Health(Health { latency: Some(Latency::default()), ..Health::default() }),
        Record::TimeSync(TimeSync { time_ns: 1, utc_offset_ns: None, uncertainty_ns: 0 }),
        Record::Pong(Pong { number: 1, host_time_ns: 2, time_ns: 3 }),
        Record::SetRest,
        Record::Mark(Mark { text: "bridge" }),
        Record::Ping(Ping { number: 1, host_time_ns: 2 }),
    ];
    for sent in records {
        let mut longer = body(&sent);
        longer.extend_from_slice(&[0, 1, 2, 250]);
        let line = framed(sent.kind(), &longer);
        let mut decoder = Decoder::new();
        let (decoded, _) = decoder.feed(&line);
        let Some(Decoded::Record { record, newer, body, .. }) = decoded else {
            panic!("{sent:?} was hidden")
        };
        assert_eq!((&record, newer, body), (&sent, true, &longer[..]));
        assert_eq!(decoder.counts(), &Counts { records: 1, extended: 1, ..Counts::default() });
    }
}
