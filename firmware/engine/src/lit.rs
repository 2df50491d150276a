//! Whether the lamps of lit targets shone over a frame's exposure: measured from its discs, never taken from
//! what the lamps were told.

use gangway_pose::MAX_CIRCLES;
use gangway_vision::{Refusal, Ring, Search};

/// A disc at this share of its own level or more was lit over the whole exposure, at that or less over none
/// of it.
const WHOLLY: f32 = 0.85;
const NOT: f32 = 0.15;

/// Share of what a disc's level is off that is taken over with each lit frame.
const GAIN: f32 = 0.25;

/// Frames between that show the same, to `ALIKE` of the level, until that is the lamps' own level: a lens got
/// dirty.
const REPEATS: u8 = 4;
const ALIKE: f32 = 0.05;

/// Frames without light, on end, that are part of a drive and not a loss.
const PATIENCE: u32 = 2;

/// What the discs of a frame say of the lamps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Lit {
    /// Nothing: there are no discs, or what is in their windows is no matter of light.
    #[default]
    Unknown,
    /// They shone over the whole exposure.
    Wholly,
    /// They were dark.
    Not,
    /// They were switched within it.
    InPart,
}

/// Watches the discs' levels.
#[derive(Clone, Debug)]
pub(crate) struct Flash {
    /// Contrast of every disc where it is lit, share of full scale; 0 before it was seen.
    levels: [f32; MAX_CIRCLES],
    state: Lit,
    /// Frames on end that were not wholly lit.
    unlit: u32,
    /// Mean share of the last frame that was lit in part, and how often it came.
    repeated: (f32, u8),
}

impl Default for Flash {
    fn default() -> Self {
        Self { levels: [0.0; MAX_CIRCLES], state: Lit::Unknown, unlit: 0, repeated: (0.0, 0) }
    }
}

impl Flash {
    /// Says what the discs among these outcomes show, and takes those out that do not count.
    pub(crate) fn judge(&mut self, searches: &[Search], outcomes: &mut [Result<Ring, Refusal>]) -> Lit {
        let (mut wholly, mut partly, mut not, mut windows, mut sum) = (0u32, 0u32, 0u32, 0u32, 0.0);
        let discs = || searches.iter().enumerate().filter(|(_, search)| search.is_disc()).map(|(i, _)| i);
        for i in discs() {
            let Some(outcome) = outcomes.get(i) else { continue };
            windows += u32::from(*outcome != Err(Refusal::OutsidePicture));
            match outcome {
                Ok(ring) => {
                    let share = self.share(i, ring);
                    match share {
                        _ if share >= WHOLLY => wholly += 1,
                        _ if share <= NOT => not += 1,
                        _ => (partly, sum) = (partly + 1, sum + share),
                    }
                }
                Err(Refusal::LowContrast) => not += 1,
                Err(_) => {}
            }
        }
        self.state = if partly * 4 > wholly {
            Lit::InPart
        } else if wholly > 0 {
            Lit::Wholly
        } else if (not > 0 && not * 2 > windows) || self.state == Lit::Not {
            // Dark lamps stay dark until a disc shines.
            Lit::Not
        } else {
            Lit::Unknown
        };
        let repeats = self.state == Lit::InPart && self.repeats(sum / partly as f32);
        match self.state {
            Lit::Wholly => self.unlit = 0,
            Lit::Unknown => {}
            Lit::Not | Lit::InPart => self.unlit = self.unlit.saturating_add(1),
        }
        for i in discs() {
            let (Some(outcome), Some(level)) = (outcomes.get_mut(i), self.levels.get_mut(i)) else {
                continue;
            };
            let Ok(ring) = outcome else {
                if self.state == Lit::Not {
                    *outcome = Err(Refusal::Unlit);
                }
                continue;
            };
            let own = contrast(ring);
            match self.state {
                Lit::Wholly if own >= WHOLLY * *level => {
                    *level = if own > *level { own } else { *level + GAIN * (own - *level) }
                }
                Lit::InPart if repeats => *level = own,
                // Of a lit frame's discs one may be duller for once: dirt, or a pane before it.
                Lit::Wholly if own > NOT * *level => {}
                _ => *outcome = Err(Refusal::Unlit),
            }
        }
        self.state
    }

