//! The tracker of thesis 3.2.3 and 3.2.5 over all circles of a frame.

use core::f64::consts::PI;

use gangway_device::Frame;
use gangway_pose::MAX_CIRCLES;

use crate::bits::Bits;
use crate::candidate::{self, Candidate, Miss};
use crate::centre::{self, Workspace};
use crate::components::Components;
use crate::dark::Dark;
use crate::light::{Illumination, Light};
use crate::loader::{Plane, Rect};
use crate::window::Window;
use crate::{MAX_SIDE, Refusal, Ring, Search, Settings, length};
use crate::{consensus, threshold};

mod disc;

/// Rings thinner than this are not opened, samples: the disk of three would break what a post leaves of them.
const MIN_OPENED: f64 = 6.0;

/// A window moved by less than this share of a diameter shows the same.
const NEW_WINDOW: f64 = 0.1;

/// The tracker with its working memory, about 450 KiB; made once and kept.
pub struct Tracker {
    settings: Settings,
    plane: Plane,
    bits: Bits,
    components: Components,
    workspace: Workspace,
    dark: Dark,
    looks: u32,
}

impl Tracker {
    /// A tracker with these settings.
    pub const fn new(settings: Settings) -> Self {
        Self {
            settings,
            plane: Plane::new(),
            bits: Bits::new(),
            components: Components::new(),
            workspace: Workspace::new(),
            dark: Dark::new(),
            looks: 0,
        }
    }

    /// The settings it was made with.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Windows that were looked into since this was asked last.
    pub fn take_looks(&mut self) -> u32 {
        core::mem::take(&mut self.looks)
    }

    /// Looks for every ring of `searches`; `rings[i]` answers `searches[i]`. Only the first `MAX_CIRCLES`
    /// searches are answered, and no more than `rings` has room for.
    ///
    /// `light` is what the frames before have told of it, and takes this frame's: once each.
    ///
    /// A ring that its window cuts or does not show is looked for again, in a window moved to where the cut
    /// piece says and then by as much as the other rings of its target have moved.
    pub fn track(
        &mut self,
        frame: &Frame,
        searches: &[Search],
        light: &mut Illumination,
        rings: &mut [Result<Ring, Refusal>],
    ) {
        let mut cuts: [Option<[f64; 2]>; MAX_CIRCLES] = [None; MAX_CIRCLES];
        let count = searches.len().min(rings.len()).min(MAX_CIRCLES);
        let searches = searches.get(..count).unwrap_or_default();
        let rings = rings.get_mut(..count).unwrap_or_default();
        let mut lights = [Light::NONE; MAX_CIRCLES];
        let outcomes = searches.iter().zip(rings.iter_mut()).zip(&mut lights);
        for (((search, ring), light), cut) in outcomes.zip(&mut cuts) {
            match self.look_at(frame, search, search.at) {
                Ok(found) => (*ring, *light) = (Ok(found.0), found.1),
                Err(miss) => (*ring, *cut) = (Err(miss.refusal), miss.cut_at),
            }
        }
        consensus::refuse_neighbours(searches, rings);
        if !rings.iter().all(Result::is_ok) {
            self.track_again(frame, searches, rings, &cuts, &mut lights);
        }
        light.share(searches, rings, &lights);
    }

    /// The second looks of [`Self::track`].
    fn track_again(
        &mut self,
        frame: &Frame,
        searches: &[Search],
        rings: &mut [Result<Ring, Refusal>],
        cuts: &[Option<[f64; 2]>; MAX_CIRCLES],
        lights: &mut [Light; MAX_CIRCLES],
    ) {
        let count = searches.len();
        for i in 0..count {
            let (Some(search), Some(Some(cut))) = (searches.get(i), cuts.get(i)) else { continue };
            // A piece at the window's edge may be a neighbour's: what is found there must fit to what is
            // known.
            let known = consensus::trusted_shift(searches, rings, search.target);
            let (Some(ring), Some(light)) = (rings.get_mut(i), lights.get_mut(i)) else { continue };
            let before = *ring;
            self.look_again(frame, search, (ring, light), *cut);
            if let (Ok(found), Some(shift)) = (*ring, known)
                && consensus::is_out_of_reach(search, &found, shift)
            {
                *ring = before;
            }
        }
        consensus::refuse_neighbours(searches, rings);
        for i in 0..count {
            let (Some(search), Some(Err(_))) = (searches.get(i), rings.get(i)) else { continue };
            let shift = consensus::shift(searches, rings, cuts, search.target);
            let moved = [search.at[0] + shift[0], search.at[1] + shift[1]];
            if let (Some(ring), Some(light)) = (rings.get_mut(i), lights.get_mut(i)) {
                self.look_again(frame, search, (ring, light), moved);
            }
        }
        consensus::refuse_neighbours(searches, rings);
    }

