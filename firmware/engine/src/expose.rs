//! The camera's exposure, by the level of the targets themselves: their white, or their lit discs, is kept
//! where noise is small and nothing is clipped. Slowly: a change shows some frames later, and until then
//! nothing is changed again.

use gangway_device::{Exposure, Frame};
use gangway_vision::{Refusal, Ring};
use heapless::Vec;

/// Bounds of an exposure that the loop drives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AutoExposure {
    /// Longest exposure of a row, s; the first one too.
    pub longest_s: f64,
    /// Most amplification, a factor.
    pub most_gain: f64,
}

/// Level at which the targets' white is kept, share of full scale: half as bright again is not clipped yet.
const WANTED: f32 = 0.65;
/// A level beyond this factor of it is changed at once. One within that waits for the mean of so many frames,
/// and is left alone where that is within the second factor: a flicker is no reason.
const AT_ONCE: f32 = 1.5;
const FRAMES: u32 = 25;
const BAND: f32 = 1.2;
/// Largest factor of one change, and where lit discs must not seem switched by it.
const STEP: f32 = 1.6;
const STEP_OF_DISCS: f32 = 1.1;
/// Frames from a change until the level is looked at again: cameras take two or three to follow.
const SETTLE: u32 = 4;
/// What is as bright as this is clipped: nobody knows by how much, so the exposure is cut to this share.
const CLIPPED: f32 = 0.97;
const CUT: f32 = 0.4;
/// Shortest exposure, share of the longest.
const SHORTEST: f64 = 1e-3;
/// Without a ring for so many frames, the picture's own level counts.
const BLIND_FRAMES: u32 = 25;
/// Samples of a picture in a row and in a column, and the share of them that is brighter than its level.
const SAMPLES: u16 = 24;
const BRIGHTER: usize = 10;

/// Drives the exposure.
#[derive(Debug)]
pub(crate) struct Exposer {
    now: Exposure,
    bounds: Option<AutoExposure>,
    step: f32,
    /// Frames since the last change, and since a ring was seen.
    settled: u32,
    blind: u32,
    /// Sum of levels since, and how many.
    sum: (f32, u32),
}

impl Exposer {
    /// `has_discs`: some targets are lit.
    pub(crate) fn new(bounds: Option<AutoExposure>, has_discs: bool) -> Self {
        let now = Exposure { time_s: bounds.map_or(0.0, |bounds| bounds.longest_s), gain: 1.0 };
        let step = if has_discs { STEP_OF_DISCS } else { STEP };
        Self { now, bounds, step, settled: 0, blind: 0, sum: (0.0, 0) }
    }

    /// What the camera is to be told after this frame, if anything.
    pub(crate) fn wanted(
        &mut self,
        frame: &Frame<'_>,
        outcomes: &[Result<Ring, Refusal>],
    ) -> Option<Exposure> {
        let bounds = self.bounds?;
        self.settled = self.settled.saturating_add(1);
        let level = ring_level(outcomes);
        self.blind = if level.is_some() { 0 } else { self.blind.saturating_add(1) };
        if self.settled < SETTLE {
            return None;
        }
        let level = match level {
            Some(level) => level,
            None if self.blind >= BLIND_FRAMES => picture_level(frame),
            None => return None,
        };
        self.sum = (self.sum.0 + level, self.sum.1 + 1);
        let within = |ratio: f32, factor: f32| (1.0 / factor..=factor).contains(&ratio);
        let mut ratio = WANTED / level.max(0.01);
        if within(ratio, AT_ONCE) {
            let (sum, count) = self.sum;
            if count < FRAMES {
                return None;
            }
            self.sum = (0.0, 0);
            ratio = WANTED * count as f32 / sum.max(0.01);
            if within(ratio, BAND) {
                return None;
            }
        }
        let least = if level >= CLIPPED && self.step > STEP_OF_DISCS { CUT } else { 1.0 / self.step };
        let ratio = if level >= CLIPPED { least } else { ratio.clamp(least, self.step) };
        let factor = f64::from(ratio);
        let total = self.now.time_s * self.now.gain * factor;
        let time_s = total.clamp(SHORTEST * bounds.longest_s, bounds.longest_s);
        let gain = (total / time_s).clamp(1.0, bounds.most_gain);
        let wanted = Exposure { time_s, gain };
        (wanted != self.now).then_some(wanted)
    }

    /// Takes note of what the camera took of it; gives it if that is another exposure than before.
    pub(crate) fn took(&mut self, taken: Option<Exposure>) -> Option<Exposure> {
        (self.settled, self.sum) = (0, (0.0, 0));
        let Some(taken) = taken else {
            // It cannot be told: not asked again.
            self.bounds = None;
            return None;
        };
        (core::mem::replace(&mut self.now, taken) != taken).then_some(taken)
    }
}

/// Median of the rings' white; what was refused as saturated counts as clipped. `None` of none.
fn ring_level(outcomes: &[Result<Ring, Refusal>]) -> Option<f32> {
    let mut levels = Vec::<f32, { gangway_pose::MAX_CIRCLES }>::new();
    for outcome in outcomes {
        let level = match outcome {
            Ok(ring) => ring.white,
            Err(Refusal::Saturated) => CLIPPED,
            Err(_) => continue,
        };
        // As many as circles at most.
        let _ = levels.push(level);
    }
    levels.sort_unstable_by(f32::total_cmp);
    levels.get(levels.len() / 2).copied()
}

