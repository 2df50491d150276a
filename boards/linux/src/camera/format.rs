//! The sample formats of V4L2 that a frame can be read from in place, and which of them is the best.

use std::fmt;

use gangway_device::Layout;
use gangway_setup::SampleFormat;

/// A format by its V4L2 code of four letters.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct PixelFormat {
    /// The four letters.
    pub code: [u8; 4],
    /// How its samples lie in a row.
    pub layout: Layout,
    /// What the setup calls it.
    pub named: SampleFormat,
}

impl PixelFormat {
    /// Whether neighbouring samples see different colours.
    pub fn is_mosaic(&self) -> bool {
        self.named == SampleFormat::Bayer
    }
}

impl fmt::Display for PixelFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&letters(self.code))
    }
}

impl fmt::Debug for PixelFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

/// The letters of a code, without the spaces that fill it up.
pub(crate) fn letters(code: [u8; 4]) -> String {
    String::from_utf8_lossy(&code).trim_end().to_owned()
}

const fn entry(code: &[u8; 4], layout: Layout, named: SampleFormat) -> PixelFormat {
    PixelFormat { code: *code, layout, named }
}

const LUMA_FIRST: Layout = Layout::Byte { step: 2, offset: 0 };
const LUMA_SECOND: Layout = Layout::Byte { step: 2, offset: 1 };

/// All of them, the best first: real depth, then the fewest bytes, then a luma made from colours, and last a
/// mosaic, whose samples do not even see the same light.
const FORMATS: [PixelFormat; 13] = [
    entry(b"Y12P", Layout::Packed { bits: 12 }, SampleFormat::Y12p),
    entry(b"Y12 ", Layout::Word { bits: 12 }, SampleFormat::Y12),
    entry(b"Y16 ", Layout::Word { bits: 16 }, SampleFormat::Y16),
    entry(b"Y10P", Layout::Packed { bits: 10 }, SampleFormat::Y10p),
    entry(b"Y10 ", Layout::Word { bits: 10 }, SampleFormat::Y10),
    entry(b"GREY", Layout::GREY, SampleFormat::Grey),
    entry(b"NV12", Layout::GREY, SampleFormat::Nv12),
    entry(b"YUYV", LUMA_FIRST, SampleFormat::Yuyv),
    entry(b"UYVY", LUMA_SECOND, SampleFormat::Uyvy),
    entry(b"RGGB", Layout::GREY, SampleFormat::Bayer),
    entry(b"GRBG", Layout::GREY, SampleFormat::Bayer),
    entry(b"GBRG", Layout::GREY, SampleFormat::Bayer),
    entry(b"BA81", Layout::GREY, SampleFormat::Bayer),
];

/// Those of the device's formats that can be used and are asked for, the best first.
pub(crate) fn candidates(device: &[[u8; 4]], wanted: SampleFormat) -> Vec<PixelFormat> {
    let asked = |format: &&PixelFormat| wanted == SampleFormat::Auto || format.named == wanted;
    FORMATS.iter().filter(asked).filter(|format| device.contains(&format.code)).copied().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_deepest_format_comes_first_and_a_mosaic_last() {
        let device = [*b"MJPG", *b"RGGB", *b"YUYV", *b"GREY", *b"Y10 ", *b"Y10P"];
        let found: Vec<_> = candidates(&device, SampleFormat::Auto).iter().map(|f| f.to_string()).collect();
        assert_eq!(found, ["Y10P", "Y10", "GREY", "YUYV", "RGGB"]);
    }

    #[test]
    fn a_forced_format_stands_alone() {
        let device = [*b"YUYV", *b"GREY", *b"BA81"];
        assert_eq!(candidates(&device, SampleFormat::Grey).len(), 1);
        assert_eq!(candidates(&device, SampleFormat::Y12), []);
        assert!(candidates(&device, SampleFormat::Bayer)[0].is_mosaic());
    }

    #[test]
    fn every_layout_is_one_that_a_frame_takes() {
        for format in FORMATS {
            assert!(format.layout.row_bytes(640).is_some(), "{format}");
        }
    }
}
