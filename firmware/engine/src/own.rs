//! The camera's own carbody, where the setup has reference targets on it: the motion is that of the one
//! carbody against the other, whatever the camera does.

use gangway_device::Frame;
use gangway_pose::{Lens, Pose, PoseError, Shutter, Solution, Track, angles, at_mid_exposure, relative_pose};
use gangway_vision::Tracker;
use gangway_wire::What;
use nalgebra::{Vector3, Vector6};

use crate::Settings;
use crate::carbody::{Carbody, Means};
use crate::keep;
use crate::mount::Mount;

/// Moves of the camera that its reference targets cannot tell from noise are none: chi squared of six
/// numbers, exceeded by chance once in a thousand.
const NOISE: f64 = 22.5;

/// CB_01 and the camera on it.
pub(crate) struct Own {
    carbody: Carbody,
    mount: Mount,
    /// The last poses of CB_02 in CB_01.
    track: Track,
    /// CB_01 as this frame shows it.
    seen: Option<Solution>,
    /// CB_01 when rest was first looked for; centres at rest are told as the camera would have seen them
    /// then.
    anchor: Option<Pose>,
}

impl Own {
    /// # Errors
    /// As [`crate::Engine::new`].
    pub(crate) fn new(settings: &Settings) -> Result<Self, PoseError> {
        Ok(Self {
            carbody: Carbody::new(settings, settings.own, true)?,
            mount: Mount::new(settings.rate_hz),
            track: Track::default(),
            seen: None,
            anchor: None,
        })
    }

    pub(crate) fn carbody(&self) -> &Carbody {
        &self.carbody
    }

    /// Work of the search since this was asked last.
    pub(crate) fn take_spent(&mut self) -> u32 {
        self.carbody.take_spent()
    }

    /// Looks for CB_01. It is searched for only while CB_02, before which it stands, is known; the two are
    /// about aligned. Gives what the mount has to tell, and takes the windows of `other` along with the
    /// camera.
    pub(crate) fn measure(
        &mut self,
        frame: &Frame<'_>,
        tracker: &mut Tracker,
        settings: &Settings,
        other: &mut Carbody,
        first: bool,
    ) -> [Option<What<'static>>; 2] {
        let before = self.carbody.last();
        let facing = other.last();
        let may_turn = settings.limits.max_deg.map(|deg| keep::BEYOND_LIMITS * deg);
        let is_plausible = |pose: &Pose| {
            let turned = |facing: &Pose| angles(&(pose.rotation.transpose() * facing.rotation));
            facing.is_some_and(|facing| {
                turned(&facing).iter().zip(may_turn).all(|(turn, most)| libm::fabs(turn.to_degrees()) <= most)
            })
        };
        let means = Means {
            settings,
            shutter: Shutter { exposure_s: 0.0, ..settings.shutter },
            others: other.searches(),
            may_search: other.is_calm(),
            keeps_dark: false,
            is_plausible: &is_plausible,
        };
        self.seen = self.carbody.measure(frame, tracker, &means, first).ok();
        let Some(seen) = &self.seen else { return [None, None] };
        if let Some(before) = before {
            other.rebase(&seen.pose.after(&before.inverse()));
        }
        self.mount.update(seen)
    }

    /// Whether this frame shows it.
    pub(crate) fn is_seen(&self) -> bool {
        self.seen.is_some()
    }

    /// CB_02 in CB_01, from CB_02 in the camera; without a place of CB_01 there is none. `is_new` where that
    /// of CB_02 does not follow from those before.
    pub(crate) fn relate(
        &mut self,
        time_ns: u64,
        solution: &Solution,
        is_new: bool,
        settings: &Settings,
    ) -> Result<Solution, PoseError> {
        let own = self.seen.or_else(|| self.mount.remembered());
        let needed = settings.solver.min_circles;
        let own = own.ok_or(PoseError::TooFew { circles: 0, needed })?;
        let mut relative = relative_pose(&own, solution);
        if is_new || self.carbody.is_new() {
            self.track.forget();
        }
        at_mid_exposure(&mut relative, &settings.shutter, &mut self.track, time_ns);
        self.track.follow(time_ns, &relative.pose);
        Ok(relative)
    }

    /// CB_02 in the camera now, from its pose in CB_01.
    pub(crate) fn in_camera(&self, relative: &Pose) -> Option<Pose> {
        self.carbody.last().map(|own| own.after(relative))
    }

    /// As [`Carbody::restart_survey`].
    pub(crate) fn restart_survey(&mut self) {
        self.carbody.restart_survey();
    }

    /// As [`Carbody::survey`].
    pub(crate) fn survey(&mut self, frames: u16, settings: &Settings) -> Option<Solution> {
        self.carbody.survey(frames, settings)
    }

    /// Rest is looked for anew.
    pub(crate) fn forget_anchor(&mut self) {
        self.anchor = None;
    }

    /// Where a point, in CB_01, shows against where it would show had the camera not moved since rest was
    /// first looked for, px; nothing where the camera has not moved as far as can be seen.
    pub(crate) fn moved_px(&mut self, point: &Vector3<f64>, lens: &Lens) -> [f64; 2] {
        let Some(seen) = &self.seen else { return [0.0; 2] };
        let anchor = *self.anchor.get_or_insert(seen.pose);
        let off = Vector6::from(seen.pose.difference(&anchor));
        let moved = seen.covariance.cholesky().is_some_and(|c| off.dot(&c.solve(&off)) > 2.0 * NOISE);
        let at = |pose: &Pose| lens.project(&pose.transform(point)).ok();
        match (at(&seen.pose), at(&anchor)) {
            (Some(now), Some(then)) if moved => [now[0] - then[0], now[1] - then[1]],
            _ => [0.0; 2],
        }
    }
}
