//! What differs between the drawing and the thing: printing, mounting, calibration. The scene file and the
//! setup say what was meant; what is rendered was printed, mounted and built a little otherwise (thesis
//! 4.2.4, 5.3.1, 5.7).

use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

use crate::build::Parts;
use crate::optics::{Lens, Vec3, add, apply, rotation, scale};
use crate::plate::Plate;
use crate::sensor::mix;

/// Keeps the stream of tolerances apart from those of background and noise.
const STREAM: u64 = 0x746f_6c65_7261_6e63;

/// Standard deviations; shares where the scene file has percent.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Tolerance {
    /// Of each circle's centre on its sheet, each axis, mm.
    pub(crate) print_mm: f64,
    /// Of each sheet's scale.
    pub(crate) print_scale: f64,
    /// Of each target's origin, each axis, mm.
    pub(crate) mounting_mm: f64,
    /// Of each target's turn about each of its axes, degrees.
    pub(crate) mounting_deg: f64,
    /// Of both focal lengths together.
    pub(crate) focal: f64,
    /// Of the principal point, each axis, share of the picture's width.
    pub(crate) principal: f64,
    /// Of each distortion coefficient.
    pub(crate) distortion: f64,
}

impl Tolerance {
    /// The scene as it came out.
    pub(crate) fn applied(&self, nominal: &Parts, seed: u64) -> Parts {
        let mut random = Pcg64Mcg::seed_from_u64(mix(&[seed, STREAM]));
        // Drawn whether it is used or not: a tolerance that is set to 0 does not change the others' numbers.
        let mut deviation = |sigma: f64| -> f64 {
            let normal: f64 = StandardNormal.sample(&mut random);
            sigma * normal
        };
        let mut parts = nominal.clone();
        let camera = &mut parts.camera;
        let focal = 1.0 + deviation(self.focal);
        camera.focal = camera.focal.map(|f| f * focal);
        let width = f64::from(nominal.size[0]);
        camera.principal = camera.principal.map(|p| p + deviation(self.principal * width));
        camera.distortion = camera.distortion.map(|k| k * (1.0 + deviation(self.distortion)));
        parts.lens = Lens::new(camera.focal, camera.principal, camera.skew, camera.distortion);
        for plate in &mut parts.plates {
            self.mount(plate, &mut deviation);
        }
        parts
    }

    fn mount(&self, plate: &mut Plate, deviation: &mut impl FnMut(f64) -> f64) {
        let size = 1.0 + deviation(self.print_scale);
        for circle in &mut plate.circles {
            *circle = circle.map(|at| size * at + deviation(self.print_mm));
        }
        plate.radii = plate.radii.map(|radius| size * radius);
        let shift: Vec3 = std::array::from_fn(|_| deviation(self.mounting_mm));
        plate.origin = add(&plate.origin, &shift);
        let turn: [f64; 3] = std::array::from_fn(|_| deviation(self.mounting_deg));
        // The turned axes in the target's own, then in the carbody.
        let turned = rotation(turn[0], turn[1], turn[2]);
        let [u, v, w] = plate.axes;
        plate.axes = std::array::from_fn(|axis| {
            let unit: Vec3 = std::array::from_fn(|i| f64::from(u8::from(i == axis)));
            let [a, b, c] = apply(&turned, &unit);
            add(&scale(&u, a), &add(&scale(&v, b), &scale(&w, c)))
        });
    }

    /// The sizes for people.
    pub(crate) fn lines(&self, nominal: &Parts) -> Vec<String> {
        let percent = |share: f64| (share * 1e5).round() / 1e3;
        vec![
            format!(
                "calibration: focal length {} %, principal point {:.1} px ({} % of the width), distortion {} % of each coefficient",
                percent(self.focal),
                self.principal * f64::from(nominal.size[0]),
                percent(self.principal),
                percent(self.distortion)
            ),
            format!(
                "printing: each circle {} mm in each axis, each sheet's scale {} %",
                self.print_mm,
                percent(self.print_scale)
            ),
            format!(
                "mounting: each target {} mm in each axis and {} degrees about each axis",
                self.mounting_mm, self.mounting_deg
            ),
        ]
    }
}