/// The level that a tenth of the picture is brighter than, by a grid of samples.
fn picture_level(frame: &Frame<'_>) -> f32 {
    let mut levels = Vec::<f32, { SAMPLES as usize * SAMPLES as usize }>::new();
    for row in 0..SAMPLES {
        for column in 0..SAMPLES {
            let at =
                |i: u16, size: u16| (u32::from(size) * u32::from(2 * i + 1) / u32::from(2 * SAMPLES)) as u16;
            let level = gangway_vision::level(frame, at(column, frame.width()), at(row, frame.height()));
            let _ = levels.push(level);
        }
    }
    levels.sort_unstable_by(f32::total_cmp);
    levels.get(levels.len() - 1 - levels.len() / BRIGHTER).copied().unwrap_or(WANTED)
}

#[cfg(test)]
mod tests {
    use super::*;
    use gangway_device::Layout;
    use gangway_pose::Centre;

    fn ring(white: f32) -> Result<Ring, Refusal> {
        let centre = Centre { at: [0.0; 2], covariance: [1.0, 0.0, 1.0] };
        Ok(Ring { centre, diameter_px: 20.0, white: white.min(1.2), black: 0.0, noise: 0.01, blur_px: 0.7 })
    }

    /// Level of each frame with a camera that follows after two frames, in this light, and the number of
    /// changes.
    fn play(light: impl Fn(u32) -> f32, frames: u32) -> (std::vec::Vec<f32>, u32) {
        let bounds = AutoExposure { longest_s: 8e-3, most_gain: 8.0 };
        let mut exposer = Exposer::new(Some(bounds), false);
        let mut told = [Exposure { time_s: 8e-3, gain: 1.0 }; 3];
        let (mut levels, mut changes) = (std::vec::Vec::new(), 0);
        let dark = [0u8; 64];
        for i in 0..frames {
            let level = light(i) * (told[0].time_s / 8e-3 * told[0].gain) as f32;
            levels.push(level);
            let frame = Frame::new(&dark, (8, 8), 8, Layout::GREY, i, 0).unwrap();
            told = [told[1], told[2], told[2]];
            if let Some(wanted) = exposer.wanted(&frame, &[ring(level), ring(level), Err(Refusal::NotFound)])
            {
                // To whole steps of 0.1 ms, as many cameras.
                let time_s = (wanted.time_s * 1e4).round().max(1.0) / 1e4;
                let taken = Exposure { time_s, ..wanted };
                changes += u32::from(exposer.took(Some(taken)).is_some());
                told[2] = taken;
            }
        }
        (levels, changes)
    }

    #[test]
    fn a_fall_of_light_to_a_tenth_is_followed_within_half_a_second_and_without_hunting() {
        // Within 100 ms, five frames.
        let light = |i: u32| 0.65 * (1.0 - 0.18 * (i.saturating_sub(20).min(5) as f32));
        let (levels, changes) = play(light, 200);
        // At once to what is not clipped and not dark, then to what was wanted.
        assert!(levels[45..].iter().all(|level| (0.4..0.98).contains(level)), "{levels:?}");
        assert!(levels[100..].iter().all(|level| (0.5..0.8).contains(level)), "{levels:?}");
        assert!(changes <= 6, "{changes} changes");
        let back = |i: u32| if i < 40 { 0.065 } else { 0.65 };
        let (levels, changes) = play(back, 200);
        assert!(levels[65..].iter().all(|level| (0.4..0.98).contains(level)), "{levels:?}");
        assert!(levels[150..].iter().all(|level| (0.5..0.8).contains(level)), "{levels:?}");
        assert!(changes <= 12, "{changes} changes");
    }

    #[test]
    fn a_steady_light_a_flicker_and_noise_change_nothing_once_the_level_is_right() {
        for depth in [0.0, 0.2] {
            let light = |i: u32| 3.0 * (1.0 + depth * libm::sinf(0.7 * i as f32));
            let (levels, changes) = play(light, 600);
            let (_, before) = play(light, 150);
            assert_eq!(changes, before, "{changes} changes in all: {levels:?}");
        }
    }

    #[test]
    fn gain_helps_only_where_the_longest_exposure_is_not_enough() {
        let mut exposer = Exposer::new(Some(AutoExposure { longest_s: 1e-2, most_gain: 2.0 }), false);
        exposer.settled = SETTLE;
        let dark = [0u8; 64];
        let frame = Frame::new(&dark, (8, 8), 8, Layout::GREY, 0, 0).unwrap();
        let wanted = exposer.wanted(&frame, &[ring(0.3)]).unwrap();
        assert_eq!((wanted.time_s, wanted.gain), (1e-2, f64::from(STEP)));
        exposer.took(Some(Exposure { time_s: 1e-2, gain: 2.0 }));
        exposer.settled = SETTLE;
        assert_eq!(exposer.wanted(&frame, &[ring(0.3)]), None, "there is no more");
    }

    #[test]
    fn a_camera_that_cannot_be_told_is_not_asked_again() {
        let mut exposer = Exposer::new(Some(AutoExposure { longest_s: 1e-2, most_gain: 2.0 }), false);
        exposer.settled = SETTLE;
        let dark = [0u8; 64];
        let frame = Frame::new(&dark, (8, 8), 8, Layout::GREY, 0, 0).unwrap();
        assert!(exposer.wanted(&frame, &[ring(0.1)]).is_some());
        assert_eq!(exposer.took(None), None);
        exposer.settled = SETTLE;
        assert_eq!(exposer.wanted(&frame, &[ring(0.1)]), None);
    }
}
