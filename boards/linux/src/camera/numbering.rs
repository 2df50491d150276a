//! Frame numbers that run on over a camera that was opened again, with the frames between counted as missing.

/// Gives each picture its number.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Numbering {
    period_ns: u64,
    last: Option<Last>,
    is_new: bool,
}

#[derive(Clone, Copy, Debug)]
struct Last {
    number: u32,
    sequence: u32,
    time_ns: u64,
}

impl Numbering {
    pub(crate) fn new(period_ns: u64) -> Self {
        Self { period_ns: period_ns.max(1), last: None, is_new: false }
    }

    /// The device was opened again: its own numbers start anew.
    pub(crate) fn reopened(&mut self) {
        self.is_new = true;
    }

    /// The number of the picture with this sequence and time.
    pub(crate) fn number(&mut self, sequence: u32, time_ns: u64) -> u32 {
        let number = match self.last {
            None => sequence,
            Some(last) if std::mem::take(&mut self.is_new) => {
                // How many frames the device would have given in between.
                let passed = time_ns.saturating_sub(last.time_ns).saturating_add(self.period_ns / 2);
                let periods = u32::try_from(passed / self.period_ns).unwrap_or(u32::MAX / 2);
                last.number.wrapping_add(periods.clamp(1, u32::MAX / 2))
            }
            Some(last) => last.number.wrapping_add(sequence.wrapping_sub(last.sequence)),
        };
        self.is_new = false;
        self.last = Some(Last { number, sequence, time_ns });
        number
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_of_the_device_are_gaps_of_the_numbers() {
        let mut numbering = Numbering::new(20);
        let numbers = [(7, 0), (8, 20), (11, 80), (11, 80)].map(|(s, t)| numbering.number(s, t));
        assert_eq!(numbers, [7, 8, 11, 11]);
    }

    #[test]
    fn after_a_loss_the_frames_of_the_time_between_are_missing() {
        let mut numbering = Numbering::new(20);
        numbering.number(0, 1_000);
        numbering.reopened();
        assert_eq!(numbering.number(0, 1_205), 10, "ten periods later");
        assert_eq!(numbering.number(1, 1_225), 11);
        numbering.reopened();
        assert_eq!(numbering.number(0, 1_226), 12, "never the same number again");
    }
}
