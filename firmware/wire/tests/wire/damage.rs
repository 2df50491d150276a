//! Ten thousand random damages: the decoder never invents a record and loses only those that were touched.

use std::collections::HashMap;

use crate::capture::{Capture, Found, Random, Sent, decode};

/// A byte on the damaged line, and where it stood in the original, if it comes from there unchanged.
type Traced = (u8, Option<usize>);

/// Flips a bit, overwrites, cuts, inserts or ends early.
fn damage(line: &mut Vec<Traced>, random: &mut Random) {
    if line.is_empty() {
        return;
    }
    let at = random.below(line.len());
    // Short damages mostly, so that many different records are hit; long ones now and then.
    let longest = [3, 20, 700][random.below(3)];
    let length = 1 + random.below(longest);
    let end = (at + length).min(line.len());
    // Zeros make and unmake frames: they are drawn as often as all other values together.
    let byte = |random: &mut Random| if random.below(2) == 0 { 0 } else { random.next() as u8 };
    match random.below(10) {
        0..4 => {
            let flipped = line[at].0 ^ 1 << random.below(8);
            line[at] = (flipped, None);
        }
        4 | 5 => {
            for (slot, trace) in &mut line[at..end] {
                let new = byte(random);
                if new != *slot {
                    (*slot, *trace) = (new, None);
                }
            }
        }
        6 | 7 => drop(line.drain(at..end)),
        8 => {
            let new: Vec<Traced> = (0..length).map(|_| (byte(random), None)).collect();
            drop(line.splice(at..at, new));
        }
        _ => line.truncate(at),
    }
}

/// The frames whose bytes, from the delimiter before to the delimiter behind, are all there and in one piece.
fn untouched<'c>(capture: &'c Capture, line: &[Traced]) -> Vec<&'c Sent> {
    let place: HashMap<usize, usize> =
        line.iter().enumerate().filter_map(|(now, (_, was))| was.map(|was| (was, now))).collect();
    let is_whole = |start: usize, end: usize| {
        place.get(&start).is_some_and(|&first| {
            (start == 0 && first == 0 || start > 0)
                && (start..end).all(|was| place.get(&was) == Some(&(first + was - start)))
        })
    };
    let frames = capture.frames.iter();
    frames
        .filter(|(span, _)| is_whole(span.start.saturating_sub(1), span.end))
        .map(|(_, sent)| sent)
        .collect()
}

#[test]
fn ten_thousand_damages_cost_only_what_they_touch() {
    let mut random = Random(20_240_229);
    let mut touched_in_all = 0;
    let mut lost_in_all = 0;
    for round in 0..10_000 {
        // A fresh capture now and then; a capture of 24 records is 3 kB.
        let capture = Capture::random(24, &mut random);
        let mut line: Vec<Traced> =
            capture.bytes.iter().enumerate().map(|(was, &byte)| (byte, Some(was))).collect();
        for _ in 0..1 + random.below(3) {
            damage(&mut line, &mut random);
        }
        let bytes: Vec<u8> = line.iter().map(|&(byte, _)| byte).collect();
        let (found, counts) = decode(&bytes, || 1 + random.below(200));

        let mut records = Vec::new();
        for found in found {
            match found {
                Found::Record(sent) => records.push(sent),
                Found::Newer(sent) => panic!("round {round}: invented {sent:?}"),
                Found::Damaged(_) => {}
            }
        }
        let mut original = capture.frames.iter().map(|(_, sent)| sent);
        for record in &records {
            assert!(original.any(|sent| sent == record), "round {round}: invented or doubled {record:?}");
        }
        let whole = untouched(&capture, &line);
        for sent in &whole {
            assert!(records.contains(sent), "round {round}: lost the untouched record {}", sent.sequence);
        }
        if let (Some(first), Some(last)) = (records.first(), records.last()) {
            let between = u64::from(last.sequence - first.sequence) + 1;
            assert_eq!(counts.missing, between - records.len() as u64, "round {round}: numbers missing");
        }
        touched_in_all += capture.frames.len() - whole.len();
        lost_in_all += capture.frames.len() - records.len();
    }
    // A touched record may still be whole (a delimiter before it gone with the record before); few are.
    assert!(lost_in_all <= touched_in_all && lost_in_all * 10 > touched_in_all * 8);
    assert!(touched_in_all > 10_000, "the damages did hit: {touched_in_all}");
}

#[test]
fn a_flipped_byte_costs_one_record_and_a_flipped_delimiter_two() {
    let capture = Capture::random(60, &mut Random(5));
    for (index, (span, _)) in capture.frames.iter().enumerate() {
        for at in span.clone() {
            let mut bytes = capture.bytes.clone();
            bytes[at] ^= 0x41;
            let (_, counts) = decode(&bytes, || usize::MAX);
            let is_delimiter = at + 1 == span.end;
            let touched = if is_delimiter && index < 59 { 2 } else { 1 };
            assert_eq!(counts.records, 60 - touched, "byte {at}");
            assert!(counts.damaged >= 1, "byte {at}");
        }
    }
}

#[test]
fn noise_is_never_a_record() {
    let mut random = Random(6);
    let noise: Vec<u8> = (0..300_000).map(|_| (random.next() % 97) as u8).collect();
    let (_, counts) = decode(&noise, || 1 + random.below(5000));
    assert_eq!((counts.records, counts.newer), (0, 0));
    assert!(counts.damaged > 1000);
}
