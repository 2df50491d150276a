//! `WIRE.md` taken at its word: its tables alone, read as they are printed, take every record apart to the
//! last byte.

use std::collections::BTreeMap;

use gangway_wire::*;

use crate::capture::{Capture, Found, Random, decode};

const SPECIFICATION: &str = include_str!("../../WIRE.md");

/// A row of a table of fields.
struct Field<'s> {
    name: &'s str,
    of_type: &'s str,
    /// A record may end before it.
    came_later: bool,
}

/// The tables that say what a body holds.
#[derive(Default)]
struct Tables<'s> {
    kinds: BTreeMap<u8, Vec<Field<'s>>>,
    motion: Vec<Field<'s>>,
    events: BTreeMap<u8, Vec<Field<'s>>>,
}

impl<'s> Tables<'s> {
    fn read(text: &'s str) -> Self {
        let mut tables = Self::default();
        let (mut kind, mut header, mut line_before) = (None, "", "");
        let mut is_motion = false;
        for line in text.lines() {
            if let Some(heading) = line.strip_prefix("### ") {
                kind = heading.split(' ').next().and_then(|number| number.parse().ok());
                is_motion = false;
                kind.map(|kind| tables.kinds.entry(kind).or_default());
            }
            is_motion |= line == "A motion is";
            if line.starts_with("|---") {
                header = line_before;
            }
            let cells: Vec<&str> = line.trim_matches('|').split(" | ").map(str::trim).collect();
            let is_row = line.starts_with("| ") && line != header;
            if let (true, Some(kind), [name, rest @ ..]) = (is_row, kind, &cells[..]) {
                match (header, rest) {
                    ("| field | type | |", [of_type, about @ ..]) if *name != "field" => {
                        let came_later = about.iter().any(|about| about.starts_with("came later"));
                        let field = Field { name, of_type, came_later };
                        match is_motion {
                            true => tables.motion.push(field),
                            false => tables.kinds.entry(kind).or_default().push(field),
                        }
                    }
                    ("| event | | fields |", [_, fields @ ..]) if *name != "event" => {
                        let fields = fields.first().map_or(vec![], |fields| event_fields(fields));
                        tables.events.insert(name.parse().expect("the number of an event"), fields);
                    }
                    _ => {}
                }
            }
            if line.is_empty() {
                header = "";
            }
            line_before = line;
        }
        tables
    }

    /// What is left of a body when the fields of its kind are read.
    fn take<'b>(&self, kind: u8, body: &'b [u8]) -> Option<&'b [u8]> {
        let mut rest = body;
        let mut event = None;
        for field in self.kinds.get(&kind)? {
            if rest.is_empty() && field.came_later {
                break;
            }
            if field.name == "event" {
                event = rest.first();
            }
            rest = self.take_one(field.of_type, rest)?;
        }
        for field in event.map_or(Some(&vec![]), |event| self.events.get(event))? {
            rest = self.take_one(field.of_type, rest)?;
        }
        // Said in words below the table.
        (kind != kind::MARKERS || markers_fit(body)).then_some(rest)
    }

    /// What is behind a value of this type.
    fn take_one<'b>(&self, of_type: &str, body: &'b [u8]) -> Option<&'b [u8]> {
        if let Some(optional) = of_type.strip_suffix('?') {
            let (tag, rest) = body.split_first()?;
            return match tag {
                0 => Some(rest),
                1 => self.take_one(optional.trim_matches(['(', ')']), rest),
                _ => None,
            };
        }
        if let Some((item, count)) = of_type.strip_prefix('[').and_then(|list| list.split_once("; ")) {
            let count: u32 = count.trim_end_matches(']').parse().ok()?;
            return (0..count).try_fold(body, |rest, _| self.take_one(item, rest));
        }
        if let Some(most) = of_type.strip_prefix("text<") {
            let (length, rest) = var(body, 64)?;
            let (text, rest) = rest.split_at_checked(length as usize)?;
            let most: u64 = most.trim_end_matches('>').parse().ok()?;
            return (length <= most && std::str::from_utf8(text).is_ok()).then_some(rest);
        }
        match of_type {
            "u8" => body.get(1..),
            "short" => body.get(2..),
            "f32" => body.get(4..),
            "f64" | "u64" => body.get(8..),
            "var 16" | "zig 16" => Some(var(body, 16)?.1),
            "var 32" => Some(var(body, 32)?.1),
            "var 64" | "zig 64" => Some(var(body, 64)?.1),
            "bytes" => {
                let (length, rest) = var(body, 64)?;
                rest.get(length as usize..)
            }
            "histogram" => self.take_one("var 32", self.take_one("[var 16; 16]", body)?),
            "motion" => self.motion.iter().try_fold(body, |rest, field| self.take_one(field.of_type, rest)),
            unknown => panic!("the page does not explain the type {unknown}"),
        }
    }
}

