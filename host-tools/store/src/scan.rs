//! Walks through bytes record by record and knows where each one starts and ends.

use std::io::{self, Read};
use std::ops::ControlFlow;

use gangway_wire::{Counts, Decoded, Decoder};

/// Something that the decoder found, with its place.
#[derive(Clone, Debug, PartialEq)]
pub struct Found<'d> {
    /// Offset of its first byte.
    pub start: u64,
    /// Offset behind its last byte.
    pub end: u64,
    /// What it is.
    pub decoded: Decoded<'d>,
}

/// A decoder that counts bytes.
#[derive(Clone, Debug, Default)]
pub(crate) struct Scanner {
    decoder: Decoder,
    /// Bytes taken.
    taken: u64,
    /// Where the present frame began: behind the last delimiter.
    frame: u64,
}

impl Scanner {
    /// A scanner whose first byte has this offset.
    pub(crate) fn at(offset: u64) -> Self {
        Self { decoder: Decoder::new(), taken: offset, frame: offset }
    }

    pub(crate) fn counts(&self) -> &Counts {
        self.decoder.counts()
    }

    /// Offset behind the last delimiter: what is behind it is an unfinished record.
    pub(crate) fn frame(&self) -> u64 {
        self.frame
    }

    /// As [`Decoder::feed`].
    pub(crate) fn feed<'d, 'b>(&'d mut self, bytes: &'b [u8]) -> (Option<Found<'d>>, &'b [u8]) {
        let (decoded, rest) = self.decoder.feed(bytes);
        let used = &bytes[..bytes.len() - rest.len()];
        let before = self.taken;
        self.taken += used.len() as u64;
        let behind_zero = |bytes: &[u8]| bytes.iter().rposition(|&byte| byte == 0).map(|at| at as u64 + 1);
        let inner = used.len() - usize::from(used.last() == Some(&0));
        let start = behind_zero(&used[..inner]).map_or(self.frame, |at| before + at);
        self.frame = if inner < used.len() { self.taken } else { start };
        (decoded.map(|decoded| Found { start, end: self.taken, decoded }), rest)
    }
}

/// What a walk through bytes met.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Walk {
    /// Bytes in all.
    pub bytes: u64,
    /// Bytes of an unfinished record at their end.
    pub unfinished: u64,
    /// What the decoder counted.
    pub counts: Counts,
}

/// Hands everything that `read` holds to `visitor`, until it breaks.
///
/// # Errors
/// What `read` reports.
pub fn walk(read: impl Read, visitor: impl FnMut(&Found<'_>) -> ControlFlow<()>) -> Result<Walk, io::Error> {
    walk_from(0, read, visitor)
}

/// As [`walk`], with the offset of the first byte.
pub(crate) fn walk_from(
    offset: u64,
    mut read: impl Read,
    mut visitor: impl FnMut(&Found<'_>) -> ControlFlow<()>,
) -> Result<Walk, io::Error> {
    let mut scanner = Scanner::at(offset);
    let mut buffer = vec![0; 1 << 16];
    'all: loop {
        let count = match read.read(&mut buffer) {
            Ok(0) => break,
            Ok(count) => count,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
            Err(error) => return Err(error),
        };
        let mut rest = &buffer[..count];
        while !rest.is_empty() {
            let (found, behind) = scanner.feed(rest);
            rest = behind;
            if let Some(found) = found
                && visitor(&found).is_break()
            {
                break 'all;
            }
        }
    }
    Ok(Walk {
        bytes: scanner.taken,
        unfinished: scanner.taken - scanner.frame,
        counts: *scanner.decoder.counts(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing;

    #[test]
    fn every_record_lies_where_it_was_written_in_any_portions() {
        let ride = testing::ride(1, 30);
        for portion in [1, 7, 4096] {
            let mut scanner = Scanner::default();
            let mut at = 0;
            for chunk in ride.chunks(portion) {
                let mut rest = chunk;
                while !rest.is_empty() {
                    let (found, behind) = scanner.feed(rest);
                    rest = behind;
                    let Some(found) = found else { continue };
                    assert_eq!(found.start, at, "records follow one another");
                    assert_eq!(ride[found.end as usize - 1], 0);
                    at = found.end;
                }
            }
            assert_eq!((at, scanner.frame()), (ride.len() as u64, ride.len() as u64));
        }
    }

    #[test]
    fn garbage_between_records_moves_no_record() {
        let ride = testing::ride(1, 3);
        let mut bytes = vec![0, 0];
        bytes.extend(vec![7; 3000]);
        bytes.extend([0, 0, 0]);
        let start = bytes.len() as u64;
        bytes.extend(&ride);
        bytes.extend([1, 2, 3]);
        let mut first = None;
        let walk = walk(&bytes[..], |found| {
            if matches!(found.decoded, Decoded::Record { .. }) {
                first.get_or_insert(found.start);
            }
            ControlFlow::Continue(())
        })
        .unwrap();
        assert_eq!(first, Some(start));
        assert_eq!((walk.bytes, walk.unfinished), (bytes.len() as u64, 3));
        assert_eq!(walk.counts.damaged, 1);
    }
}
