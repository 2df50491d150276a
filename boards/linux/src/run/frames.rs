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
                    self.status.set(State::Fault);
                    continue;
                }
                Step::NoFrame(_) => continue,
            }
            summary.frames += 1;
            summary.poses += u64::from(step == Step::Measured);
            costs.note(summary.frames, asked, &self.notices);
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
    faults: Option<Faults>,
    page_faults: i64,
    allocations: Option<u64>,
}

impl Costs {
    /// Notes the allocations of a frame, where they are counted, and looks for page faults now and then. What
    /// the first frames touch for the first time is no trouble; the first trouble is told in the records.
    fn note(&mut self, frames: u64, asked: Option<u64>, notices: &Notices) {
        if frames < LOOK {
            return;
        }
        let Some(faults) = &self.faults else {
            self.faults = Some(Faults::start());
            self.allocations = asked.map(|_| 0);
            return;
        };
        if let (Some(all), Some(asked)) = (&mut self.allocations, asked) {
            if *all == 0 && asked > 0 {
                notices.mark("the frame loop allocates");
            }
            *all += asked;
        }
        if frames.is_multiple_of(LOOK) {
            let count = faults.count();
            if count > 0 && self.page_faults == 0 {
                notices.mark("page faults in the frame loop: memory is short or not locked");
            }
            self.page_faults = count;
        }
    }
}
