//! Which ring is which circle, from the rings' places alone: the targets' own patterns are looked for among
//! the rings (`group`), every way to take a pattern for a target of the setup gives a pose (`hypothesis`),
//! and the pose that explains the rings stands if no other one explains them nearly as well. In slices: so
//! much work a frame.

mod group;
mod hypothesis;
mod layout;

use heapless::Vec;

use crate::assign::group::{Group, MAX_GROUPS, Searcher};
use crate::assign::hypothesis::Rivals;
use crate::assign::layout::Layout;
use crate::{Circle, Lens, Pose, Sighting};

/// Most rings that are taken into account.
pub(crate) const MAX_RINGS: usize = 96;

/// The pose that the rings show, and how many of the circles it rests on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Assigned {
    /// The pose.
    pub pose: Pose,
    /// Circles that have their ring.
    pub found: u32,
    /// Circles that should be in the picture.
    pub expected: u32,
}

/// Why there is no assignment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unassigned {
    /// No target's pattern is among the rings, or it fits nowhere.
    NoPattern,
    /// There is a pose, but too little of what it should show is there.
    TooFew,
    /// Two poses explain the rings about equally well.
    Ambiguous,
}

/// How far the assignment has come.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Progress {
    /// The work of this slice is done, not all of it.
    Going,
    /// An assignment.
    Assigned(Assigned),
    /// None.
    Refused(Unassigned),
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Stage {
    /// Looking for groups, from this ring and this one of its neighbours on.
    Groups(usize, usize),
    /// Finding the pose of this group.
    Poses(usize),
    /// Verifying this hypothesis.
    Verify(usize),
}

/// The assignment with its working memory.
pub struct Assigner {
    layout: Layout,
    searcher: Searcher,
    rings: Vec<Sighting, MAX_RINGS>,
    groups: Vec<Group, MAX_GROUPS>,
    rivals: Rivals,
    stage: Stage,
}

/// What the rings are seen through and how well they must fit.
pub struct View<'a> {
    /// The circles of the setup; always those of the `Assigner`.
    pub circles: &'a [Circle],
    /// The camera.
    pub lens: &'a Lens,
    /// Width and height of the picture, px.
    pub picture: (u16, u16),
    /// Which of two poses that explain the rings equally well is the one, where something is known: whether a
    /// pose is plausible.
    pub is_plausible: &'a dyn Fn(&Pose) -> bool,
}

impl Assigner {
    /// For the circles of a setup.
    pub fn new(circles: &[Circle]) -> Self {
        Self {
            layout: Layout::of(circles),
            searcher: Searcher::default(),
            rings: Vec::new(),
            groups: Vec::new(),
            rivals: Rivals::default(),
            stage: Stage::Groups(0, 0),
        }
    }

    /// Whether any target has enough circles to be known by them.
    pub fn is_able(&self) -> bool {
        self.layout.has_patterns()
    }

    /// Takes new rings and begins anew.
    pub fn begin(&mut self, rings: &[Sighting]) {
        self.rings.clear();
        let usable = |ring: &&Sighting| {
            ring.at.iter().chain(&ring.shape).all(|c| c.is_finite()) && ring.diameter_px() > 0.0
        };
        // What is too many is left out.
        self.rings.extend(rings.iter().filter(usable).take(MAX_RINGS).copied());
        self.groups.clear();
        self.rivals.clear();
        self.stage = Stage::Groups(0, 0);
    }

    /// Works on for about `work`, which it takes off. After an answer `begin` has to be called.
    pub fn advance(&mut self, view: &View<'_>, work: &mut i32) -> Progress {
        while *work > 0 {
            match self.stage {
                Stage::Groups(ring, neighbour) if ring < self.rings.len() => {
                    let begin = (ring, neighbour);
                    let goes_on =
                        self.searcher.search(&self.layout, &self.rings, begin, &mut self.groups, work);
                    self.stage =
                        if goes_on { Stage::Groups(ring, neighbour + 1) } else { Stage::Groups(ring + 1, 0) };
                }
                Stage::Groups(..) => {
                    self.stage = Stage::Poses(0);
                }
                Stage::Poses(group) if group < self.groups.len() => {
                    if !self.rivals.are_settled_without(&self.layout, &self.groups, group) {
                        hypothesis::from_group(
                            &self.layout,
                            view,
                            &self.rings,
                            &self.groups,
                            group,
                            &mut self.rivals,
                            work,
                        );
                    }
                    self.stage = Stage::Poses(group + 1);
                }
                Stage::Poses(_) => {
                    self.rivals.sort();
                    self.stage = Stage::Verify(0);
                }
                Stage::Verify(number) if self.rivals.is_repeated(number) => {
                    self.stage = Stage::Verify(number + 1);
                }
                Stage::Verify(number) => match self.rivals.worth_verifying(number) {
                    Some(hypothesis) => {
                        hypothesis.verify(&self.layout, view, &self.rings, &self.groups, work);
                        self.stage = Stage::Verify(number + 1);
                    }
                    None => {
                        return match self.rivals.decide(view) {
                            Ok(assigned) => Progress::Assigned(assigned),
                            Err(reason) => Progress::Refused(reason),
                        };
                    }
                },
            }
        }
        Progress::Going
    }
}

#[cfg(test)]
mod tests;
