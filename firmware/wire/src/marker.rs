//! The centres of one frame: nine bytes a visible circle, place to 1/1024 px with its 2x2 covariance.

use serde::{Deserialize, Serialize};

/// Most circles that a `Markers` record can carry: the bits of its masks.
pub const MAX_MARKERS: usize = 64;
/// Bytes of one packed centre.
pub const PACKED_MARKER: usize = 9;

/// Steps a pixel.
const STEPS: f32 = 1024.0;
/// Greatest place in steps: 24 bits with sign, 8,191 + 1023/1024 px to either side.
const GREATEST: f32 = 8_388_607.0;
/// The 24 bits that say "no number".
const NO_NUMBER: i32 = -8_388_608;
/// Code of a standard deviation of 1 px, and steps an octave.
const SIGMA_ONE: f32 = 192.0;
const SIGMA_OCTAVE: f32 = 16.0;
/// Code of a standard deviation that is not known or beyond the scale.
const SIGMA_UNKNOWN: u8 = 255;
/// Codes of a correlation of 1; the code itself stays one below, so that a covariance stays positive
/// definite.
const CORRELATION_ONE: f32 = 128.0;

/// One circle's centre as measured.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Marker {
    /// u right, v down, px. On the wire in steps of 1/1024 px, clamped to +-(8,191 + 1023/1024) px; a centre
    /// a little outside the picture (-0.3) is kept as it is. NaN comes back as NaN.
    pub at_px: [f32; 2],
    /// Standard deviations of u and v, px. On the wire one byte each, 16 steps an octave (to 2.2 %) from
    /// 2^-12 to 14.7 px; less comes back as 2^-12, more, NaN and negative values as infinity (not known).
    pub sigma_px: [f32; 2],
    /// Their correlation. On the wire in steps of 1/128, clamped to +-127/128; NaN comes back as 0.
    pub correlation: f32,
}

impl Marker {
    /// The nine bytes: u and v (24 bits each, two's complement, little-endian), sigma u, sigma v,
    /// correlation.
    pub fn pack(&self) -> [u8; PACKED_MARKER] {
        let [u0, u1, u2] = pack_place(self.at_px[0]);
        let [v0, v1, v2] = pack_place(self.at_px[1]);
        // `as` saturates and turns NaN into 0.
        let correlation = libm::roundf(self.correlation * CORRELATION_ONE).clamp(-127.0, 127.0) as i8;
        let [sigma_u, sigma_v] = self.sigma_px.map(pack_sigma);
        [u0, u1, u2, v0, v1, v2, sigma_u, sigma_v, correlation as u8]
    }

    /// The centre in nine bytes; every nine bytes are some centre.
    pub fn unpack([u0, u1, u2, v0, v1, v2, sigma_u, sigma_v, correlation]: [u8; PACKED_MARKER]) -> Self {
        Self {
            at_px: [unpack_place([u0, u1, u2]), unpack_place([v0, v1, v2])],
            sigma_px: [unpack_sigma(sigma_u), unpack_sigma(sigma_v)],
            correlation: f32::from(correlation as i8) / CORRELATION_ONE,
        }
    }
}

fn pack_place(px: f32) -> [u8; 3] {
    let steps =
        if px.is_nan() { NO_NUMBER } else { libm::roundf(px * STEPS).clamp(-GREATEST, GREATEST) as i32 };
    let [low, middle, high, _] = steps.to_le_bytes();
    [low, middle, high]
}

fn unpack_place([low, middle, high]: [u8; 3]) -> f32 {
    // Into the upper 24 bits and back, so that the sign is carried down.
    let steps = i32::from_le_bytes([0, low, middle, high]) >> 8;
    if steps == NO_NUMBER { f32::NAN } else { steps as f32 / STEPS }
}

fn pack_sigma(px: f32) -> u8 {
    if px.is_nan() || px < 0.0 {
        return SIGMA_UNKNOWN;
    }
    // log2 of 0 is minus infinity, which saturates to code 0; of infinity, to 255.
    libm::roundf(libm::log2f(px) * SIGMA_OCTAVE + SIGMA_ONE) as u8
}

