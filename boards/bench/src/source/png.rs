//! PNG pictures: grey as it is; colour as its luma (BT.601, as video has it); transparency passed over.

use gangway_device::Layout;
use png::{BitDepth, ColorType, Transformations};

use super::{Shape, to_little_endian};

/// Reads a picture into `into` and tells whether it was in colour; the error says what is wrong with the
/// file.
pub(super) fn read(bytes: &[u8], into: &mut Vec<u8>) -> Result<(Shape, bool), String> {
    let mut decoder = png::Decoder::new(std::io::Cursor::new(bytes));
    // Palettes and depths below 8 bit become plain samples.
    decoder.set_transformations(Transformations::EXPAND);
    let mut reader = decoder.read_info().map_err(|error| error.to_string())?;
    let size = reader.output_buffer_size().ok_or("it is too large")?;
    let side = |side: u32| u16::try_from(side).map_err(|_| "it is too large".to_owned());
    let (width, height) = (side(reader.info().width)?, side(reader.info().height)?);
    into.resize(size, 0);
    let info = reader.next_frame(into).map_err(|error| error.to_string())?;
    into.truncate(info.buffer_size());

    let is_deep = info.bit_depth == BitDepth::Sixteen;
    let layout = if is_deep { Layout::Word { bits: 16 } } else { Layout::GREY };
    let samples = match info.color_type {
        ColorType::Grayscale => 1,
        ColorType::GrayscaleAlpha => 2,
        ColorType::Rgb => 3,
        ColorType::Rgba => 4,
        ColorType::Indexed => return Err("its palette could not be applied".into()),
    };
    if is_deep {
        to_little_endian(into);
    }
    match (samples, is_deep) {
        (1, _) => {}
        (_, false) => reduce::<1>(into, samples),
        (_, true) => reduce::<2>(into, samples),
    }
    Ok((Shape { width, height, layout }, samples >= 3))
}

/// Keeps one grey sample of `BYTES` bytes of every pixel, in place.
fn reduce<const BYTES: usize>(bytes: &mut Vec<u8>, samples: usize) {
    let value = |sample: &[u8]| sample.iter().rev().fold(0u32, |value, &byte| value << 8 | u32::from(byte));
    let pixels = bytes.len() / (BYTES * samples);
    for pixel in 0..pixels {
        let from = pixel * BYTES * samples;
        let mut channels = bytes.get(from..).unwrap_or_default().chunks_exact(BYTES).map(value);
        let first = channels.next().unwrap_or(0);
        let grey = if samples < 3 {
            first
        } else {
            let (green, blue) = (channels.next().unwrap_or(0), channels.next().unwrap_or(0));
            (299 * first + 587 * green + 114 * blue + 500) / 1_000
        };
        let at = pixel * BYTES;
        if let (Some(into), Some(from)) = (bytes.get_mut(at..at + BYTES), grey.to_le_bytes().get(..BYTES)) {
            into.copy_from_slice(from);
        }
    }
    bytes.truncate(pixels * BYTES);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn encode(color: ColorType, depth: BitDepth, width: u32, samples: &[u8]) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, width, 1);
        encoder.set_color(color);
        encoder.set_depth(depth);
        let mut writer = encoder.write_header().unwrap();
        writer.write_image_data(samples).unwrap();
        writer.finish().unwrap();
        bytes
    }

    fn read(bytes: &[u8]) -> Result<(Shape, bool, Vec<u8>), String> {
        let mut into = Vec::new();
        super::read(bytes, &mut into).map(|(shape, colour)| (shape, colour, into))
    }

    #[test]
    fn grey_pictures_are_taken_as_they_are() {
        let (shape, is_colour, samples) =
            read(&encode(ColorType::Grayscale, BitDepth::Eight, 3, &[1, 2, 255])).unwrap();
        assert_eq!((shape.layout, is_colour, samples), (Layout::GREY, false, vec![1, 2, 255]));
        let (shape, is_colour, samples) =
            read(&encode(ColorType::Grayscale, BitDepth::Sixteen, 2, &[0x12, 0x34, 0, 1])).unwrap();
        assert_eq!(shape.layout, Layout::Word { bits: 16 });
        assert_eq!((is_colour, samples), (false, vec![0x34, 0x12, 1, 0]));
        let (.., samples) = read(&encode(ColorType::Grayscale, BitDepth::One, 8, &[0b1010_0000])).unwrap();
        assert_eq!(samples, [255, 0, 255, 0, 0, 0, 0, 0]);
    }

    #[test]
    fn colour_gives_its_luma_and_says_so() {
        let rgb = [255, 0, 0, 0, 255, 0, 0, 0, 255, 7, 7, 7];
        let (shape, is_colour, samples) = read(&encode(ColorType::Rgb, BitDepth::Eight, 4, &rgb)).unwrap();
        // BT.601: 0.299, 0.587, 0.114 of 255.
        assert_eq!((shape.width, is_colour, samples), (4, true, vec![76, 150, 29, 7]));
        let deep = [0xff, 0xff, 0, 0, 0, 0, 0x12, 0x34];
        let (.., samples) = read(&encode(ColorType::Rgba, BitDepth::Sixteen, 1, &deep)).unwrap();
        assert_eq!(u16::from_le_bytes([samples[0], samples[1]]), 19_595);
        assert_eq!(samples.len(), 2);
        let (_, is_colour, samples) =
            read(&encode(ColorType::GrayscaleAlpha, BitDepth::Eight, 2, &[9, 0, 8, 0])).unwrap();
        assert_eq!((is_colour, samples), (false, vec![9, 8]));
    }

    #[test]
    fn rubbish_is_refused() {
        let whole = encode(ColorType::Grayscale, BitDepth::Eight, 3, &[1, 2, 3]);
        assert!(read(b"").is_err());
        assert!(read(b"P5 1 1 255 a").is_err());
        for end in 0..whole.len() - 16 {
            assert!(read(&whole[..end]).is_err(), "cut at {end}");
        }
    }
}
