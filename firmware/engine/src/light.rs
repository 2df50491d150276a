//! How bright the targets' white is, and when that has changed enough to be told.

use gangway_wire::What;

/// Change against the last told level that is told again.
const STEP: f32 = 0.25;

#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Light {
    told: Option<f32>,
}

impl Light {
    /// Takes the white levels of this frame's rings, shares of full scale; gives the event if that is news.
    ///
    /// The first level is the reference and no news.
    pub(crate) fn update(&mut self, whites: impl Iterator<Item = f32>) -> Option<What<'static>> {
        let (sum, count) = whites.fold((0.0f32, 0.0f32), |(sum, count), white| (sum + white, count + 1.0));
        if count == 0.0 {
            return None;
        }
        let level = sum / count;
        let Some(told) = self.told else {
            self.told = Some(level);
            return None;
        };
        if (level - told).abs() <= STEP * told {
            return None;
        }
        self.told = Some(level);
        Some(What::LightChanged { percent: libm::roundf((level * 100.0).clamp(0.0, 100.0)) as u8 })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fall_of_light_is_told_in_steps_of_a_quarter() {
        let mut light = Light::default();
        let mut told = heapless::Vec::<_, 16>::new();
        for level in [0.8, 0.79, 0.7, 0.55, 0.5, 0.4, 0.4, 0.8] {
            told.extend(light.update([level, level].into_iter()));
        }
        let percents = [55, 40, 80].map(|percent| What::LightChanged { percent });
        assert_eq!(told.as_slice(), percents);
    }

    #[test]
    fn a_frame_without_rings_says_nothing_of_the_light() {
        let mut light = Light::default();
        assert_eq!(light.update([0.8].into_iter()), None);
        assert_eq!(light.update([].into_iter()), None);
    }
}
