//! A link that stalls, drops its connection or garbles records on their way to another.

use std::fmt;

use gangway_device::Link;
use gangway_link::Error;

use super::{LinkFaults, choose};
use crate::random::Random;

/// Turns that a stalled line takes nothing, or a dropped connection is away: about 50 ms of the courier's.
const TURNS: u32 = 50;

/// Another link with faults. Whether a record is hit depends on the seed and its place only; a dropped
/// connection is acted: half of the record goes out, the connection behind stays.
pub struct FaultyLink<L> {
    link: L,
    faults: LinkFaults,
    random: Random,
    /// Bytes that were taken and are not on the line yet.
    out: Vec<u8>,
    /// The first of these records is on the line in part.
    is_begun: bool,
    /// The fate of the next record is decided: it was stalled.
    is_decided: bool,
    stalled: u32,
    away: u32,
    /// The connection came back, and nothing was sent on it yet.
    begins: bool,
    connections: u32,
}

impl<L: Link<Error = Error> + fmt::Display> FaultyLink<L> {
    /// Puts faults upon a link.
    pub fn new(link: L, faults: LinkFaults, seed: u64) -> Self {
        // Other numbers than the camera's.
        let random = Random(!seed);
        Self {
            link,
            faults,
            random,
            out: Vec::new(),
            is_begun: false,
            is_decided: false,
            stalled: 0,
            away: 0,
            begins: false,
            connections: 0,
        }
    }

    fn not_connected(&self) -> Error {
        Error::NotConnected { line: self.to_string() }
    }

    /// Sends what was taken; true when all of it is on the line.
    fn flush(&mut self) -> Result<bool, Error> {
        while !self.out.is_empty() {
            let sent = self.link.send(&self.out);
            if sent.is_err() && std::mem::take(&mut self.is_begun) {
                // As the courier does it: the rest of a record that was begun is of no use.
                let end = self.out.iter().position(|&byte| byte == 0).map_or(self.out.len(), |at| at + 1);
                self.out.drain(..end);
            }
            let count = sent?;
            if count == 0 {
                return Ok(false);
            }
            self.is_begun = self.out.drain(..count).next_back() != Some(0);
        }
        Ok(true)
    }
}

impl<L: fmt::Display> fmt::Display for FaultyLink<L> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.link.fmt(f)
    }
}

impl<L: Link<Error = Error> + fmt::Display> Link for FaultyLink<L> {
    type Error = Error;

    fn send(&mut self, bytes: &[u8]) -> Result<usize, Error> {
        if self.faults == LinkFaults::default() {
            return self.link.send(bytes);
        }
        if self.away > 0 {
            self.away -= 1;
            if self.away == 0 {
                self.connections += 1;
                self.begins = true;
            }
            return Err(self.not_connected());
        }
        if self.stalled > 0 {
            self.stalled -= 1;
            return Ok(0);
        }
        if !self.flush()? {
            return Ok(0);
        }
        let end = bytes.iter().position(|&byte| byte == 0).map_or(bytes.len(), |at| at + 1);
        let record = bytes.get(..end).unwrap_or(bytes);
        if std::mem::take(&mut self.begins) {
            self.out.push(0);
        }
        if std::mem::take(&mut self.is_decided) {
            self.out.extend_from_slice(record);
        } else {
            match choose(self.random.share(), &[self.faults.stall, self.faults.drop, self.faults.garble]) {
                Some(0) => {
                    (self.stalled, self.is_decided) = (TURNS, true);
                    return Ok(0);
                }
                Some(1) => {
                    let half = record.len().div_ceil(2);
                    self.out.extend_from_slice(record.get(..half).unwrap_or_default());
                    self.away = TURNS;
                    return Ok(half);
                }
                Some(_) => {
                    let start = self.out.len();
                    self.out.extend_from_slice(record);
                    let at = start + self.random.next() as usize % record.len().max(1);
                    let change = (self.random.next() % 255) as u8 + 1;
                    if let Some(byte) = self.out.get_mut(at) {
                        *byte ^= change;
                    }
                }
                None => self.out.extend_from_slice(record),
            }
        }
        match self.flush() {
            // Taken is taken: it goes out when the line is back.
            Err(Error::NotConnected { .. }) | Ok(_) => Ok(record.len()),
            Err(error) => Err(error),
        }
    }

