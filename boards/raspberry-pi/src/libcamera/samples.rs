//! The sample formats of libcamera that a frame can be read from in place, and which of them is the best.

use gangway_device::Layout;
use gangway_setup::SampleFormat;

/// libdrm's DRM_FORMAT_MOD of samples packed as on MIPI CSI-2: vendor 0x0b, number 1.
const PACKED: u64 = 0x0b << 56 | 1;

/// A format, how it lies in memory, and what has to be asked for to get it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Samples {
    /// Its four letters in libdrm.
    pub(super) code: [u8; 4],
    /// libdrm's modifier.
    pub(super) modifier: u64,
    /// How its samples lie in a row.
    pub(super) layout: Layout,
    /// What the setup calls it.
    pub(super) named: SampleFormat,
    /// Whether it is of the raw stream, not of the one for video.
    pub(super) is_raw: bool,
}

impl Samples {
    /// The four letters as libdrm's number.
    pub(super) const fn fourcc(&self) -> u32 {
        u32::from_le_bytes(self.code)
    }

    /// Bytes from row to row, where the camera tells `told`: at least those of a row of `width` samples.
    pub(super) fn stride(&self, width: u16, told: u32) -> usize {
        let row = self.layout.row_bytes(width).unwrap_or(usize::from(width));
        (told as usize).max(row)
    }
}

const fn raw(code: &[u8; 4], modifier: u64, layout: Layout, named: SampleFormat) -> Samples {
    Samples { code: *code, modifier, layout, named, is_raw: true }
}

/// All of them, the best first, as for V4L2 devices.
const SAMPLES: [Samples; 11] = [
    raw(b"R12 ", PACKED, Layout::Packed { bits: 12 }, SampleFormat::Y12p),
    raw(b"R12 ", 0, Layout::Word { bits: 12 }, SampleFormat::Y12),
    raw(b"R16 ", 0, Layout::Word { bits: 16 }, SampleFormat::Y16),
    raw(b"R10 ", PACKED, Layout::Packed { bits: 10 }, SampleFormat::Y10p),
    raw(b"R10 ", 0, Layout::Word { bits: 10 }, SampleFormat::Y10),
    raw(b"R8  ", 0, Layout::GREY, SampleFormat::Grey),
    Samples { is_raw: false, ..raw(b"NV12", 0, Layout::GREY, SampleFormat::Nv12) },
    raw(b"RGGB", 0, Layout::GREY, SampleFormat::Bayer),
    raw(b"GRBG", 0, Layout::GREY, SampleFormat::Bayer),
    raw(b"GBRG", 0, Layout::GREY, SampleFormat::Bayer),
    raw(b"BA81", 0, Layout::GREY, SampleFormat::Bayer),
];

/// Those that the setup asks for, the best first.
pub(super) fn candidates(wanted: SampleFormat) -> impl Iterator<Item = Samples> {
    SAMPLES.into_iter().filter(move |samples| wanted == SampleFormat::Auto || samples.named == wanted)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn only(wanted: SampleFormat) -> Samples {
        let all: Vec<_> = candidates(wanted).collect();
        assert_eq!(all.len(), 1, "{wanted:?}");
        all[0]
    }

    #[test]
    fn the_deepest_format_comes_first_then_the_luma_of_colours_and_a_mosaic_last() {
        let names: Vec<_> = candidates(SampleFormat::Auto).map(|samples| samples.named).collect();
        use SampleFormat::{Bayer, Grey, Nv12, Y10, Y10p, Y12, Y12p, Y16};
        assert_eq!(names, [Y12p, Y12, Y16, Y10p, Y10, Grey, Nv12, Bayer, Bayer, Bayer, Bayer]);
    }

    #[test]
    fn a_forced_format_stands_alone_and_a_mosaic_in_its_four_orders() {
        assert_eq!(only(SampleFormat::Y10p).layout, Layout::Packed { bits: 10 });
        let codes: Vec<_> = candidates(SampleFormat::Bayer).map(|samples| samples.code).collect();
        assert_eq!(codes, [*b"RGGB", *b"GRBG", *b"GBRG", *b"BA81"]);
        assert_eq!(candidates(SampleFormat::Yuyv).count(), 0);
    }

    #[test]
    fn packed_samples_differ_from_words_by_the_modifier_of_mipi() {
        let (packed, word) = (only(SampleFormat::Y12p), only(SampleFormat::Y12));
        // drm_fourcc.h: fourcc_code('R', '1', '2', ' ') and fourcc_mod_code(MIPI, 1).
        assert_eq!((packed.fourcc(), packed.modifier), (0x2032_3152, 0x0b00_0000_0000_0001));
        assert_eq!((word.fourcc(), word.modifier), (0x2032_3152, 0));
    }

    #[test]
    fn only_the_luma_of_colours_is_of_the_stream_for_video() {
        for samples in candidates(SampleFormat::Auto) {
            assert_eq!(samples.is_raw, samples.named != SampleFormat::Nv12, "{samples:?}");
        }
    }

    #[test]
    fn rows_are_as_far_apart_as_told_and_never_closer_than_they_are_long() {
        let packed = only(SampleFormat::Y10p);
        assert_eq!(packed.stride(1_456, 1_856), 1_856);
        assert_eq!(packed.stride(1_456, 0), 1_820);
        assert_eq!(only(SampleFormat::Y12).stride(1_456, 2_911), 2_912);
        for samples in candidates(SampleFormat::Auto) {
            assert!(samples.layout.row_bytes(640).is_some(), "{samples:?}");
        }
    }
}
