//! The frame thread: the loop, its watchdog, and what its frames must not cost.

use gangway_device::{Camera, CameraErrorKind, Lamp, Vitals};
use gangway_engine::{Board, Engine, InboxConsumer, OutboxProducer, Step};
use gangway_setup::Board as BoardSettings;

use super::{Next, State, Status, Summary};
use crate::notice::Notices;
use crate::{Faults, Signals, SystemClock, Watchdog, allocations, realtime};

/// Signs of trouble are looked for once in so many frames.
const LOOK: u64 = 64;

/// What the frame loop works on beside the hardware and the queues.
pub(super) struct Frames<'f> {
    pub(super) engine: &'f mut Box<Engine>,
    pub(super) watchdog: Watchdog,
    pub(super) board: BoardSettings,
    pub(super) next: &'f Next,
    pub(super) signals: &'f Signals,
    pub(super) status: &'f Status,
    pub(super) notices: Notices,
}

impl Frames<'_> {
    /// The frame loop. The watchdog is fed by its turns, also by those that only wait for a camera.
    pub(super) fn work<C: Camera<Error = CameraErrorKind>, L: Lamp>(
        mut self,
        hardware: &mut Board<'_, C, SystemClock, impl Vitals, L>,
        inbox: &mut InboxConsumer<'_>,
        outbox: &mut OutboxProducer<'_>,
    ) -> Summary {
        let core = (self.board.core >= 0.0).then_some(self.board.core as usize);
        for refusal in realtime::enter(self.board.realtime_priority, core) {
            self.notices.mark(refusal.split(';').next().unwrap_or_default());
            self.notices.log(refusal);
        }
        self.watchdog.ready();
        let mut summary = Summary::default();
        let mut costs = Costs::default();
        while !self.signals.stops() {
            if let Some(mut next) = self.next.take() {
                next.succeed(self.engine, outbox);
                *self.engine = next;
                self.notices.log("the new setup is taken over".to_owned());
            }
            let before = allocations();
            let step = self.engine.step(hardware, inbox, outbox);
            let asked = allocations().zip(before).map(|(after, before)| after - before);
            self.watchdog.feed();
            match step {
                Step::Measured => self.status.set(State::Measuring),
                Step::Unmeasured => self.status.set(State::Waiting),
                Step::Repeated => {}
                Step::NoFrame(CameraErrorKind::Ended) => break,
                Step::NoFrame(CameraErrorKind::Lost | CameraErrorKind::Stalled) => {
                    summary.losses += 1;
                    costs.begin_again();
                    self.status.set(State::Fault);
                    continue;
                }
                Step::NoFrame(_) => continue,
            }
            summary.frames += 1;
            summary.poses += u64::from(step == Step::Measured);
            costs.note(asked, &self.notices);
        }
        self.watchdog.stopping();
        self.engine.end(hardware, outbox);
        summary.lost = u64::from(self.engine.records_lost());
        (summary.page_faults, summary.allocations) = (costs.page_faults, costs.allocations);
        summary
    }
}

/// What frames must not cost: page faults and allocations.
#[derive(Default)]
struct Costs {
    /// Frames since the camera was opened.
    frames: u64,
    faults: Option<Faults>,
    page_faults: i64,
    allocations: Option<u64>,
}

impl Costs {
    /// The camera is lost: opening it again costs, and so do the first frames after that.
    fn begin_again(&mut self) {
        (self.frames, self.faults) = (0, None);
    }

    /// Notes the allocations of a frame, where they are counted, and looks for page faults now and then. What
    /// the first frames touch for the first time is no trouble; the first trouble is told in the records.
    fn note(&mut self, asked: Option<u64>, notices: &Notices) {
        self.frames += 1;
        if self.frames < LOOK {
            return;
        }
        let Some(faults) = &mut self.faults else {
            self.faults = Some(Faults::start());
            self.allocations = self.allocations.or(asked.map(|_| 0));
            return;
        };
        if let (Some(all), Some(asked)) = (&mut self.allocations, asked) {
            if *all == 0 && asked > 0 {
                notices.mark("the frame loop allocates");
            }
            *all += asked;
        }
        if self.frames.is_multiple_of(LOOK) {
            let count = std::mem::replace(faults, Faults::start()).count();
            if count > 0 && self.page_faults == 0 {
                notices.mark("page faults in the frame loop: memory is short or not locked");
            }
            self.page_faults += count;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn page_faults_count_but_for_those_of_a_camera_that_is_opened_again() {
        let (notices, _taken) = Notices::channel();
        let mut costs = Costs::default();
        // Kept, for memory that is freed would be given again, and cost no fault.
        let mut kept = Vec::new();
        let mut touch = || kept.push(vec![1u8; 1 << 22]);
        let look = |costs: &mut Costs| (0..LOOK).for_each(|_| costs.note(None, &notices));
        touch();
        look(&mut costs);
        look(&mut costs);
        assert_eq!(costs.page_faults, 0, "before the first frames");
        touch();
        costs.begin_again();
        touch();
        look(&mut costs);
        look(&mut costs);
        assert_eq!(costs.page_faults, 0, "while the camera was away");
        touch();
        look(&mut costs);
        assert!(costs.page_faults > 0);
    }
}