    /// Looks for a ring that was not found in a window about `at` as well, if that shows anything new.
    fn look_again(
        &mut self,
        frame: &Frame,
        search: &Search,
        (ring, light): (&mut Result<Ring, Refusal>, &mut Light),
        at: [f64; 2],
    ) {
        let worthwhile =
            length(at[0] - search.at[0], at[1] - search.at[1]) > NEW_WINDOW * search.diameter_px();
        // Dark, glare or a whole ring of another kind stay what they are in a moved window.
        let lost = matches!(
            ring,
            Err(Refusal::CutByWindow | Refusal::NotFound | Refusal::OutsidePicture | Refusal::Neighbour)
        );
        if !(lost && worthwhile) {
            return;
        }
        match self.look_at(frame, search, at) {
            Ok(found) => (*ring, *light) = (Ok(found.0), found.1),
            // What the second window shows of a ring says more than that the first one showed nothing.
            Err(miss) if miss.refusal != Refusal::NotFound => *ring = Err(miss.refusal),
            Err(_) => {}
        }
    }

    /// Looks for one ring in its window, once.
    ///
    /// # Errors
    /// Why there is no ring that could be trusted.
    pub fn look(&mut self, frame: &Frame, search: &Search) -> Result<Ring, Refusal> {
        self.look_at(frame, search, search.at).map(|found| found.0).map_err(|miss| miss.refusal)
    }

    /// Looks for one ring in a window about `at`. A miss says where in the picture a cut ring lies.
    fn look_at(&mut self, frame: &Frame, search: &Search, at: [f64; 2]) -> Result<(Ring, Light), Miss> {
        // What is no number is no place.
        self.looks = self.looks.saturating_add(u32::from(at.iter().all(|c| c.is_finite())));
        if search.is_disc() {
            return self.look_at_disc(frame, search, at);
        }
        let refused = |refusal| Miss { refusal, cut_at: None };
        let diameter = search.diameter_px();
        let side = search.side_px(self.settings.window_diameters).min(MAX_SIDE as f64);
        let half = 0.5 * (side - 1.0);
        let (low, high) = ([at[0] - half, at[1] - half], [at[0] + half, at[1] + half]);
        let rect = Rect::clipped(frame, low, high).ok_or(refused(Refusal::OutsidePicture))?;
        if (rect.width.min(rect.height) as f64) < diameter {
            return Err(refused(Refusal::OutsidePicture));
        }
        let window = Window::of(rect, diameter);

        let view = self.plane.load(frame, rect, window.every);
        let filled = PI * diameter * diameter / 4.0;
        let area = (rect.width * rect.height) as f64;
        let hole = filled / (search.ratio * search.ratio);
        let levels = threshold::levels(&view, (filled - hole) / area, hole / area);
        let sampled = window.search(search, at);
        let mut found = Err(refused(Refusal::LowContrast));
        for cut in levels.cuts(diameter, self.settings.min_contrast * 255.0) {
            self.bits.pack(&view, cut.threshold);
            let candidate =
                find((&mut self.bits, &mut self.components), &sampled, &window, cut.filtered, &self.settings);
            // Of why there is none, the first cut knows most.
            if candidate.is_ok() || found == Err(refused(Refusal::LowContrast)) {
                found = candidate;
            }
            if found.is_ok() {
                break;
            }
        }
        let candidate = found
            .map_err(|miss| {
                let cut_at = miss.cut_at.map(|cut| window.in_picture(cut));
                match cut_at {
                    Some(cut) if leaves(frame, search, cut) => refused(Refusal::CutByPicture),
                    _ => Miss { cut_at, ..miss },
                }
            })?
            .in_picture(&window);
        centre::measure(frame, &mut self.workspace, &candidate, search, &self.settings).map_err(refused)
    }
}

/// The ring in a binary window, which is filtered before if it may be; all is in samples of the window.
fn find(
    (bits, components): (&mut Bits, &mut Components),
    search: &Search,
    window: &Window,
    filtered: bool,
    settings: &Settings,
) -> Result<Candidate, Miss> {
    if filtered && settings.median {
        bits.median();
    }
    let thickness = 0.5 * search.diameter_px() * (1.0 - 1.0 / search.ratio);
    if filtered && settings.opening && thickness >= MIN_OPENED {
        bits.open();
    }
    let most = window.scaled(settings.max_centroid_distance_px);
    candidate::find(components, bits, search, most, settings)
}

/// Whether a ring with its centre `at` is not wholly in the picture.
fn leaves(frame: &Frame, search: &Search, at: [f64; 2]) -> bool {
    let size = [f64::from(frame.width()), f64::from(frame.height())];
    // Half the predicted ellipse's extent along u and v.
    let half = [0, 2].map(|i| 2.0 * libm::sqrt(search.shape[i].max(0.0)));
    (0..2).any(|i| at[i] - half[i] < -0.5 || at[i] + half[i] > size[i] - 0.5)
}

#[cfg(test)]
mod tests;
