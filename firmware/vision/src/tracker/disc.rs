//! One look for a bright disc on dark, as an active target shows (thesis 3.2.1).

use core::f64::consts::PI;

use gangway_device::Frame;

use super::{Tracker, leaves};
use crate::candidate::{self, Miss};
use crate::centre;
use crate::light::Light;
use crate::loader::{Rect, full_scale};
use crate::{MAX_SIDE, Refusal, Ring, Search, threshold};

/// Least side of a window, px: what is left between two frames of a target's motion is there for points too.
const LEAST_SIDE: f64 = 24.0;

/// Discs below this diameter are no wider than the median's window, px.
const MEDIAN_PX: f64 = 6.0;

/// Least share of the window that is looked at as its brightest: a point's own pixels.
const LEAST_SHARE_PX: f64 = 4.0;

impl Tracker {
    /// Looks for one disc in a window about `at`.
    pub(super) fn look_at_disc(
        &mut self,
        frame: &Frame,
        search: &Search,
        at: [f64; 2],
    ) -> Result<(Ring, Light), Miss> {
        let refused = |refusal| Miss { refusal, cut_at: None };
        let diameter = search.diameter_px();
        let side = libm::ceil(self.settings.window_diameters * diameter).clamp(LEAST_SIDE, MAX_SIDE as f64);
        let half = 0.5 * (side - 1.0);
        let (low, high) = ([at[0] - half, at[1] - half], [at[0] + half, at[1] + half]);
        let window = Rect::clipped(frame, low, high).ok_or(refused(Refusal::OutsidePicture))?;
        // Written so that a NaN is refused too.
        let is_wide = (window.width.min(window.height) as f64) >= diameter;
        if !is_wide {
            return Err(refused(Refusal::OutsidePicture));
        }
        self.plane.load(frame, window);
        let area = (PI * diameter * diameter / 4.0).max(LEAST_SHARE_PX);
        let levels = threshold::disc_levels(&self.plane, area / (window.width * window.height) as f64);
        if levels.bright - levels.dark < self.settings.min_contrast * 255.0 {
            return Err(refused(Refusal::LowContrast));
        }
        self.bits.pack(&self.plane, levels.threshold());
        if self.settings.median && diameter >= MEDIAN_PX {
            self.bits.median();
        }
        let predicted = [at[0] - f64::from(window.x), at[1] - f64::from(window.y)];
        let (components, workspace) = (&mut self.components, &mut self.workspace);
        let candidate = candidate::disc::find(components, &self.bits, search, predicted, &self.settings)
            .map_err(|miss| match miss.refusal {
                Refusal::NotFound if leaves(frame, search, at) => refused(Refusal::CutByPicture),
                _ => miss,
            })?;
        let scale = f64::from(full_scale(frame)) / 255.0;
        let levels = (levels.dark * scale, levels.bright * scale);
        let ring = centre::measure_disc(frame, workspace, window, &candidate, levels, search, &self.settings)
            .map_err(refused)?;
        // How evenly it is lit is each disc's own affair.
        Ok((ring, Light::NONE))
    }
}