    fn receive(&mut self, into: &mut [u8]) -> Result<usize, Error> {
        if self.away > 0 {
            return Ok(0);
        }
        self.link.receive(into)
    }

    fn finish(&mut self) -> Result<bool, Error> {
        Ok(self.flush()? && self.link.finish()?)
    }

    fn connections(&self) -> u32 {
        self.link.connections().wrapping_add(self.connections)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Takes everything.
    #[derive(Default)]
    struct Open(Vec<u8>);

    impl fmt::Display for Open {
        fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.write_str("open")
        }
    }

    impl Link for Open {
        type Error = Error;

        fn send(&mut self, bytes: &[u8]) -> Result<usize, Error> {
            self.0.extend_from_slice(bytes);
            Ok(bytes.len())
        }

        fn receive(&mut self, _into: &mut [u8]) -> Result<usize, Error> {
            Ok(0)
        }

        fn connections(&self) -> u32 {
            0
        }
    }

    /// Sends records of ten bytes as the courier does, in batches of `batch`.
    fn carry(faults: LinkFaults, seed: u64, batch: usize) -> (Vec<u8>, u32) {
        let mut link = FaultyLink::new(Open::default(), faults, seed);
        let records: Vec<u8> =
            (0..1_000u32).flat_map(|i| [[1 + (i % 250) as u8; 9].as_slice(), &[0]].concat()).collect();
        let mut rest = &records[..];
        while !rest.is_empty() {
            let end = (10 * batch).min(rest.len());
            let begun = (records.len() - rest.len()) % 10;
            match link.send(&rest[..end - begun.min(end)]) {
                Ok(count) => rest = &rest[count..],
                Err(_) if begun > 0 => rest = &rest[10 - begun..],
                Err(_) => {}
            }
        }
        assert!(link.finish().unwrap());
        (link.link.0, link.connections)
    }

    #[test]
    fn the_same_seed_gives_the_same_faults_however_records_are_batched() {
        let faults = LinkFaults { stall: 0.05, drop: 0.05, garble: 0.1 };
        assert_eq!(carry(faults, 7, 1), carry(faults, 7, 5));
        assert_ne!(carry(faults, 7, 1), carry(faults, 8, 1));
    }

    #[test]
    fn a_stall_loses_nothing() {
        let (whole, _) = carry(LinkFaults::default(), 1, 1);
        assert_eq!(whole.len(), 10_000);
        assert_eq!(carry(LinkFaults { stall: 0.2, ..LinkFaults::default() }, 1, 1).0, whole);
    }

    #[test]
    fn a_drop_costs_one_record_and_a_new_connection_begins_with_a_delimiter() {
        let (sent, connections) = carry(LinkFaults { drop: 0.05, ..LinkFaults::default() }, 1, 1);
        let records: Vec<&[u8]> = sent.split(|&byte| byte == 0).filter(|record| !record.is_empty()).collect();
        let cut = records.iter().filter(|record| record.len() != 9).count();
        assert_eq!(records.len(), 1_000);
        assert!(cut > 0 && cut.abs_diff(connections as usize) <= 1, "{cut} {connections}");
    }

    #[test]
    fn garbling_changes_one_byte_of_a_record() {
        let (whole, _) = carry(LinkFaults::default(), 1, 1);
        let (garbled, _) = carry(LinkFaults { garble: 0.1, ..LinkFaults::default() }, 1, 1);
        assert_eq!(garbled.len(), whole.len());
        let hit = whole.chunks(10).zip(garbled.chunks(10)).filter(|(a, b)| a != b);
        let changed: Vec<usize> = hit.map(|(a, b)| a.iter().zip(b).filter(|(a, b)| a != b).count()).collect();
        assert!(changed.iter().all(|&bytes| bytes == 1));
        // 100 of 1,000 with a standard deviation of 9.5: five of them either way.
        assert!(changed.len().abs_diff(100) < 48, "{}", changed.len());
    }
}
