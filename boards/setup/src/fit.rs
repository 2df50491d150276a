//! Whether the seeds fit the circles: is there a pose of the carbody that shows every circle near its seed
//! (thesis 3.3)? Swapped seeds and targets seen from behind are found here, not on the track.

use gangway_pose::{Centre, Method, Observation, Settings, project_circle, solve};

use crate::document::Document;
use crate::parts::Parts;

/// How well a person points at a ring's centre, px.
const SEED_SIGMA_PX: f64 = 3.0;
/// A seed further than this from where its circle must show, px, and than the ring is wide, is another
/// ring's.
const FURTHEST_PX: f64 = 10.0;

impl Document<'_> {
    /// Checks the seeds against the circles, both good by themselves, for each carbody.
    pub(crate) fn check_fit(&mut self, parts: &Parts) {
        for carbody in [2, 1] {
            self.check_fit_of(parts, carbody);
        }
    }

    fn check_fit_of(&mut self, parts: &Parts, carbody: u8) {
        let lens = crate::lens(&parts.camera);
        let (mut seeded, mut observations) = (Vec::new(), Vec::new());
        let targets = parts.targets.iter().enumerate().filter(|(_, target)| target.carbody == carbody);
        for (i, target) in targets {
            for (k, (circle, seed)) in crate::circles(i, target).into_iter().zip(&target.seeds_px).enumerate()
            {
                let variance = SEED_SIGMA_PX * SEED_SIGMA_PX;
                let centre = Centre { at: *seed, covariance: [variance, 0.0, variance] };
                observations.push(Observation { point: circle.point, centre });
                seeded.push((i, k, circle, *seed));
            }
        }
        // Targets without seeds find themselves.
        if observations.is_empty() {
            return;
        }
        let solver = Settings { method: Method::Auto, gate_px: FURTHEST_PX, ..Settings::default() };
        let Ok(solution) = solve(&observations, &lens, &solver, None) else {
            let sentence = "has seeds_px that no place of the carbody explains; check their order, circles_mm, \
                            origin_mm, u, v and the camera";
            return self.at(None, sentence.to_owned());
        };
        let mut seen_from_behind = None;
        for (i, k, circle, seed) in seeded {
            let path = format!("target[{i}].seeds_px[{k}]");
            let Ok(shown) = project_circle(&circle, &solution.pose, &lens) else {
                self.at_path(
                    &path,
                    format!("{path} belongs to a circle that the other seeds put out of sight"),
                );
                continue;
            };
            let off = (shown.centre[0] - seed[0]).hypot(shown.centre[1] - seed[1]);
            let allowed = shown.diameter_px.max(FURTHEST_PX);
            if off > allowed {
                let [u, v] = shown.centre;
                self.at_path(
                    &path,
                    format!(
                        "{path} is {off:.0} px from [{u:.0}, {v:.0}], where the other seeds put its circle; it \
                         must be within {allowed:.0} px"
                    ),
                );
            }
            let towards = solution.pose.transform(&circle.point);
            if (solution.pose.rotation * circle.normal).dot(&towards) >= 0.0 && seen_from_behind != Some(i) {
                seen_from_behind = Some(i);
                let path = format!("target[{i}]");
                let name = &parts.targets[i].name;
                self.at_path(
                    &path,
                    format!("{path} (\"{name}\") is seen from behind; u x v must point towards the camera"),
                );
            }
        }
    }
}