    /// A frame in whose windows nobody looked.
    pub(crate) fn pass_over(&mut self) {
        if self.state == Lit::Not {
            self.unlit = self.unlit.saturating_add(1);
        } else {
            self.state = Lit::Unknown;
        }
    }

    /// What the last frame was.
    pub(crate) fn state(&self) -> Lit {
        self.state
    }

    /// Whether discs are missing only because their lamps are being driven: no reason to look for them.
    pub(crate) fn excuses(&self) -> bool {
        matches!(self.state, Lit::Not | Lit::InPart) && self.unlit <= PATIENCE
    }

    fn share(&self, i: usize, ring: &Ring) -> f32 {
        let level = self.levels.get(i).copied().unwrap_or_default();
        if level > 0.0 { contrast(ring) / level } else { 1.0 }
    }

    /// Whether this mean share has come often enough on end.
    fn repeats(&mut self, share: f32) -> bool {
        let (before, count) = self.repeated;
        let is_alike = (share - before).abs() <= ALIKE * before;
        self.repeated = (share, if is_alike { count.saturating_add(1) } else { 1 });
        self.repeated.1 >= REPEATS
    }
}

fn contrast(ring: &Ring) -> f32 {
    ring.white - ring.black
}

#[cfg(test)]
mod tests {
    use super::*;
    use gangway_pose::Centre;

    fn judge(flash: &mut Flash, levels: &[Option<f32>]) -> Lit {
        let searches: heapless::Vec<Search, 8> =
            levels.iter().map(|_| Search::disc([0.0; 2], 20.0)).collect();
        let ring = |white: f32| Ring {
            centre: Centre { at: [0.0; 2], covariance: [1.0, 0.0, 1.0] },
            diameter_px: 20.0,
            white,
            black: 0.0,
            noise: 0.01,
            blur_px: 0.7,
        };
        let mut outcomes: heapless::Vec<Result<Ring, Refusal>, 8> =
            levels.iter().map(|level| level.map(ring).ok_or(Refusal::LowContrast)).collect();
        flash.judge(&searches, &mut outcomes)
    }

    #[test]
    fn frames_are_lit_dark_or_between_by_what_their_discs_show() {
        let mut flash = Flash::default();
        assert_eq!(judge(&mut flash, &[Some(0.6), Some(0.8), None, None]), Lit::Wholly);
        assert_eq!(judge(&mut flash, &[None, None, None, None]), Lit::Not);
        assert_eq!(judge(&mut flash, &[Some(0.3), Some(0.4), None, None]), Lit::InPart);
        assert!(flash.excuses());
        // Daylight shows a little of discs that are not lit.
        assert_eq!(judge(&mut flash, &[Some(0.06), Some(0.07), None, None]), Lit::Not);
        assert!(!flash.excuses(), "three frames without light are a loss");
        assert_eq!(judge(&mut flash, &[Some(0.59), None, None, None]), Lit::Wholly, "the others are hidden");
    }

    #[test]
    fn a_level_that_stays_lower_is_the_lamps_own_after_four_frames() {
        let mut flash = Flash::default();
        let states: heapless::Vec<Lit, 8> = [0.8, 0.4, 0.4, 0.4, 0.4, 0.4]
            .iter()
            .map(|level| judge(&mut flash, &[Some(*level); 4]))
            .collect();
        assert_eq!(states[4], Lit::InPart);
        assert_eq!(states[5], Lit::Wholly);
    }

    #[test]
    fn what_hides_the_discs_is_no_darkness() {
        let mut flash = Flash::default();
        let searches = [Search::disc([0.0; 2], 20.0); 4];
        let mut outcomes = [Err(Refusal::NotFound); 4];
        assert_eq!(flash.judge(&searches, &mut outcomes), Lit::Unknown);
    }
}