fn unpack_sigma(code: u8) -> f32 {
    if code == SIGMA_UNKNOWN {
        return f32::INFINITY;
    }
    libm::exp2f((f32::from(code) - SIGMA_ONE) / SIGMA_OCTAVE)
}

/// The centres of one frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Markers<'a> {
    /// The source's own frame number.
    pub frame: u32,
    /// Bit i: circle i was seen.
    pub visible: u64,
    /// Bit i: circle i went into the pose; always among the visible ones.
    pub used: u64,
    /// Nine bytes a visible circle, in the order of the bits; [`Centres`] makes them, [`Markers::iter`] reads
    /// them.
    pub packed: &'a [u8],
}

impl<'a> Markers<'a> {
    /// The visible circles with their centres, by rising number.
    pub fn iter(&self) -> impl Iterator<Item = (u8, Marker)> + use<'a> {
        let mut left = self.visible;
        let (centres, _) = self.packed.as_chunks::<PACKED_MARKER>();
        centres.iter().map_while(move |packed| {
            if left == 0 {
                return None;
            }
            let circle = left.trailing_zeros() as u8;
            left &= left - 1;
            Some((circle, Marker::unpack(*packed)))
        })
    }

    /// Whether the circle went into the pose.
    pub fn is_used(&self, circle: u8) -> bool {
        self.used.checked_shr(u32::from(circle)).unwrap_or(0) & 1 == 1
    }

    /// Whether masks and packed bytes belong together.
    pub(crate) fn is_consistent(&self) -> bool {
        self.used & !self.visible == 0
            && self.packed.len() == self.visible.count_ones() as usize * PACKED_MARKER
    }
}

/// Collects the centres of one frame for a [`Markers`] record.
#[derive(Clone, Debug)]
pub struct Centres {
    visible: u64,
    used: u64,
    packed: [u8; MAX_MARKERS * PACKED_MARKER],
}

impl Default for Centres {
    fn default() -> Self {
        Self::new()
    }
}

impl Centres {
    /// No centres yet.
    pub const fn new() -> Self {
        Self { visible: 0, used: 0, packed: [0; MAX_MARKERS * PACKED_MARKER] }
    }

    /// Forgets the centres, for the next frame.
    pub fn clear(&mut self) {
        self.visible = 0;
        self.used = 0;
    }

    /// Adds the centre of `circle`. Circles come by rising number; one that does not, or that is beyond
    /// [`MAX_MARKERS`], is not taken and `false` is the answer.
    #[must_use]
    pub fn push(&mut self, circle: u8, marker: &Marker, used: bool) -> bool {
        let Some(bit) = 1_u64.checked_shl(u32::from(circle)) else { return false };
        if self.visible >= bit {
            return false;
        }
        let (slots, _) = self.packed.as_chunks_mut::<PACKED_MARKER>();
        let Some(slot) = slots.get_mut(self.visible.count_ones() as usize) else { return false };
        *slot = marker.pack();
        self.visible |= bit;
        if used {
            self.used |= bit;
        }
        true
    }

