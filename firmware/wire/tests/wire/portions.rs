//! The decoder does not care in which portions the bytes come.

use gangway_wire::*;

use crate::capture::{Capture, Found, Random, decode};

#[test]
fn portions_of_any_size_give_the_same_records() {
    let mut random = Random(1);
    let mut capture = Capture::random(400, &mut random);
    let (all, counts) = decode(&capture.bytes, || usize::MAX);
    assert_eq!(counts, Counts { records: 400, ..Counts::default() });
    let sent: Vec<Found> = capture.frames.iter().map(|(_, sent)| Found::Record(sent.clone())).collect();
    assert!(all == sent, "all records come back in order");
    // The same with damage in it.
    for _ in 0..100 {
        let at = random.below(capture.bytes.len());
        capture.bytes[at] ^= 1 << random.below(8);
    }
    let whole = decode(&capture.bytes, || usize::MAX);
    assert!(whole.1.damaged > 50 && whole.1.records > 250);
    for portion in [1, 2, 7, 64, 255, 4096] {
        assert!(decode(&capture.bytes, || portion) == whole, "portions of {portion} bytes");
    }
    assert!(decode(&capture.bytes, || 1 + random.below(300)) == whole, "portions of random size");
}

#[test]
fn empty_frames_are_passed_over() {
    let capture = Capture::random(3, &mut Random(2));
    let mut bytes = vec![0, 0, 0];
    for (span, _) in &capture.frames {
        bytes.extend_from_slice(&capture.bytes[span.clone()]);
        bytes.extend_from_slice(&[0, 0]);
    }
    let (all, counts) = decode(&bytes, || 5);
    assert_eq!(all.len(), 3);
    assert_eq!(counts, Counts { records: 3, ..Counts::default() });
}

#[test]
fn an_endless_frame_is_one_damage_and_the_next_record_is_read() {
    let capture = Capture::random(1, &mut Random(3));
    let mut bytes = vec![0x55; 100_000];
    bytes.push(0);
    bytes.extend_from_slice(&capture.bytes);
    let (all, counts) = decode(&bytes, || 1000);
    assert_eq!(all, [Found::Damaged(Damage::TooLong), Found::Record(capture.frames[0].1.clone())]);
    assert_eq!(counts, Counts { records: 1, damaged: 1, ..Counts::default() });
}

#[test]
fn a_line_that_ends_inside_a_frame_is_one_damage_and_the_decoder_goes_on() {
    let capture = Capture::random(2, &mut Random(4));
    let (first, second) = capture.bytes.split_at(capture.frames[0].0.end);
    let mut decoder = Decoder::new();
    assert!(decoder.feed(&first[..first.len() - 1]).0.is_none());
    assert_eq!(decoder.finish(), Some(Damage::Stuffing));
    assert_eq!(decoder.finish(), None);
    assert!(matches!(decoder.feed(second).0, Some(Decoded::Record { sequence: 1, .. })));
    assert_eq!(decoder.counts(), &Counts { records: 1, damaged: 1, ..Counts::default() });
}

#[test]
fn every_damage_has_its_name() {
    let decoded = |bytes: &[u8]| decode(bytes, || usize::MAX).0;
    assert_eq!(decoded(&[3, 1, 0]), [Found::Damaged(Damage::Stuffing)]);
    assert_eq!(decoded(&[3, 1, 1, 0]), [Found::Damaged(Damage::Short)]);
    assert_eq!(decoded(&[10, 1, 2, 3, 4, 5, 6, 7, 8, 9, 0]), [Found::Damaged(Damage::Check)]);
    let mut line = [0; MAX_FRAME];
    // A pose without its fields; a tag of an option that is neither 0 nor 1; a name that is no UTF-8.
    let mut hello = [0; 60];
    (hello[25], hello[26]) = (1, 0xFF);
    let mut pose = [0; 40];
    pose[11] = 2;
    for (kind, body) in [(kind::POSE, &[][..]), (kind::POSE, &pose), (kind::HELLO, &hello)] {
        let length = frame(kind, body, 9, &mut line).unwrap();
        assert_eq!(decoded(&line[..length]), [Found::Damaged(Damage::Body { sequence: 9, kind })]);
    }
}

#[test]
fn a_text_beyond_its_bound_makes_no_sense() {
    // The bytes in front of the text, the kind, and the greatest length.
    let mark = [&[0; 9][..], &[16]].concat();
    let cases: [(u8, &[u8], usize); 5] = [
        (kind::HELLO, &[0; 25], MAX_NAME),
        (kind::HELLO, &[0; 26], MAX_FIRMWARE),
        (kind::SETUP, &[0; 18], MAX_SETUP_PIECE),
        (kind::MARK, &[], MAX_MARK),
        (kind::EVENT, &mark, MAX_MARK),
    ];
    for (kind, before, limit) in cases {
        for (length, is_kept) in [(limit, true), (limit + 1, false)] {
            let mut body = before.to_vec();
            body.push(length as u8);
            // Lengths from 128 on take a second byte.
            body.extend((length > 127).then_some(1));
            body.extend(vec![b'x'; length]);
            // What comes behind the text in a `Hello`.
            body.extend([0; 17]);
            assert_eq!(decode_body(kind, &body).is_ok(), is_kept, "kind {kind}, {length} bytes");
        }
    }
}
