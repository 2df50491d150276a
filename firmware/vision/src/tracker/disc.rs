//! One look for a bright disc on dark, as an active target shows (thesis 3.2.1).

use core::f64::consts::PI;

use gangway_device::Frame;

use super::{Tracker, leaves};
use crate::bits::Bits;
use crate::candidate::{self, Miss};
use crate::centre::{self, Workspace};
use crate::components::Components;
use crate::light::Light;
use crate::loader::{Plane, Rect, full_scale};
use crate::{MAX_SIDE, Refusal, Ring, Search, Settings, threshold};

/// Least side of a window, px: what is left between two frames of a target's motion is there for points too.
const LEAST_SIDE: f64 = 24.0;

/// Discs below this diameter are no wider than the median's window, px.
const MEDIAN_PX: f64 = 6.0;

/// Of what the prediction of this frame is off, the share that it is further off than that of the dark frame
/// before it: a carried-on velocity over one and over two frames after lit ones two frames apart is off by
/// 3/2 and by 4 accelerations.
const SHARE_OF_DARK: f64 = 0.625;

/// Least share of the window that is looked at as its brightest: a point's own pixels.
const LEAST_SHARE_PX: f64 = 4.0;

impl Tracker {
    /// Keeps the windows of all discs as they are in a frame without lamps: they are taken off the next
    /// frames, as far as a window has not moved by more than a pixel since.
    pub fn keep_dark(&mut self, frame: &Frame, searches: &[Search]) {
        self.dark.forget();
        for search in searches.iter().filter(|search| search.is_disc()) {
            self.dark.keep(frame, search);
        }
    }

    /// Nothing is taken off any more.
    pub fn forget_dark(&mut self) {
        self.dark.forget();
    }

    /// Looks for one disc in a window about `at`, in what the lamps add to the last dark frame where that is
    /// known.
    pub(super) fn look_at_disc(
        &mut self,
        frame: &Frame,
        search: &Search,
        at: [f64; 2],
    ) -> Result<(Ring, Light), Miss> {
        let Self { settings, plane, bits, components, workspace, dark, .. } = self;
        let mut look = Look { settings, plane, bits, components, workspace };
        let mut further = [0.0; 2];
        let mut answer = None;
        // The first look tells how far the prediction was off, and with it the dark window.
        for _ in 0..2 {
            let Some((difference, corner)) =
                dark.take_off(frame, search, further).filter(|_| at == search.at)
            else {
                // The disc itself has moved too far.
                answer = None;
                break;
            };
            let corner = corner.map(f64::from);
            let own = [0, 1].map(|i| at[i] - corner[i]);
            let (mut ring, light) = look.at(&difference, &Search { at: own, ..*search }, own)?;
            ring.centre.at = [0, 1].map(|i| ring.centre.at[i] + corner[i]);
            further = [0, 1].map(|i| SHARE_OF_DARK * (ring.centre.at[i] - at[i]));
            answer = Some((ring, light));
        }
        answer.map_or_else(|| look.at(frame, search, at), Ok)
    }
}

/// Side of a disc's window, px.
fn side(settings: &Settings, search: &Search) -> f64 {
    search.side_px(settings.window_diameters).clamp(LEAST_SIDE, MAX_SIDE as f64)
}

/// The tracker but for its dark windows, which a frame may be made of.
struct Look<'t> {
    settings: &'t Settings,
    plane: &'t mut Plane,
    bits: &'t mut Bits,
    components: &'t mut Components,
    workspace: &'t mut Workspace,
}

impl Look<'_> {
    fn at(&mut self, frame: &Frame, search: &Search, at: [f64; 2]) -> Result<(Ring, Light), Miss> {
        let refused = |refusal| Miss { refusal, cut_at: None };
        let diameter = search.diameter_px();
        let half = 0.5 * (side(self.settings, search) - 1.0);
        let (low, high) = ([at[0] - half, at[1] - half], [at[0] + half, at[1] + half]);
        let window = Rect::clipped(frame, low, high).ok_or(refused(Refusal::OutsidePicture))?;
        // Written so that a NaN is refused too.
        let is_wide = (window.width.min(window.height) as f64) >= diameter;
        if !is_wide {
            return Err(refused(Refusal::OutsidePicture));
        }
        let view = self.plane.load(frame, window, 1);
        let area = (PI * diameter * diameter / 4.0).max(LEAST_SHARE_PX);
        let levels = threshold::disc_levels(&view, area / (window.width * window.height) as f64);
        if levels.bright - levels.dark < self.settings.min_contrast * 255.0 {
            return Err(refused(Refusal::LowContrast));
        }
        self.bits.pack(&view, levels.threshold(threshold::MIDDLE));
        if self.settings.median && diameter >= MEDIAN_PX {
            self.bits.median();
        }
        let predicted = [at[0] - f64::from(window.x), at[1] - f64::from(window.y)];
        let candidate = candidate::disc::find(self.components, self.bits, search, predicted, self.settings)
            .map_err(|miss| match miss.refusal {
            Refusal::NotFound if leaves(frame, search, at) => refused(Refusal::CutByPicture),
            _ => miss,
        })?;
        let scale = f64::from(full_scale(frame)) / 255.0;
        let levels = (levels.dark * scale, levels.bright * scale);
        let ring =
            centre::measure_disc(frame, self.workspace, window, &candidate, levels, search, self.settings)
                .map_err(refused)?;
        // How evenly it is lit is each disc's own affair.
        Ok((ring, Light::NONE))
    }
}
