//! The index of a session: fixed-size checked entries, one a second of the box's clock.
//!
//! A header of 16 bytes (`GWINDEX1`, entry size, CRC-32 of both), then entries of 32 bytes, little-endian:
//! offset of a record in the stream (u64), records before it (u64), its time in ns (u64), its frame (u32),
//! CRC-32 of the entry's number and these fields (u32). It follows from the stream alone, so a damaged one
//! is made again; where it knows of more than the stream holds, it tells what a cut took away.

use crc::{CRC_32_ISO_HDLC, Crc};

/// Bytes of the header.
pub(crate) const HEADER: usize = 16;
/// Bytes of an entry.
pub(crate) const ENTRY: usize = 32;

const CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);
const MAGIC: &[u8; 8] = b"GWINDEX1";
const SECOND_NS: u64 = 1_000_000_000;

/// One second of the stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Entry {
    /// Offset of the second's first record, bytes.
    pub offset: u64,
    /// Records before it.
    pub records: u64,
    /// Its time on the box's clock, ns.
    pub time_ns: u64,
    /// Its frame.
    pub frame: u32,
}

/// The header of every index.
pub(crate) fn header() -> [u8; HEADER] {
    let mut bytes = [0; HEADER];
    bytes[..8].copy_from_slice(MAGIC);
    bytes[8..12].copy_from_slice(&(ENTRY as u32).to_le_bytes());
    let sum = CRC.checksum(&bytes[..12]);
    bytes[12..].copy_from_slice(&sum.to_le_bytes());
    bytes
}

impl Entry {
    /// The bytes of entry `number`, counted from 0.
    pub(crate) fn to_bytes(self, number: usize) -> [u8; ENTRY] {
        let mut bytes = [0; ENTRY];
        bytes[..8].copy_from_slice(&self.offset.to_le_bytes());
        bytes[8..16].copy_from_slice(&self.records.to_le_bytes());
        bytes[16..24].copy_from_slice(&self.time_ns.to_le_bytes());
        bytes[24..28].copy_from_slice(&self.frame.to_le_bytes());
        let sum = checksum(number, &bytes[..28]);
        bytes[28..].copy_from_slice(&sum.to_le_bytes());
        bytes
    }

    fn from_bytes(number: usize, bytes: &[u8]) -> Option<Self> {
        let u64_at = |at: usize| Some(u64::from_le_bytes(bytes.get(at..at + 8)?.try_into().ok()?));
        let u32_at = |at: usize| Some(u32::from_le_bytes(bytes.get(at..at + 4)?.try_into().ok()?));
        if u32_at(28)? != checksum(number, bytes.get(..28)?) {
            return None;
        }
        Some(Self { offset: u64_at(0)?, records: u64_at(8)?, time_ns: u64_at(16)?, frame: u32_at(24)? })
    }
}

fn checksum(number: usize, fields: &[u8]) -> u32 {
    let mut digest = CRC.digest();
    digest.update(&(number as u64).to_le_bytes());
    digest.update(fields);
    digest.finalize()
}

/// The whole index as bytes.
pub(crate) fn to_bytes(entries: &[Entry]) -> Vec<u8> {
    let mut bytes = header().to_vec();
    for (number, entry) in entries.iter().enumerate() {
        bytes.extend_from_slice(&entry.to_bytes(number));
    }
    bytes
}

/// The sound entries at the front of an index file, and whether all of the file was sound.
pub(crate) fn from_bytes(bytes: &[u8]) -> (Vec<Entry>, bool) {
    let Some(body) = bytes.strip_prefix(&header()) else {
        return (Vec::new(), false);
    };
    let mut entries: Vec<Entry> = Vec::with_capacity(body.len() / ENTRY);
    for (number, chunk) in body.chunks(ENTRY).enumerate() {
        match Entry::from_bytes(number, chunk) {
            Some(entry)
                if entries.last().is_none_or(|l| entry.offset > l.offset && entry.records > l.records) =>
            {
                entries.push(entry);
            }
            _ => return (entries, false),
        }
    }
    (entries, true)
}

/// Says which records begin a second: every one whose time lies in another second than the entry before.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Seconds {
    last: Option<u64>,
}

impl Seconds {
    /// Goes on after `entry`.
    pub(crate) fn after(entry: Option<&Entry>) -> Self {
        Self { last: entry.map(|entry| entry.time_ns / SECOND_NS) }
    }

    /// Whether a record of this time begins a second.
    pub(crate) fn begins(&mut self, time_ns: u64) -> bool {
        let second = Some(time_ns / SECOND_NS);
        let begins = second != self.last;
        self.last = second;
        begins
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entries() -> Vec<Entry> {
        (0..5u64)
            .map(|i| Entry {
                offset: i * 1000,
                records: i * 60,
                time_ns: i * 1_000_000_007,
                frame: i as u32 * 50,
            })
            .collect()
    }

    #[test]
    fn an_index_reads_back() {
        assert_eq!(from_bytes(&to_bytes(&entries())), (entries(), true));
    }

    #[test]
    fn an_index_cut_at_any_byte_keeps_its_whole_entries() {
        let bytes = to_bytes(&entries());
        for cut in 0..bytes.len() {
            let (kept, whole) = from_bytes(&bytes[..cut]);
            assert_eq!(kept, entries()[..cut.saturating_sub(HEADER) / ENTRY]);
            assert_eq!(whole, cut >= HEADER && (cut - HEADER).is_multiple_of(ENTRY), "cut at {cut}");
        }
    }

    #[test]
    fn any_damaged_bit_ends_the_sound_part() {
        let bytes = to_bytes(&entries());
        for bit in 0..bytes.len() * 8 {
            let mut bad = bytes.clone();
            bad[bit / 8] ^= 1 << (bit % 8);
            let (kept, whole) = from_bytes(&bad);
            assert!(!whole);
            let touched = (bit / 8).checked_sub(HEADER).map_or(0, |at| at / ENTRY);
            assert_eq!(kept, entries()[..touched]);
        }
    }

    #[test]
    fn entries_in_another_order_are_not_sound() {
        let bytes = to_bytes(&entries());
        let mut swapped = bytes.clone();
        swapped[HEADER..HEADER + ENTRY].copy_from_slice(&bytes[HEADER + ENTRY..HEADER + 2 * ENTRY]);
        assert_eq!(from_bytes(&swapped), (vec![], false));
    }
}
