//! Rest: looked for at start and on command, and noticed again later, when the train should stand where it
//! stood then.

use gangway_device::Frame;
use gangway_pose::{MAX_CIRCLES, Solution, relative_pose};
use gangway_wire::What;
use nalgebra::{Matrix6, Vector3};

use super::{Engine, rings};
use crate::own::Own;
use crate::{OutboxProducer, Settings, report};

impl Engine {
    /// While rest is sought: shows this frame to the finder, and takes over what it finds. Later the same
    /// tells when the train stands again.
    pub(super) fn find_rest(
        &mut self,
        frame: &Frame<'_>,
        solution: Option<&Solution>,
        outbox: &mut OutboxProducer<'_>,
    ) {
        let Some(solution) = solution else { return self.suspicion.interrupt() };
        if !self.seeking_rest {
            return self.suspect(frame, solution, outbox);
        }
        let mut centres = heapless::Vec::<(usize, [f64; 2]), MAX_CIRCLES>::new();
        let Settings { circles, lens, .. } = &self.settings;
        for (circle, ring) in rings(&self.outcomes, circles.len()) {
            let moved_px = match (&mut self.own, circles.get(circle)) {
                _ if solution.used >> circle & 1 == 0 => continue,
                (Some(own), Some(circle)) => own.moved_px(&solution.pose.transform(&circle.point), lens),
                _ => [0.0; 2],
            };
            // As many as circles, at most.
            let _ = centres.push((circle, [0, 1].map(|i| ring.centre.at[i] - moved_px[i])));
        }
        if self.rest_finder.observe(frame.number(), centres.iter().copied(), solution) {
            let surveyed = self.survey();
            let Some(mut found) = self.rest_finder.mean(frame.number(), surveyed) else { return };
            if surveyed.is_some() {
                // What the layout did to this pose it does to all. The circles of a target are off together.
                found.pose.common = solution.covariance * self.carbody.correlation();
            }
            self.seeking_rest = false;
            found.own = self.own.as_ref().and_then(|own| own.carbody().last());
            self.recorder.event(outbox, What::RestSet { frames: found.frames });
            self.recorder.put(outbox, &report::rest(&found));
            self.rest = Some(found);
            self.suspicion.forget();
        } else if self.rest_finder.begins() {
            self.carbody.restart_survey();
            self.own.iter_mut().for_each(Own::restart_survey);
        }
    }

    /// Takes the circles to be where the rest interval showed them; gives the covariance of a frame's pose
    /// with that.
    fn survey(&mut self) -> Option<Matrix6<f64>> {
        let settings = &self.settings;
        let frames = settings.rest.frames;
        if settings.rest.layout_mm <= 0.0 {
            return None;
        }
        let solution = self.carbody.survey(frames, settings);
        let Some(own) = &mut self.own else { return Some(solution?.covariance) };
        Some(relative_pose(&own.survey(frames, settings)?, &solution?).covariance)
    }

    /// Without reference targets: whether the camera may have moved.
    fn suspect(&mut self, frame: &Frame<'_>, solution: &Solution, outbox: &mut OutboxProducer<'_>) {
        let (None, Some(rest)) = (&self.own, &self.rest) else { return };
        let Settings { circles, limits, .. } = &self.settings;
        let middle = circles.iter().map(|circle| circle.point).sum::<Vector3<f64>>() / circles.len() as f64;
        if self.carbody.is_ambiguous() {
            self.suspicion.interrupt();
        }
        let now = (frame.number(), frame.time_ns());
        let shock = self.suspicion.follow(now, solution, &middle, limits);
        let used =
            rings(&self.outcomes, circles.len()).filter(|(circle, _)| solution.used >> circle & 1 == 1);
        let centres = used.map(|(circle, ring)| (circle, ring.centre.at));
        let stands = self.rest_finder.observe(frame.number(), centres, solution);
        let elsewhere = stands.then(|| self.suspicion.stands(solution, &rest.pose, limits)).flatten();
        for what in [shock, elsewhere].into_iter().flatten() {
            self.recorder.event(outbox, what);
        }
    }
}
