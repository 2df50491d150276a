//! Samples along a line through the picture, one after the other.

use gangway_device::{Frame, Layout};

use super::top;

/// The top 8 bits of the samples from a place on, in steps of a pixel, up to the picture's edge.
pub(crate) struct Ray<'f> {
    frame: &'f Frame<'f>,
    at: [i32; 2],
    step: [i32; 2],
    /// Samples to the picture's edge.
    left: i32,
    /// Where samples are bytes of their own: the picture, the next one's place in it and the way to the one
    /// after it.
    bytes: &'f [u8],
    next: usize,
    by: isize,
}

impl<'f> Ray<'f> {
    /// From `at`, which is the first sample, along `step`, whose parts are -1, 0 or 1.
    #[inline(always)]
    pub(crate) fn new(frame: &'f Frame<'f>, at: [i32; 2], step: [i32; 2]) -> Self {
        let size = [frame.width(), frame.height()].map(i32::from);
        let is_inside = (0..2).all(|i| (0..size[i]).contains(&at[i]));
        let steps = |i: usize| match step[i] {
            0 => i32::MAX,
            1 => size[i] - at[i],
            _ => at[i] + 1,
        };
        let left = if is_inside { steps(0).min(steps(1)) } else { 0 };
        let (bytes, next, by) = match frame.layout() {
            Layout::Byte { step: apart, offset } if is_inside => {
                let (stride, apart) = (frame.stride(), usize::from(apart));
                let next = at[1] as usize * stride + at[0] as usize * apart + usize::from(offset);
                let by = step[1] as isize * stride as isize + step[0] as isize * apart as isize;
                (frame.rows_from(0), next, by)
            }
            _ => (&[][..], 0, 0),
        };
        Self { frame, at, step, left, bytes, next, by }
    }
}

impl Iterator for Ray<'_> {
    type Item = u8;

    #[inline(always)]
    fn next(&mut self) -> Option<u8> {
        if self.left <= 0 {
            return None;
        }
        self.left -= 1;
        if self.bytes.is_empty() {
            let [x, y] = self.at;
            self.at = [x + self.step[0], y + self.step[1]];
            return top(self.frame, u16::try_from(x).ok()?, u16::try_from(y).ok()?);
        }
        let sample = self.bytes.get(self.next).copied();
        self.next = self.next.wrapping_add_signed(self.by);
        sample
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ray_has_the_samples_up_to_the_pictures_edge_in_every_layout() {
        let size = (7, 5);
        for (layout, apart) in [
            (Layout::GREY, 1),
            (Layout::Byte { step: 2, offset: 1 }, 2),
            (Layout::Word { bits: 12 }, 2),
            (Layout::Packed { bits: 10 }, 2),
        ] {
            let stride = 7 * apart + 3;
            let bytes: std::vec::Vec<u8> = (0..5 * stride).map(|i| (i * 37 % 251) as u8).collect();
            let frame = Frame::new(&bytes, size, stride, layout, 0, 0).unwrap();
            for x in -1..=7 {
                for y in -1..=5 {
                    for step in [[1, 0], [-1, 0], [0, 1], [0, -1], [1, 1], [-1, -1], [-1, 1], [1, -1]] {
                        let mut ray = Ray::new(&frame, [x, y], step);
                        for i in 0..10 {
                            let at = [x + i * step[0], y + i * step[1]];
                            let expected = match at.map(u16::try_from) {
                                [Ok(x), Ok(y)] => top(&frame, x, y),
                                _ => None,
                            };
                            assert_eq!(ray.next(), expected, "{layout:?} {at:?}");
                            if expected.is_none() {
                                break;
                            }
                        }
                    }
                }
            }
        }
    }
}
