//! From the pose to the motion against rest, and the flags that say how far it can be trusted.

use gangway_device::Frame;
use gangway_pose::{PoseError, Solution};
use gangway_wire::{self as wire, PoseFlags};

use super::{Engine, rings};
use crate::carbody::Carbody;
use crate::lit::Lit;
use crate::own::Own;
use crate::{keep, report};

impl Engine {
    /// How many circles should show in the picture, of those that could go into the pose.
    fn in_picture(&self) -> u32 {
        let own = self.own.as_ref().filter(|own| own.is_seen());
        let own = own.map_or(0, |own| own.carbody().in_picture(&self.settings));
        self.carbody.in_picture(&self.settings) + own
    }

    fn is_ambiguous(&self) -> bool {
        let own = self.own.as_ref().is_some_and(|own| own.is_seen() && own.carbody().is_ambiguous());
        own || self.carbody.is_ambiguous() || self.rest.as_ref().is_some_and(|found| found.ambiguous)
    }

    /// CB_02 and, where it has reference targets, CB_01.
    pub(super) fn carbodies(&self) -> impl Iterator<Item = &Carbody> {
        core::iter::once(&self.carbody).chain(self.own.iter().map(Own::carbody))
    }

    /// Whether the lamps shone in this frame, as the first carbody with lit targets shows it.
    fn lit(&self) -> Lit {
        self.carbodies().map(Carbody::lit).find(|lit| *lit != Lit::Unknown).unwrap_or_default()
    }

    fn seen(&self) -> usize {
        rings(&self.outcomes, self.settings.circles.len()).count()
    }

    /// The motion against rest, with the flags that say how far it can be trusted.
    pub(super) fn relate(
        &self,
        frame: &Frame<'_>,
        solution: Result<&Solution, &PoseError>,
        flags: PoseFlags,
    ) -> wire::Pose {
        let rest = self.rest.as_ref().map(|found| &found.pose);
        let (motion, trust) = report::motion(rest, solution, &self.settings);
        let mut flags = flags | trust;
        if solution.is_ok() && self.is_ambiguous() {
            flags |= PoseFlags::AMBIGUOUS;
        }
        if self.suspicion.has_moved(frame.time_ns()) {
            flags |= PoseFlags::CAMERA_MOVED;
        }
        if self.own.as_ref().is_some_and(|own| !own.is_seen()) {
            flags |= PoseFlags::UNREFERENCED;
        }
        let used = solution.map_or(0, |solution| solution.used);
        if solution.is_ok() && used.count_ones() as usize != self.seen() {
            flags |= PoseFlags::OUTLIERS;
        }
        if solution.is_ok() && !keep::is_trusted(used.count_ones(), self.in_picture()) {
            flags |= PoseFlags::SPARSE;
        }
        flags |= match self.lit() {
            Lit::Not => PoseFlags::DARK,
            Lit::InPart => PoseFlags::SWITCHED,
            Lit::Unknown | Lit::Wholly => PoseFlags::default(),
        };
        let markers = used.count_ones() as u8;
        wire::Pose { frame: frame.number(), time_ns: frame.time_ns(), flags, markers, motion }
    }
}
