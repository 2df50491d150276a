//! What a person can set about the tracker (thesis 3.2.3, 3.2.5).

/// Settings of the tracker. Units, defaults and bounds stand with each field; the setup file checks them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Side of the search window in ring diameters; 2.0 to 3.0, default 2.5.
    pub window_diameters: f64,
    /// Median 3x3 before the threshold, for compressed video; default true.
    pub median: bool,
    /// Opening with a disk after the threshold; default true.
    pub opening: bool,
    /// Least difference between the bright and the dark level, share of full scale; 0.01 to 0.5, default
    /// 0.03.
    pub min_contrast: f64,
    /// Largest distance between the centroids of the dark and the bright component, px; 0.5 to 5, default 2.
    pub max_centroid_distance_px: f64,
    /// Allowed relative deviation of the ring's area from the expected one; 0.05 to 0.8, default 0.35.
    pub area_tolerance: f64,
    /// How far filled:inner area may be above or below the square of outer:inner diameter, as a factor less
    /// one; 0.05 to 2, default 1: motion within the exposure closes the inner disc.
    pub ratio_tolerance: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            window_diameters: 2.5,
            median: true,
            opening: true,
            min_contrast: 0.03,
            max_centroid_distance_px: 2.0,
            area_tolerance: 0.35,
            ratio_tolerance: 1.0,
        }
    }
}
