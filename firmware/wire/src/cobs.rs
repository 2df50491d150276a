//! Consistent overhead byte stuffing (Cheshire and Baker, 1999): bytes without zeros, so that a zero ends a
//! frame.

/// Bytes that stuffing adds to `length` bytes, at most.
pub(crate) const fn overhead(length: usize) -> usize {
    if length == 0 { 1 } else { length.div_ceil(254) }
}

/// Stuffs `raw` into `out`, delimiter behind it; the bytes written, or `None` where `out` is too small.
pub(crate) fn stuff(raw: &[u8], out: &mut [u8]) -> Option<usize> {
    // `code_at` is where the open block's length goes once it is known, `end` the next free byte.
    let mut code_at = 0;
    let mut end = 1;
    for &byte in raw {
        if end - code_at == 255 {
            *out.get_mut(code_at)? = 255;
            (code_at, end) = (end, end + 1);
        }
        if byte == 0 {
            *out.get_mut(code_at)? = (end - code_at) as u8;
            (code_at, end) = (end, end + 1);
        } else {
            *out.get_mut(end)? = byte;
            end += 1;
        }
    }
    *out.get_mut(code_at)? = (end - code_at) as u8;
    *out.get_mut(end)? = 0;
    Some(end + 1)
}

/// Undoes the stuffing byte by byte.
#[derive(Clone, Debug, Default)]
pub(crate) struct Unstuff {
    /// Bytes still to come in the open block.
    left: u8,
    /// The block that ended, or is open, stands for a zero behind it, unless the frame ends there.
    zero_follows: bool,
}

impl Unstuff {
    /// Takes the next byte, which is not zero; what it means, if it means a byte at all.
    pub(crate) fn take(&mut self, byte: u8) -> Option<u8> {
        if self.left > 0 {
            self.left -= 1;
            return Some(byte);
        }
        let zero = self.zero_follows.then_some(0);
        self.left = byte.wrapping_sub(1);
        self.zero_follows = byte != 255;
        zero
    }

    /// Whether a frame may end here: no block is open.
    pub(crate) fn may_end(&self) -> bool {
        self.left == 0
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use std::vec::Vec;

    use super::*;

    fn unstuff(stuffed: &[u8]) -> Vec<u8> {
        let mut state = Unstuff::default();
        let raw = stuffed.iter().filter_map(|&byte| state.take(byte)).collect();
        assert!(state.may_end());
        raw
    }

    fn check(raw: &[u8]) {
        let mut out = [0xAA; 1200];
        let length = stuff(raw, &mut out).unwrap();
        assert!(length <= raw.len() + overhead(raw.len()) + 1);
        let (stuffed, delimiter) = out[..length].split_at(length - 1);
        assert_eq!(delimiter, [0]);
        assert!(!stuffed.contains(&0));
        assert_eq!(unstuff(stuffed), raw);
        // The crate `cobs` as an independent judge, both ways.
        let mut other = [0; 1200];
        let judged = ::cobs::decode(stuffed, &mut other).unwrap();
        assert_eq!(&other[..judged.frame_size()], raw);
        let judged = ::cobs::encode(raw, &mut other);
        assert_eq!(unstuff(&other[..judged]), raw);
        // One byte less of room is an answer, not a panic.
        assert_eq!(stuff(raw, &mut out[..length - 1]), None);
    }

    #[test]
    fn stuffing_comes_back_at_every_length_with_and_without_zeros() {
        for length in (0..20).chain(250..260).chain(505..515).chain(1000..1020) {
            let ones: Vec<u8> = (0..length).map(|i| (i % 255) as u8 + 1).collect();
            check(&ones);
            for zero_at in 0..length {
                let mut raw = ones.clone();
                raw[zero_at] = 0;
                check(&raw);
            }
            check(&std::vec![0; length]);
        }
    }
}
