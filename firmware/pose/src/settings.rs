//! What a person can set about the solver. Units, defaults and bounds stand with each field; the setup file
//! checks them.

/// Which solver gives the first pose. All are refined on the reprojection error afterwards.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Method {
    /// DLT or homography up to 15 circles, EPnP above (thesis 5.4.7).
    #[default]
    Auto,
    /// DLT for general sets, homography for planar ones, with Levenberg-Marquardt.
    Dlt,
    /// EPnP with Gauss-Newton.
    Epnp,
}

/// Settings of the pose solver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Solver of the first pose.
    pub method: Method,
    /// Fewest circles that make a pose; 4 to 64, default 4.
    pub min_circles: u8,
    /// A circle whose reprojection error is above this many of its standard deviations (and above
    /// `gate_px`) is left out; 2 to 100, default 6.
    pub gate_sigmas: f64,
    /// No circle is left out below this reprojection error, px; 0.05 to 10, default 0.5. Calibration,
    /// printing and mounting are not in the centres' covariance.
    pub gate_px: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self { method: Method::Auto, min_circles: 4, gate_sigmas: 6.0, gate_px: 0.5 }
    }
}
