//! What the host hears beside the motion itself: answers to its commands, who this box is, what happened to
//! circles and light, and how the loop is doing.

use gangway_device::{CameraErrorKind, Clock, Vitals};
use gangway_vision::Refusal;
use gangway_wire::{self as wire, Pong, PoseFlags, Record, What};

use super::{Engine, Step, rings};
use crate::carbody::Carbody;
use crate::own::Own;
use crate::{Command, InboxConsumer, OutboxProducer, report};

impl Engine {
    /// Does what host and link have asked for since the last frame.
    pub(super) fn obey(
        &mut self,
        inbox: &mut InboxConsumer<'_>,
        clock: &impl Clock,
        outbox: &mut OutboxProducer<'_>,
    ) {
        let starts = !core::mem::replace(&mut self.started, true);
        if starts {
            // `Hello` has sequence 0: on a line without connections nothing else says where a session begins.
            self.announcer.restart();
            self.greet(clock, outbox);
            self.recorder.event(outbox, What::Started);
        }
        while let Some(command) = inbox.dequeue() {
            match command {
                Command::SetRest => {
                    self.seeking_rest = true;
                    self.rest_finder.clear();
                    self.own.iter_mut().for_each(Own::forget_anchor);
                    self.recorder.event(outbox, What::RestRequested);
                }
                Command::Mark(text) => self.recorder.event(outbox, What::Mark { text: &text }),
                Command::Ping { number, host_time_ns } => {
                    let pong = Pong { number, host_time_ns, time_ns: clock.now_ns() };
                    self.recorder.put(outbox, &Record::Pong(pong));
                }
                // Who came before the start hears the start's own greeting.
                Command::Announce if starts => {}
                Command::Announce => self.announcer.restart(),
                Command::Thinned { count } => self.recorder.event(outbox, What::QueueOverflow { count }),
                Command::Delivered(times) => self.pulse.delivered(&times),
                Command::Refused { kind } => self.recorder.event(outbox, What::CommandRefused { kind }),
            }
        }
        // Before the wait for the next frame: a new listener can read it from the first on.
        self.greet(clock, outbox);
    }

    /// `Hello`, the time and the rest pose, if that is due.
    pub(super) fn greet(&mut self, clock: &impl Clock, outbox: &mut OutboxProducer<'_>) {
        let rest = self.rest.as_ref();
        self.announcer.greet(&self.settings, &self.identity, rest, clock, &mut self.recorder, outbox);
    }

    /// The camera gave no frame: says why, and goes on sending the setup to who listens.
    pub(super) fn without_frame(
        &mut self,
        kind: CameraErrorKind,
        clock: &impl Clock,
        outbox: &mut OutboxProducer<'_>,
    ) -> Step {
        let what = match kind {
            CameraErrorKind::Ended | CameraErrorKind::Waiting => None,
            CameraErrorKind::Stalled => Some(What::CameraStalled),
            CameraErrorKind::Lost => Some(What::CameraLost),
            CameraErrorKind::Reopened => Some(What::CameraReopened),
            CameraErrorKind::Corrupt => Some(What::FrameCorrupt),
        };
        if let Some(what) = what {
            // No frame has a time to give; the end of a recording belongs to its last frame.
            self.recorder.at(self.last_frame.unwrap_or(0), clock.now_ns());
            self.recorder.event(outbox, what);
        }
        self.announcer.step(&self.settings, &mut self.recorder, outbox);
        Step::NoFrame(kind)
    }

    /// Pose and centres of the frame, and what changed with it.
    pub(super) fn record(&mut self, pose: &wire::Pose, used: u64, outbox: &mut OutboxProducer<'_>) {
        self.recorder.put(outbox, &Record::Pose(*pose));
        let circles = self.settings.circles.len();
        report::centres(rings(&self.outcomes, circles), used, &mut self.centres);
        self.recorder.put(outbox, &Record::Markers(self.centres.markers(pose.frame)));

        let solved =
            !pose.flags.contains(PoseFlags::FEW_MARKERS) && !pose.flags.contains(PoseFlags::NO_SOLUTION);
        let patience = libm::ceil(self.settings.rate_hz) as u32;
        let is_excused = self.carbodies().any(Carbody::is_excused);
        let states = self.outcomes.iter().zip(&mut self.watches).take(circles).enumerate();
        for (circle, (outcome, watch)) in states {
            if *outcome == Err(Refusal::Unlit) && is_excused {
                continue;
            }
            let refused = solved && used >> circle & 1 == 0;
            let state = match outcome {
                Ok(_) if refused => Err(Refusal::Residual),
                Ok(_) => Ok(()),
                Err(refusal) => Err(*refusal),
            };
            if let Some(what) = watch.update(circle as u8, pose.frame, state, patience) {
                self.recorder.event(outbox, what);
            }
        }
        let whites = rings(&self.outcomes, circles).map(|(_, ring)| ring.white);
        if let Some(what) = self.light.update(whites) {
            self.recorder.event(outbox, what);
        }
    }

    pub(super) fn announce(
        &mut self,
        frame_time_ns: u64,
        clock: &impl Clock,
        outbox: &mut OutboxProducer<'_>,
    ) {
        self.announcer.tick(frame_time_ns);
        self.greet(clock, outbox);
        self.announcer.step(&self.settings, &mut self.recorder, outbox);
    }

    pub(super) fn report_health(
        &mut self,
        clock: &impl Clock,
        vitals: &mut impl Vitals,
        outbox: &mut OutboxProducer<'_>,
    ) {
        let (lost, high_water) = (self.recorder.lost(), self.recorder.high_water());
        let health = self.pulse.take(clock.now_ns(), vitals.read(), lost, high_water);
        self.recorder.put(outbox, &Record::Health(health));
    }
}