    /// The record of frame `frame`.
    pub fn markers(&self, frame: u32) -> Markers<'_> {
        let length = self.visible.count_ones() as usize * PACKED_MARKER;
        Markers {
            frame,
            visible: self.visible,
            used: self.used,
            packed: self.packed.get(..length).unwrap_or_default(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn back(marker: Marker) -> Marker {
        Marker::unpack(marker.pack())
    }

    fn at(u: f32, v: f32) -> Marker {
        Marker { at_px: [u, v], sigma_px: [0.02, 0.03], correlation: 0.0 }
    }

    #[test]
    fn a_place_comes_back_to_half_a_step() {
        let mut u = -20.0_f32;
        while u < 4_096.0 {
            // Half of 1/1024 px; the product with 1024 is exact.
            assert!((back(at(u, 7.5)).at_px[0] - u).abs() <= 0.5 / 1024.0);
            u += 0.719_3;
        }
        assert_eq!(back(at(4_095.0 + 1_023.0 / 1_024.0, -0.300_781_25)).at_px, [4_095.999, -0.300_781_25]);
    }

    #[test]
    fn places_beyond_the_scale_are_clamped_and_nan_stays_nan() {
        let greatest = 8_191.0 + 1_023.0 / 1_024.0;
        assert_eq!(back(at(1e9, -1e9)).at_px, [greatest, -greatest]);
        assert_eq!(back(at(f32::INFINITY, f32::NEG_INFINITY)).at_px, [greatest, -greatest]);
        assert!(back(at(f32::NAN, 0.0)).at_px[0].is_nan());
    }

    #[test]
    fn a_standard_deviation_comes_back_to_two_percent() {
        let mut sigma = 0.000_25_f32;
        while sigma < 14.6 {
            let got = back(Marker { sigma_px: [sigma, 1.0], ..at(0.0, 0.0) }).sigma_px;
            // Half a sixteenth of an octave, 2^(1/32) - 1 = 2.19 %.
            assert!((got[0] / sigma - 1.0).abs() < 0.022, "{sigma} came back as {}", got[0]);
            assert_eq!(got[1], 1.0);
            sigma *= 1.003;
        }
    }

    #[test]
    fn standard_deviations_beyond_the_scale_are_defined() {
        let least = libm::exp2f(-12.0);
        for (sigma, expected) in [
            (0.0, least),
            (-0.0, least),
            (1e-20, least),
            (16.0, f32::INFINITY),
            (f32::INFINITY, f32::INFINITY),
            (f32::NAN, f32::INFINITY),
            (-1.0, f32::INFINITY),
        ] {
            assert_eq!(back(Marker { sigma_px: [sigma; 2], ..at(0.0, 0.0) }).sigma_px, [expected; 2]);
        }
    }

    #[test]
    fn a_correlation_never_reaches_one() {
        for (correlation, expected) in [
            (0.5, 0.5),
            (-0.25, -0.25),
            (1.0, 127.0 / 128.0),
            (-1.0, -127.0 / 128.0),
            (7.0, 127.0 / 128.0),
            (f32::NAN, 0.0),
        ] {
            assert_eq!(back(Marker { correlation, ..at(0.0, 0.0) }).correlation, expected);
        }
    }

    #[test]
    fn packing_what_was_unpacked_gives_the_same_bytes() {
        for code in 0..=255_u8 {
            let low = code.wrapping_mul(31);
            let packed = [low, code, 0x3A, code, low, 0xF1, code, 255 - code, (code % 128) ^ (low & 0x80)];
            let packed = if packed[8] == 0x80 { [0; 9] } else { packed };
            assert_eq!(Marker::unpack(packed).pack(), packed);
        }
    }

    #[test]
    fn centres_are_taken_by_rising_number_only() {
        let mut centres = Centres::new();
        assert!(centres.push(2, &at(1.0, 2.0), true));
        assert!(!centres.push(2, &at(1.0, 2.0), true));
        assert!(!centres.push(1, &at(1.0, 2.0), true));
        assert!(centres.push(63, &at(3.0, 4.0), false));
        assert!(!centres.push(64, &at(3.0, 4.0), false));
        let markers = centres.markers(9);
        assert!(markers.is_consistent());
        assert_eq!((markers.visible, markers.used), (1 << 63 | 4, 4));
        assert!(markers.is_used(2) && !markers.is_used(63) && !markers.is_used(200));
        let mut seen = markers.iter();
        assert_eq!(seen.next().map(|(circle, marker)| (circle, marker.at_px)), Some((2, [1.0, 2.0])));
        assert_eq!(seen.next().map(|(circle, marker)| (circle, marker.at_px)), Some((63, [3.0, 4.0])));
        assert_eq!(seen.next(), None);
    }

    #[test]
    fn sixty_four_centres_fit() {
        let mut centres = Centres::new();
        assert!((0..64).all(|circle| centres.push(circle, &at(f32::from(circle), 0.0), true)));
        assert_eq!(centres.markers(0).iter().count(), MAX_MARKERS);
        assert_eq!(centres.markers(0).visible, u64::MAX);
        centres.clear();
        assert_eq!(centres.markers(0).packed.len(), 0);
    }
}
