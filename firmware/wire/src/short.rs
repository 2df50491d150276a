//! The short float: a non-negative `f32` in two bytes, without its sign and its low 15 bits of mantissa.
//! Relative error at most 2^-9 (0.2 %); used for standard deviations and residuals.

use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Bits of an `f32` that are dropped.
const DROPPED: u32 = 15;
/// Code of the greatest finite value; one more is infinity.
const GREATEST: u16 = 0xFEFF;
/// The one code for "not a number" that is ever written.
const NAN: u16 = 0xFF80;

/// Code of `value`, rounded to nearest. A negative value is no standard deviation: it is written as NaN.
pub(crate) fn to_code(value: f32) -> u16 {
    if value.is_nan() || value < 0.0 {
        return NAN;
    }
    // -0.0 comes this far; its sign is dropped here.
    let bits = value.abs().to_bits();
    let code = ((bits + (1 << (DROPPED - 1))) >> DROPPED) as u16;
    if value.is_finite() { code.min(GREATEST) } else { code }
}

/// Value of `code`.
pub(crate) fn from_code(code: u16) -> f32 {
    f32::from_bits(u32::from(code) << DROPPED)
}

/// One short float, for `#[serde(with)]`: two bytes, little-endian.
pub(crate) mod one {
    use super::*;

    pub(crate) fn serialize<S: Serializer>(value: &f32, serializer: S) -> Result<S::Ok, S::Error> {
        to_code(*value).to_le_bytes().serialize(serializer)
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f32, D::Error> {
        <[u8; 2]>::deserialize(deserializer).map(|bytes| from_code(u16::from_le_bytes(bytes)))
    }
}

/// Six short floats, for `#[serde(with)]`: twelve bytes.
pub(crate) mod six {
    use super::*;

    pub(crate) fn serialize<S: Serializer>(values: &[f32; 6], serializer: S) -> Result<S::Ok, S::Error> {
        values.map(|value| to_code(value).to_le_bytes()).serialize(serializer)
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<[f32; 6], D::Error> {
        let codes = <[[u8; 2]; 6]>::deserialize(deserializer)?;
        Ok(codes.map(|bytes| from_code(u16::from_le_bytes(bytes))))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_code_but_the_nans_comes_back() {
        for code in 0..=0xFF00 {
            assert_eq!(to_code(from_code(code)), code);
        }
        for code in 0xFF01..=u16::MAX {
            assert_eq!(to_code(from_code(code)), NAN);
        }
    }

    #[test]
    fn the_error_is_at_most_two_tenths_of_a_percent() {
        let mut value = 1e-30_f32;
        while value < 1e30 {
            let back = from_code(to_code(value));
            // Half a step of 8 bits of mantissa, 2^-9, plus the rounding of this very division.
            assert!(((back - value) / value).abs() <= 1.0001 / 512.0, "{value} came back as {back}");
            value *= 1.000_37;
        }
    }

    #[test]
    fn values_that_are_no_standard_deviation_are_defined() {
        assert_eq!(to_code(0.0), 0);
        assert_eq!(to_code(-0.0), 0);
        assert_eq!(to_code(1.0), 0x7F00);
        assert_eq!(to_code(-1.0), NAN);
        assert_eq!(to_code(f32::NEG_INFINITY), NAN);
        assert_eq!(to_code(f32::NAN), NAN);
        assert_eq!(to_code(f32::MAX), GREATEST);
        assert_eq!(to_code(f32::INFINITY), GREATEST + 1);
        assert!(from_code(NAN).is_nan());
        assert_eq!(from_code(GREATEST + 1), f32::INFINITY);
    }
}
