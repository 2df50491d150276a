//! One picture as the camera delivered it: bytes, size, row stride and how samples lie in the bytes.

/// How one grey sample lies in the bytes of a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layout {
    /// One byte a sample: sample `i` of a row is byte `offset + i * step`.
    ///
    /// GREY is `step` 1, `offset` 0; the luma of YUYV is 2, 0; that of UYVY is 2, 1.
    Byte {
        /// Distance from one sample to the next, bytes, 1 to 4.
        step: u8,
        /// Byte of the row's first sample, less than `step`.
        offset: u8,
    },
    /// Two bytes a sample, little-endian, the value in the low `bits` bits (9 to 16).
    Word {
        /// Significant bits of a sample.
        bits: u8,
    },
    /// Several samples share a byte (MIPI CSI-2, as V4L2's Y10P and Y12P): groups of four samples of 10 bits
    /// in 5 bytes, or of two samples of 12 bits in 3 bytes. First comes a byte with the top 8 bits of each
    /// sample, then one with their low bits, the first sample's lowest. Rows are whole groups.
    Packed {
        /// Significant bits of a sample, 10 or 12.
        bits: u8,
    },
}

impl Layout {
    /// One byte a sample, nothing between them: V4L2 GREY, or the luma plane of a planar format.
    pub const GREY: Layout = Layout::Byte { step: 1, offset: 0 };

    /// Significant bits of a sample.
    pub const fn bits(self) -> u8 {
        match self {
            Layout::Byte { .. } => 8,
            Layout::Word { bits } | Layout::Packed { bits } => bits,
        }
    }

    /// Samples of a group whose low bits share a byte; 1 where every sample has its own bytes.
    pub const fn group(self) -> usize {
        match self {
            Layout::Packed { bits: 10 } => 4,
            Layout::Packed { bits: 12 } => 2,
            _ => 1,
        }
    }

    /// Bytes that a row of `width` samples takes at least, 0 for none, `None` if the layout itself is
    /// impossible.
    pub const fn row_bytes(self, width: u16) -> Option<usize> {
        let width = width as usize;
        match self {
            Layout::Byte { step, offset } if step >= 1 && step <= 4 && offset < step => {
                Some(if width == 0 { 0 } else { (width - 1) * step as usize + offset as usize + 1 })
            }
            Layout::Word { bits } if bits > 8 && bits <= 16 => Some(2 * width),
            Layout::Packed { bits: 10 | 12 } => Some(width.div_ceil(self.group()) * (self.group() + 1)),
            _ => None,
        }
    }
}

/// Why bytes are no frame of the size and layout they claim.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameError {
    /// Width or height is zero.
    Empty,
    /// The layout's step, offset or bits are out of their bounds.
    Layout,
    /// A row does not fit into the stride.
    Stride,
    /// Fewer bytes than the rows need: a torn frame.
    Short,
}

/// A borrowed picture with its number and time.
#[derive(Clone, Copy, Debug)]
pub struct Frame<'a> {
    bytes: &'a [u8],
    width: u16,
    height: u16,
    stride: usize,
    layout: Layout,
    number: u32,
    time_ns: u64,
    complete_ns: Option<u64>,
}

impl<'a> Frame<'a> {
    /// Checks that `bytes` holds `height` rows of `width` samples, `stride` bytes apart.
    ///
    /// `number` is the source's own frame number, `time_ns` the monotonic clock at mid-exposure.
    ///
    /// # Errors
    /// What does not fit, see [`FrameError`].
    pub fn new(
        bytes: &'a [u8],
        (width, height): (u16, u16),
        stride: usize,
        layout: Layout,
        number: u32,
        time_ns: u64,
    ) -> Result<Self, FrameError> {
        if width == 0 || height == 0 {
            return Err(FrameError::Empty);
        }
        let row = layout.row_bytes(width).ok_or(FrameError::Layout)?;
        if stride < row {
            return Err(FrameError::Stride);
        }
        let needed = stride.checked_mul(height as usize - 1).and_then(|n| n.checked_add(row));
        if needed.is_none_or(|needed| bytes.len() < needed) {
            return Err(FrameError::Short);
        }
        Ok(Self { bytes, width, height, stride, layout, number, time_ns, complete_ns: None })
    }

