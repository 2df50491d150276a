//! A drawn picture: the SVG, and the PNG drawn from it with the fonts of this crate.

use std::sync::{Arc, OnceLock};

use resvg::{tiny_skia, usvg};

use crate::ReportError;

/// Width of every picture, px.
pub const WIDTH_PX: u32 = 1600;

/// Name of the fonts in `fonts/`, as the files themselves say it.
const FONT: &str = "Gangway Sans";
const REGULAR: &[u8] = include_bytes!("../../fonts/GangwaySans-Regular.ttf");
const BOLD: &[u8] = include_bytes!("../../fonts/GangwaySans-Bold.ttf");

/// One picture.
#[derive(Clone, Debug)]
pub struct Picture {
    svg: String,
    height_px: u32,
}

impl Picture {
    /// Puts elements on white paper; the fonts travel with the picture, so that it looks the same everywhere.
    pub(crate) fn new(elements: &str, height_px: u32) -> Self {
        let (regular, bold) = (base64(REGULAR), base64(BOLD));
        let face = |weight: u32, font: &str| {
            format!(
                "@font-face{{font-family:\"{FONT}\";font-weight:{weight};src:url(data:font/ttf;base64,{font})}}"
            )
        };
        let svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{WIDTH_PX}\" height=\"{height_px}\" \
             viewBox=\"0 0 {WIDTH_PX} {height_px}\" font-family=\"'{FONT}', sans-serif\">\n\
             <style>{}{}</style>\n<rect width=\"{WIDTH_PX}\" height=\"{height_px}\" fill=\"#fff\"/>\n{elements}</svg>\n",
            face(400, &regular),
            face(700, &bold),
        );
        Self { svg, height_px }
    }

    /// The picture as SVG.
    pub fn svg(&self) -> &str {
        &self.svg
    }

    /// Its height, px; the width is [`WIDTH_PX`].
    pub fn height_px(&self) -> u32 {
        self.height_px
    }

    /// The picture as PNG.
    ///
    /// # Errors
    ///
    /// Where the renderer refuses the picture.
    pub fn png(&self) -> Result<Vec<u8>, ReportError> {
        let error = |what: String| ReportError::Draw { what };
        let options = usvg::Options { fontdb: fonts(), ..usvg::Options::default() };
        let tree = usvg::Tree::from_str(&self.svg, &options).map_err(|e| error(e.to_string()))?;
        let mut pixels = tiny_skia::Pixmap::new(WIDTH_PX, self.height_px)
            .ok_or_else(|| error(format!("{WIDTH_PX} x {} px is no size", self.height_px)))?;
        resvg::render(&tree, tiny_skia::Transform::identity(), &mut pixels.as_mut());
        pixels.encode_png().map_err(|e| error(e.to_string()))
    }
}

/// The two fonts of this crate and none of the system's: pictures are the same on every machine.
fn fonts() -> Arc<usvg::fontdb::Database> {
    static FONTS: OnceLock<Arc<usvg::fontdb::Database>> = OnceLock::new();
    let load = || {
        let mut fonts = usvg::fontdb::Database::new();
        fonts.load_font_data(REGULAR.to_vec());
        fonts.load_font_data(BOLD.to_vec());
        fonts.set_sans_serif_family(FONT);
        Arc::new(fonts)
    };
    FONTS.get_or_init(load).clone()
}

/// RFC 4648, section 4.
fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut out = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for chunk in bytes.chunks(3) {
        let byte = |i: usize| u32::from(chunk.get(i).copied().unwrap_or(0));
        let bits = byte(0) << 16 | byte(1) << 8 | byte(2);
        for i in 0..4 {
            let digit = DIGITS[(bits >> (18 - 6 * i) & 63) as usize];
            out.push(if i <= chunk.len() { char::from(digit) } else { '=' });
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_is_that_of_the_rfc() {
        // The test vectors of RFC 4648, section 10.
        let vectors = [
            ("", ""),
            ("f", "Zg=="),
            ("fo", "Zm8="),
            ("foo", "Zm9v"),
            ("foob", "Zm9vYg=="),
            ("fooba", "Zm9vYmE="),
        ];
        for (plain, coded) in vectors {
            assert_eq!(base64(plain.as_bytes()), coded);
        }
    }

    #[test]
    fn text_is_drawn_with_the_fonts_of_this_crate() {
        let dark = |elements: &str| {
            let png = Picture::new(elements, 100).png().unwrap();
            let pixels = tiny_skia::Pixmap::decode_png(&png).unwrap();
            assert_eq!((pixels.width(), pixels.height()), (WIDTH_PX, 100));
            pixels.pixels().iter().filter(|p| p.red() < 128).count()
        };
        assert_eq!(dark(""), 0);
        let regular = dark("<text x=\"20\" y=\"60\" font-size=\"40\">roll / ° ± \u{2212}</text>");
        let bold =
            dark("<text x=\"20\" y=\"60\" font-size=\"40\" font-weight=\"700\">roll / ° ± \u{2212}</text>");
        assert!(regular > 300 && bold > regular, "{regular} {bold}");
    }
}
