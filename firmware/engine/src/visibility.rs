//! Which circles are seen, and the events that tell when that changes.

use gangway_vision::Refusal;
use gangway_wire::{LostReason, What};

/// What is known of one circle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
enum State {
    #[default]
    Unknown,
    Seen,
    Lost {
        reason: LostReason,
        /// Frame number of the last event about it.
        told: u32,
    },
}

/// Watches one circle.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Watch {
    state: State,
}

impl Watch {
    /// Takes over what this frame showed; gives the event if that is news.
    ///
    /// A change of the reason alone is told at most once in `patience` frames: a passing post changes it in
    /// every frame.
    pub(crate) fn update(
        &mut self,
        circle: u8,
        frame: u32,
        outcome: Result<(), Refusal>,
        patience: u32,
    ) -> Option<What<'static>> {
        match (self.state, outcome) {
            (State::Seen, Ok(())) => None,
            (_, Ok(())) => {
                self.state = State::Seen;
                Some(What::MarkerFound { circle })
            }
            (State::Lost { reason, told }, Err(refusal)) => {
                let now = lost_reason(refusal);
                if now == reason || frame.wrapping_sub(told) < patience {
                    return None;
                }
                self.state = State::Lost { reason: now, told: frame };
                Some(What::MarkerStillLost { circle, reason: now })
            }
            (_, Err(refusal)) => {
                let reason = lost_reason(refusal);
                self.state = State::Lost { reason, told: frame };
                Some(What::MarkerLost { circle, reason })
            }
        }
    }
}

/// The wire's word for a refusal.
pub(crate) fn lost_reason(refusal: Refusal) -> LostReason {
    match refusal {
        Refusal::OutsidePicture => LostReason::OutsidePicture,
        Refusal::LowContrast => LostReason::LowContrast,
        Refusal::NotFound => LostReason::NotFound,
        Refusal::CutByPicture => LostReason::CutByPicture,
        Refusal::CutByWindow => LostReason::CutByWindow,
        Refusal::Saturated => LostReason::Saturated,
        Refusal::Outline => LostReason::Outline,
        Refusal::Neighbour => LostReason::Neighbour,
        Refusal::Residual => LostReason::Residual,
        Refusal::Unlit => LostReason::Unlit,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_circle_is_told_lost_and_found_once_each() {
        let mut watch = Watch::default();
        let outcomes = [Ok(()), Ok(()), Err(Refusal::Outline), Err(Refusal::Outline), Ok(())];
        let told = outcomes.iter().enumerate().filter_map(|(i, o)| watch.update(3, i as u32, *o, 50));
        let told: heapless::Vec<_, 8> = told.collect();
        assert_eq!(
            told.as_slice(),
            [
                What::MarkerFound { circle: 3 },
                What::MarkerLost { circle: 3, reason: LostReason::Outline },
                What::MarkerFound { circle: 3 },
            ]
        );
    }

    #[test]
    fn a_flickering_reason_is_told_once_in_its_patience() {
        let mut watch = Watch::default();
        let told = (0..100u32)
            .filter_map(|i| {
                let refusal = if i % 2 == 0 { Refusal::Outline } else { Refusal::NotFound };
                watch.update(0, i, Err(refusal), 49)
            })
            .count();
        assert_eq!(told, 3, "lost at 0, then changes at 49 and 98");
    }
}
