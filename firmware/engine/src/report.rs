//! From what the frame gave to what goes on the wire.

use gangway_pose::{PoseError, RestPose, Solution, relative_motion};
use gangway_vision::Ring;
use gangway_wire::{self as wire, Marker, PoseFlags, Record};

use crate::Settings;
use crate::rest::Found;

/// The motion of a solution against rest, and what is to be said about it.
pub(crate) fn motion(
    rest: Option<&RestPose>,
    solution: Result<&Solution, &PoseError>,
    settings: &Settings,
) -> (Option<wire::Motion>, PoseFlags) {
    let mut flags = PoseFlags::default();
    if rest.is_none() {
        flags |= PoseFlags::WAITING;
    }
    let solution = match solution {
        Ok(solution) => solution,
        Err(PoseError::TooFew { .. }) => return (None, flags | PoseFlags::FEW_MARKERS),
        Err(_) => return (None, flags | PoseFlags::NO_SOLUTION),
    };
    let Some(rest) = rest else { return (None, flags) };
    let motion = relative_motion(rest, solution);
    let (displacement, rotation) = (motion.displacement_mm, motion.rotation_deg);
    let limits = &settings.limits;
    let beyond = (0..3).any(|i| {
        displacement[i] < limits.min_mm[i]
            || displacement[i] > limits.max_mm[i]
            || libm::fabs(rotation[i]) > limits.max_deg[i]
    });
    if beyond {
        flags |= PoseFlags::BEYOND_LIMITS;
    }
    let motion = wire::Motion {
        displacement_mm: displacement.map(|mm| mm as f32),
        rotation_deg: rotation.map(|deg| deg as f32),
        sigma: core::array::from_fn(|i| libm::sqrt(motion.covariance[(i, i)]) as f32),
        residual_px: solution.residual_px as f32,
    };
    (Some(motion), flags)
}

/// The record of a rest pose, in the camera's frame.
pub(crate) fn rest(found: &Found) -> Record<'static> {
    let pose = found.own.map_or(found.pose, |own| found.pose.seen_from(&own));
    let in_rest_frame = pose.covariance_in_rest_frame();
    let mut covariance = [0.0; 21];
    let upper = (0..6).flat_map(|row| (row..6).map(move |column| (row, column)));
    for (entry, at) in covariance.iter_mut().zip(upper) {
        *entry = in_rest_frame[at] as f32;
    }
    Record::Rest(wire::Rest {
        first_frame: found.first_frame,
        last_frame: found.last_frame,
        frames: found.frames,
        rotation: pose.pose.quaternion(),
        translation_mm: pose.pose.translation.into(),
        covariance,
    })
}

/// The centres of one frame as they go on the wire; `used` has a bit for each circle in the pose.
pub(crate) fn centres<'r>(
    rings: impl Iterator<Item = (usize, &'r Ring)>,
    used: u64,
    into: &mut wire::Centres,
) {
    into.clear();
    for (circle, ring) in rings {
        // Circles come by rising number and there are never more than MAX_MARKERS: all are taken.
        let _ = into.push(circle as u8, &marker(ring), used >> circle & 1 == 1);
    }
}

fn marker(ring: &Ring) -> Marker {
    let [uu, uv, vv] = ring.centre.covariance;
    let (u, v) = (libm::sqrt(uu), libm::sqrt(vv));
    let correlation = if u > 0.0 && v > 0.0 { uv / (u * v) } else { 0.0 };
    Marker {
        at_px: ring.centre.at.map(|px| px as f32),
        sigma_px: [u as f32, v as f32],
        correlation: correlation as f32,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gangway_pose::{Pose, rotation};
    use nalgebra::{Matrix6, Vector3};

    #[test]
    fn the_rest_record_carries_its_covariance_in_the_rest_frame() {
        // The camera looks along the carbody's x: camera z is rest x. 2 mm along the view, 0.01 rad about it.
        let looking = rotation(-core::f64::consts::FRAC_PI_2, 0.0, -core::f64::consts::FRAC_PI_2).transpose();
        let mut covariance = Matrix6::zeros();
        covariance[(2, 2)] = 4.0;
        covariance[(5, 5)] = 1e-4;
        let pose = Pose { rotation: looking, translation: Vector3::new(1.0, 2.0, 1600.0) };
        let found = Found {
            first_frame: 0,
            last_frame: 9,
            frames: 10,
            ambiguous: false,
            pose: RestPose::new(pose, covariance),
            own: None,
        };
        let Record::Rest(record) = rest(&found) else { panic!("a rest record") };
        assert!((record.covariance[0] - 4.0).abs() < 1e-6, "x, mm^2: {:?}", record.covariance);
        let degrees = 0.01f64.to_degrees() as f32;
        assert!((record.covariance[15] - degrees * degrees).abs() < 1e-6, "roll, degrees^2");
        let read = Pose::from_quaternion(record.rotation, record.translation_mm.into());
        assert!((read.rotation - looking).norm() < 1e-12, "rounding only");
        assert_eq!(read.translation, pose.translation);
    }
}