    /// The same frame with the monotonic clock at the end of its readout, ns, where the source knows it.
    pub fn complete_at(self, complete_ns: Option<u64>) -> Self {
        Self { complete_ns, ..self }
    }

    /// Width in samples.
    pub fn width(&self) -> u16 {
        self.width
    }

    /// Height in rows.
    pub fn height(&self) -> u16 {
        self.height
    }

    /// How samples lie in a row.
    pub fn layout(&self) -> Layout {
        self.layout
    }

    /// The source's own frame number.
    pub fn number(&self) -> u32 {
        self.number
    }

    /// Monotonic clock at mid-exposure, ns.
    pub fn time_ns(&self) -> u64 {
        self.time_ns
    }

    /// Monotonic clock at the end of its readout, ns: from then on it could be taken. `None` where that is
    /// not known.
    pub fn complete_ns(&self) -> Option<u64> {
        self.complete_ns
    }

    /// Bytes from one row's first to the next one's.
    pub fn stride(&self) -> usize {
        self.stride
    }

    /// The bytes from row `y` on, to the picture's end and what the source left behind it; none below the
    /// picture.
    pub fn rows_from(&self, y: u16) -> &'a [u8] {
        self.bytes.get(y as usize * self.stride..).unwrap_or_default()
    }

    /// The bytes of row `y`, from its first sample's first byte on; `None` below the picture.
    #[inline]
    pub fn row(&self, y: u16) -> Option<&'a [u8]> {
        if y >= self.height {
            return None;
        }
        let start = y as usize * self.stride;
        let end = (start + self.stride).min(self.bytes.len());
        self.bytes.get(start..end)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_needs_only_the_samples_of_its_last_row() {
        let bytes = [0u8; 10 + 4];
        assert!(Frame::new(&bytes, (4, 2), 10, Layout::GREY, 0, 0).is_ok());
        assert_eq!(Frame::new(&bytes[..13], (4, 2), 10, Layout::GREY, 0, 0).unwrap_err(), FrameError::Short);
    }

    #[test]
    fn impossible_layouts_are_refused() {
        for layout in [
            Layout::Byte { step: 0, offset: 0 },
            Layout::Byte { step: 2, offset: 2 },
            Layout::Word { bits: 8 },
            Layout::Word { bits: 17 },
            Layout::Packed { bits: 8 },
            Layout::Packed { bits: 14 },
        ] {
            assert_eq!(Frame::new(&[0; 64], (2, 2), 8, layout, 0, 0).unwrap_err(), FrameError::Layout);
        }
        assert_eq!(Frame::new(&[0; 64], (9, 2), 8, Layout::GREY, 0, 0).unwrap_err(), FrameError::Stride);
        assert_eq!(Frame::new(&[0; 64], (0, 2), 8, Layout::GREY, 0, 0).unwrap_err(), FrameError::Empty);
        assert_eq!(
            Frame::new(&[0; 8], (2, 9), usize::MAX, Layout::GREY, 0, 0).unwrap_err(),
            FrameError::Short
        );
    }

    #[test]
    fn a_row_of_no_samples_takes_no_bytes() {
        for layout in [Layout::GREY, Layout::Word { bits: 12 }, Layout::Packed { bits: 10 }] {
            assert_eq!(layout.row_bytes(0), Some(0), "{layout:?}");
        }
    }

    #[test]
    fn packed_rows_are_whole_groups() {
        let rows = |bits: u8| [4, 5, 8].map(|width| Layout::Packed { bits }.row_bytes(width));
        assert_eq!(rows(10), [Some(5), Some(10), Some(10)]);
        assert_eq!(rows(12), [Some(6), Some(9), Some(12)]);
    }

    #[test]
    fn rows_end_with_the_picture() {
        let bytes: [u8; 14] = core::array::from_fn(|i| i as u8);
        let frame = Frame::new(&bytes, (4, 2), 10, Layout::GREY, 7, 9).unwrap();
        assert_eq!(frame.row(1), Some(&bytes[10..14]));
        assert_eq!(frame.row(2), None);
    }
}
