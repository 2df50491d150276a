//! PGM (Netpbm grey maps): binary `P5` and plain `P2`, 8 bit and 9 to 16 bit.

use gangway_device::Layout;

use super::{Shape, to_little_endian};

/// Reads a picture into `into`; the error says what is wrong with the file.
pub(super) fn read(bytes: &[u8], into: &mut Vec<u8>) -> Result<Shape, String> {
    let (is_plain, rest) = match bytes.split_at_checked(2) {
        Some((b"P5", rest)) => (false, rest),
        Some((b"P2", rest)) => (true, rest),
        _ => return Err("it begins with neither P5 nor P2".into()),
    };
    let mut rest = rest;
    let width = size(number(&mut rest), "width")?;
    let height = size(number(&mut rest), "height")?;
    let full = match number(&mut rest) {
        Some(full @ 1..=65_535) => full,
        _ => return Err("its maximum is not from 1 to 65535".into()),
    };
    // Netpbm scales by the maximum; full scale here is a power of two, so a few files are a little darker.
    let bits = (32 - full.leading_zeros()).max(8) as u8;
    let layout = if bits == 8 { Layout::GREY } else { Layout::Word { bits } };
    let shape = Shape { width, height, layout };
    into.clear();
    if is_plain {
        for _ in 0..usize::from(width) * usize::from(height) {
            let sample = number(&mut rest).ok_or("it ends within the picture")?.min(full);
            into.extend_from_slice(
                sample.to_le_bytes().get(..usize::from(bits).div_ceil(8)).unwrap_or_default(),
            );
        }
        return Ok(shape);
    }
    // One white space stands between the head and the samples.
    let samples = rest.get(1..1 + shape.bytes()).ok_or("it ends within the picture")?;
    into.extend_from_slice(samples);
    if bits > 8 {
        to_little_endian(into);
    }
    Ok(shape)
}

fn size(found: Option<u32>, what: &str) -> Result<u16, String> {
    found
        .and_then(|size| u16::try_from(size).ok())
        .filter(|&size| size > 0)
        .ok_or_else(|| format!("its {what} is not from 1 to 65535"))
}

/// The next number; white space and comments before it are passed over, nothing behind it.
fn number(rest: &mut &[u8]) -> Option<u32> {
    loop {
        match rest.first()? {
            b'#' => {
                let end = rest.iter().position(|&byte| byte == b'\n')?;
                *rest = rest.get(end..)?;
            }
            byte if byte.is_ascii_whitespace() => *rest = rest.get(1..)?,
            _ => break,
        }
    }
    let digits = rest.iter().take_while(|byte| byte.is_ascii_digit()).count();
    let (digits, behind) = rest.split_at_checked(digits)?;
    *rest = behind;
    std::str::from_utf8(digits).ok()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(bytes: &[u8]) -> Result<(Shape, Vec<u8>), String> {
        let mut into = Vec::new();
        super::read(bytes, &mut into).map(|shape| (shape, into))
    }

    #[test]
    fn binary_and_plain_files_give_the_same_picture() {
        let shape = Shape { width: 3, height: 1, layout: Layout::GREY };
        assert_eq!(read(b"P5\n# made by hand\n3 1\n255\n\x01\n\x03"), Ok((shape, vec![1, 10, 3])));
        assert_eq!(read(b"P2 3 1 255\n1 10\n3"), Ok((shape, vec![1, 10, 3])));
    }

    #[test]
    fn deep_samples_become_little_endian() {
        let shape = Shape { width: 2, height: 1, layout: Layout::Word { bits: 12 } };
        assert_eq!(read(b"P5 2 1 4095 \x0f\xfe\x00\x01"), Ok((shape, vec![0xfe, 0x0f, 1, 0])));
        assert_eq!(read(b"P2 2 1 4095 4094 1"), Ok((shape, vec![0xfe, 0x0f, 1, 0])));
        assert_eq!(read(b"P5 1 1 65535 \x12\x34").unwrap().0.layout, Layout::Word { bits: 16 });
    }

    #[test]
    fn rubbish_is_refused() {
        for (bytes, says) in [
            (&b"P6 1 1 255 abc"[..], "neither P5 nor P2"),
            (b"P", "neither P5 nor P2"),
            (b"P5 0 1 255 a", "its width"),
            (b"P5 1 70000 255 a", "its height"),
            (b"P5 1 99999999999 255 a", "its height"),
            (b"P5 1 1 0 a", "its maximum"),
            (b"P5 1 1 65536 ab", "its maximum"),
            (b"P5 2 2 255 abc", "ends within"),
            (b"P2 2 2 255 1 2 3", "ends within"),
            (b"P5 2 #", "its height"),
        ] {
            let said = read(bytes).unwrap_err();
            assert!(said.contains(says), "{said}");
        }
    }
}
