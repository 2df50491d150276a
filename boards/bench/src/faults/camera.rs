//! A camera that drops, repeats, tears, darkens or delays frames of another.

use gangway_device::{Camera, CameraErrorKind, Exposure, Frame, Layout};

use super::{CameraFaults, choose};
use crate::random::Random;

/// Another camera with faults. Whether a frame is hit depends on the seed and its place only.
pub struct FaultyCamera<C> {
    camera: C,
    faults: CameraFaults,
    random: Random,
    /// A frame that is delivered again, or darkened.
    held: Held,
    repeats: bool,
    delays: bool,
}

#[derive(Default)]
struct Held {
    bytes: Vec<u8>,
    size: (u16, u16),
    stride: usize,
    layout: Option<Layout>,
    number: u32,
    time_ns: u64,
}

impl Held {
    fn keep(&mut self, frame: &Frame<'_>) {
        let rows = (0..frame.height()).map_while(|y| frame.row(y));
        self.bytes.clear();
        // The last row may be shorter than the others.
        self.stride = frame.row(0).map_or(0, <[u8]>::len);
        rows.for_each(|row| self.bytes.extend_from_slice(row));
        self.size = (frame.width(), frame.height());
        self.layout = Some(frame.layout());
        self.number = frame.number();
        self.time_ns = frame.time_ns();
    }

    fn frame(&self) -> Option<Frame<'_>> {
        Frame::new(&self.bytes, self.size, self.stride, self.layout?, self.number, self.time_ns).ok()
    }
}

impl<C: Camera<Error = CameraErrorKind>> FaultyCamera<C> {
    /// Puts faults upon a camera.
    pub fn new(camera: C, faults: CameraFaults, seed: u64) -> Self {
        Self { camera, faults, random: Random(seed), held: Held::default(), repeats: false, delays: false }
    }

    /// The camera behind the faults.
    pub fn camera(&mut self) -> &mut C {
        &mut self.camera
    }
}

impl<C: Camera<Error = CameraErrorKind>> Camera for FaultyCamera<C> {
    type Error = CameraErrorKind;

    fn set_exposure(&mut self, wanted: Exposure) -> Option<Exposure> {
        self.camera.set_exposure(wanted)
    }

    fn next_frame(&mut self) -> Result<Frame<'_>, CameraErrorKind> {
        if std::mem::take(&mut self.delays) {
            return self.camera.next_frame();
        }
        if std::mem::take(&mut self.repeats) {
            return self.held.frame().ok_or(CameraErrorKind::Corrupt);
        }
        let CameraFaults { drop, repeat, torn, dark, late } = self.faults;
        if self.faults == CameraFaults::default() {
            return self.camera.next_frame();
        }
        loop {
            match choose(self.random.share(), &[drop, repeat, torn, dark, late]) {
                Some(0) => {
                    self.camera.next_frame()?;
                }
                Some(1) => {
                    self.repeats = true;
                    self.held.keep(&self.camera.next_frame()?);
                    return self.held.frame().ok_or(CameraErrorKind::Corrupt);
                }
                Some(2) => {
                    self.camera.next_frame()?;
                    return Err(CameraErrorKind::Corrupt);
                }
                Some(3) => {
                    self.held.keep(&self.camera.next_frame()?);
                    self.held.bytes.fill(0);
                    return self.held.frame().ok_or(CameraErrorKind::Corrupt);
                }
                Some(_) => {
                    self.delays = true;
                    return Err(CameraErrorKind::Stalled);
                }
                None => return self.camera.next_frame(),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Delivers as many frames as it is asked for, up to 1,000.
    struct Counting(u32);

    impl Camera for Counting {
        type Error = CameraErrorKind;

        fn next_frame(&mut self) -> Result<Frame<'_>, CameraErrorKind> {
            self.0 += 1;
            if self.0 > 1_000 {
                return Err(CameraErrorKind::Ended);
            }
            Ok(Frame::new(&[1, 2, 9, 3, 4], (2, 2), 3, Layout::GREY, self.0, u64::from(self.0)).unwrap())
        }
    }

    type Seen = Result<(u32, u8), CameraErrorKind>;

    fn play(faults: CameraFaults, seed: u64) -> Vec<Seen> {
        let mut camera = FaultyCamera::new(Counting(0), faults, seed);
        let mut seen = Vec::new();
        loop {
            match camera.next_frame() {
                Ok(frame) => seen.push(Ok((frame.number(), frame.row(1).unwrap()[1]))),
                Err(CameraErrorKind::Ended) => return seen,
                Err(error) => seen.push(Err(error)),
            }
        }
    }

    const ALL: CameraFaults = CameraFaults { drop: 0.1, repeat: 0.1, torn: 0.1, dark: 0.1, late: 0.1 };

    #[test]
    fn the_same_seed_gives_the_same_faults() {
        assert_eq!(play(ALL, 7), play(ALL, 7));
        assert_ne!(play(ALL, 7), play(ALL, 8));
    }

    #[test]
    fn every_fault_comes_about_as_often_as_asked() {
        let seen = play(ALL, 1);
        let count = |what: fn(&Seen) -> bool| seen.iter().filter(|seen| what(seen)).count() as i64;
        let repeated = seen.windows(2).filter(|pair| pair[0].is_ok() && pair[0] == pair[1]).count() as i64;
        let delivered = count(|seen| seen.is_ok()) - repeated;
        let torn = count(|seen| *seen == Err(CameraErrorKind::Corrupt));
        let late = count(|seen| *seen == Err(CameraErrorKind::Stalled));
        let dark = count(|seen| matches!(seen, Ok((_, 0))));
        let dropped = 1_000 - delivered - torn;
        for found in [repeated, torn, late, dark, dropped] {
            // 100 of 1,000 with a standard deviation of 9.5: five of them either way.
            assert!((found - 100).abs() < 48, "{repeated} {torn} {late} {dark} {dropped}");
        }
    }

    #[test]
    fn without_faults_frames_pass_untouched() {
        let seen = play(CameraFaults::default(), 1);
        assert!(seen.iter().zip(1..).all(|(seen, number)| *seen == Ok((number, 4))));
        assert_eq!(seen.len(), 1_000);
    }

    #[test]
    fn a_late_frame_comes_after_its_stall() {
        let seen = play(CameraFaults { late: 1.0, ..CameraFaults::default() }, 1);
        assert_eq!(seen[..3], [Err(CameraErrorKind::Stalled), Ok((1, 4)), Err(CameraErrorKind::Stalled)]);
    }
}
