//! What a decoder met, and which running numbers it never saw.

/// Numbers that are remembered behind the newest, to tell a late record from one that came twice.
const WINDOW: u32 = 64;

/// What a decoder met since it was made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Records given out, those with newer fields among them.
    pub records: u64,
    /// Of these, the ones with bytes behind the fields that this version knows.
    pub extended: u64,
    /// Sound frames that were skipped: a kind or a kind of event that this version does not know.
    pub newer: u64,
    /// Frames that gave nothing because they were damaged, see [`crate::Damage`].
    pub damaged: u64,
    /// Of these, sound frames whose body made no sense: the sender is at fault, not the line.
    pub malformed: u64,
    /// Running numbers that never came, between the first and the last that did.
    pub missing: u64,
    /// Places where numbers were missing when the next one came.
    pub gaps: u64,
    /// Frames that came again, with a number that had been seen.
    pub repeated: u64,
    /// Frames that came behind one with a higher number; they are not missing any more.
    pub late: u64,
    /// Times that the numbers began anew: another session.
    pub restarts: u64,
}

/// Follows the running numbers.
#[derive(Clone, Debug, Default)]
pub(crate) struct Sequence {
    newest: Option<u32>,
    /// Bit i: number newest - i was seen, or is before the first one.
    seen: u64,
    session: Option<u64>,
}

impl Sequence {
    /// A sound frame came with this number; `session` is the one that it names, if it is a `Hello`: with
    /// another session the numbers begin anew.
    pub(crate) fn note(&mut self, sequence: u32, session: Option<u64>, counts: &mut Counts) {
        let is_other = matches!((self.session, session), (Some(known), Some(named)) if known != named);
        self.session = session.or(self.session);
        if is_other {
            counts.restarts += 1;
            self.begin(sequence);
            return;
        }
        let Some(newest) = self.newest else {
            self.begin(sequence);
            return;
        };
        let ahead = sequence.wrapping_sub(newest);
        if ahead == 0 {
            counts.repeated += 1;
        } else if ahead <= u32::MAX / 2 {
            counts.missing += u64::from(ahead - 1);
            counts.gaps += u64::from(ahead > 1);
            self.seen = self.seen.checked_shl(ahead).unwrap_or(0) | 1;
            self.newest = Some(sequence);
        } else {
            self.note_behind(ahead.wrapping_neg(), sequence, counts);
        }
    }

    fn note_behind(&mut self, behind: u32, sequence: u32, counts: &mut Counts) {
        if behind >= WINDOW {
            counts.restarts += 1;
            self.begin(sequence);
        } else if self.seen >> behind & 1 == 1 {
            counts.repeated += 1;
        } else {
            self.seen |= 1 << behind;
            counts.late += 1;
            counts.missing = counts.missing.saturating_sub(1);
        }
    }

    fn begin(&mut self, sequence: u32) {
        self.newest = Some(sequence);
        self.seen = u64::MAX;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn follow(numbers: &[u32]) -> Counts {
        let mut sequence = Sequence::default();
        let mut counts = Counts::default();
        for &number in numbers {
            sequence.note(number, None, &mut counts);
        }
        counts
    }

    #[test]
    fn numbers_in_order_miss_nothing_wherever_they_start() {
        assert_eq!(follow(&[0, 1, 2, 3]), Counts::default());
        assert_eq!(follow(&[700, 701]), Counts::default());
    }

    #[test]
    fn missing_numbers_are_counted_across_the_wrap() {
        assert_eq!(
            follow(&[u32::MAX - 2, u32::MAX, 2]),
            Counts { missing: 1 + 2, gaps: 2, ..Counts::default() }
        );
        assert_eq!(follow(&[u32::MAX, 0]), Counts::default());
    }

    #[test]
    fn a_late_record_is_not_missing_and_one_that_comes_twice_is_repeated() {
        assert_eq!(follow(&[0, 1, 3, 2, 4]), Counts { gaps: 1, late: 1, ..Counts::default() });
        assert_eq!(follow(&[0, 1, 1, 0, 2]), Counts { repeated: 2, ..Counts::default() });
        assert_eq!(
            follow(&[0, 1, 5, 3, 3, 6]),
            Counts { missing: 2, gaps: 1, late: 1, repeated: 1, ..Counts::default() }
        );
        assert_eq!(
            follow(&[0, 64, 1, 0]),
            Counts { missing: 62, gaps: 1, late: 1, restarts: 1, ..Counts::default() }
        );
    }

    #[test]
    fn a_new_session_misses_nothing() {
        assert_eq!(follow(&[5000, 5001, 0, 1]), Counts { restarts: 1, ..Counts::default() });
        let mut sequence = Sequence::default();
        let mut counts = Counts::default();
        let numbers = [(Some(7), 0), (None, 1), (Some(8), 0), (None, 1), (Some(8), 2), (Some(9), 100)];
        for (session, number) in numbers {
            sequence.note(number, session, &mut counts);
        }
        assert_eq!(counts, Counts { restarts: 2, ..Counts::default() });
    }
}