/// The fields in a row of the table of events, such as `circle u8, reason u8`; what else stands there is
/// explanation.
fn event_fields(cell: &str) -> Vec<Field<'_>> {
    let field = |item| {
        let (name, of_type) = str::trim(item).split_once(' ')?;
        let of_type = of_type.split(':').next()?;
        let is_type = ["u8", "f32", "var ", "text<"].iter().any(|start| of_type.starts_with(start));
        is_type.then_some(Field { name, of_type, came_later: false })
    };
    cell.split([',', ';']).filter_map(field).collect()
}

/// A number of at most so many bits, seven a byte, and what is behind it.
fn var(body: &[u8], bits: u32) -> Option<(u64, &[u8])> {
    let length = body.iter().position(|byte| byte & 0x80 == 0)? + 1;
    let (bytes, rest) = body.split_at(length);
    let number = bytes.iter().rev().fold(0u128, |number, byte| number << 7 | u128::from(byte & 0x7F));
    (length <= bits.div_ceil(7) as usize && number >> bits == 0).then_some((number as u64, rest))
}

fn markers_fit(body: &[u8]) -> bool {
    let masks = || {
        let (_, rest) = var(body, 32)?;
        let (visible, rest) = var(rest, 64)?;
        let (used, rest) = var(rest, 64)?;
        let (length, _) = var(rest, 64)?;
        Some(used & !visible == 0 && length == 9 * u64::from(visible.count_ones()))
    };
    masks() == Some(true)
}

#[test]
fn its_tables_take_every_record_apart_to_the_last_byte() {
    let tables = Tables::read(SPECIFICATION);
    let kinds: Vec<u8> = tables.kinds.keys().copied().collect();
    assert_eq!(kinds, [1, 2, 3, 4, 5, 6, 7, 8, 9, 128, 129, 130]);
    assert_eq!(tables.motion.len(), 4);
    let mut seen = BTreeMap::<(u8, u8), usize>::new();
    let mut random = Capture::random(3000, &mut Random(7)).bytes;
    // Younger than the golden captures.
    for what in [
        What::CameraMoved { evidence: MoveEvidence::Shock, shift_mm: 3.0, turn_deg: 0.2 },
        What::CameraShaking { shift_mm: 0.0, turn_deg: 0.1 },
    ] {
        let mut line = [0; MAX_FRAME];
        let length = encode(&Record::Event(Event { frame: 1, time_ns: 2, what }), 0, &mut line).unwrap();
        random.extend_from_slice(&line[..length]);
    }
    for capture in [include_bytes!("version_1.gw"), &include_bytes!("version_1_behind.gw")[..], &random] {
        for found in decode(capture, || usize::MAX).0 {
            let Found::Record(sent) = found else { panic!("{found:?}") };
            let left = tables.take(sent.kind, &sent.body);
            assert_eq!(left, Some(&[][..]), "kind {}: {:02X?}", sent.kind, sent.body);
            let event = match decode_body(sent.kind, &sent.body) {
                Ok((Record::Event(event), _)) => event.what.number(),
                _ => 0,
            };
            *seen.entry((sent.kind, event)).or_default() += 1;
        }
    }
    // Nothing on the page went unread.
    assert!(kinds.iter().all(|kind| seen.keys().any(|(seen, _)| seen == kind)), "{seen:?}");
    let events: Vec<&u8> = tables.events.keys().filter(|event| !seen.contains_key(&(6, **event))).collect();
    assert!(events.is_empty(), "no record of the events {events:?}");
}

#[test]
fn a_body_cut_anywhere_is_too_short_for_its_table_as_for_the_decoder() {
    let tables = Tables::read(SPECIFICATION);
    for (_, sent) in Capture::random(200, &mut Random(8)).frames {
        for end in 0..sent.body.len() {
            let body = &sent.body[..end];
            assert_eq!(
                tables.take(sent.kind, body).is_some(),
                decode_body(sent.kind, body).is_ok(),
                "kind {} cut to {body:02X?}",
                sent.kind
            );
        }
    }
}
