//! Exact centres give the exact pose, over the whole motion envelope, by every method, cold and warm.

mod scenes;

use gangway_pose::{Method, Pose, PoseError, Settings, solve};
use nalgebra::Vector3;
use proptest::prelude::*;
use scenes::{Scene, flat, ride, rig};

/// Exact pixels are rounded at 1e-13 px; the worst set (four near circles at 5 m) makes some 1e-9 mm of that.
const MM: f64 = 1e-6;
const DEGREES: f64 = 1e-7;

/// Largest distance of the translations in mm, and angle between the rotations in degrees.
fn apart(a: &Pose, b: &Pose) -> (f64, f64) {
    let turn = a.rotation * b.rotation.transpose();
    let sine = Vector3::new(turn.m32 - turn.m23, turn.m13 - turn.m31, turn.m21 - turn.m12).norm() / 2.0;
    let angle = sine.atan2((turn.trace() - 1.0) / 2.0);
    ((a.translation - b.translation).norm(), angle.to_degrees())
}

fn settings(method: Method) -> Settings {
    Settings { method, ..Settings::default() }
}

fn check(scene: &Scene, chosen: &[usize], truth: &Pose, method: Method, prior: Option<&Pose>) {
    let observations = scene.observe(chosen, truth, 0.02);
    match solve(&observations, &scene.lens, &settings(method), prior) {
        Ok(solution) => {
            let (mm, degrees) = apart(&solution.pose, truth);
            assert!(mm < MM && degrees < DEGREES, "{method:?} {chosen:?}: {mm} mm, {degrees} degrees");
            assert_eq!(solution.used.count_ones() as usize, chosen.len());
        }
        // The DLT says which general sets it cannot take.
        Err(PoseError::NearlyOnePlane | PoseError::TooFew { needed: 6, .. }) if method == Method::Dlt => {}
        Err(error) => panic!("{method:?} {chosen:?}: {error:?}"),
    }
}

/// x, y, z in mm and roll, pitch, yaw in degrees within the limits of the motion (thesis 1.2).
fn motion() -> impl Strategy<Value = ([f64; 3], [f64; 3])> {
    let mm = (-70.0..60.0, -900.0..900.0, -350.0..350.0);
    let degrees = (-5.0..5.0, -4.0..4.0, -15.0..15.0);
    (mm, degrees).prop_map(|((x, y, z), (a, b, c))| ([x, y, z], [a, b, c]))
}

fn methods() -> impl Strategy<Value = Method> {
    prop_oneof![Just(Method::Auto), Just(Method::Dlt), Just(Method::Epnp)]
}

/// 4 or more of `circles`, in any order.
fn choice(circles: usize) -> impl Strategy<Value = Vec<usize>> {
    proptest::sample::subsequence((0..circles).collect::<Vec<_>>(), 4..=circles)
}

/// Not all but one on a line: such four have two poses.
fn spread(scene: &Scene, chosen: &[usize]) -> bool {
    let n = chosen.len();
    (0..n).all(|left_out| {
        let rest: Vec<_> = (0..n).filter(|i| *i != left_out).map(|i| scene.points[chosen[i]]).collect();
        let base = rest[1] - rest[0];
        rest.iter().any(|p| base.cross(&(p - rest[0])).norm() > 0.05 * base.norm() * base.norm())
    })
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(1000) })]

    #[test]
    fn exact_centres_give_the_exact_pose_on_the_rig(
        (mm, deg) in motion(), chosen in choice(28), method in methods(), warm in any::<bool>(),
    ) {
        let scene = rig();
        prop_assume!(spread(&scene, &chosen));
        let truth = scene.pose(mm, deg);
        // The last frame's pose: a fiftieth of a second earlier.
        let prior = scene.pose([mm[0] + 9.0, mm[1] - 14.0, mm[2] + 8.0], [deg[0], deg[1] + 0.2, deg[2] - 0.4]);
        check(&scene, &chosen, &truth, method, warm.then_some(&prior));
    }

    #[test]
    fn exact_centres_give_the_exact_pose_on_the_ride(
        (mm, deg) in motion(), chosen in choice(19), method in methods(), warm in any::<bool>(),
    ) {
        let scene = ride();
        prop_assume!(spread(&scene, &chosen));
        let truth = scene.pose(mm, deg);
        let prior = scene.pose([mm[0] + 9.0, mm[1] - 14.0, mm[2] + 8.0], [deg[0], deg[1] + 0.2, deg[2] - 0.4]);
        check(&scene, &chosen, &truth, method, warm.then_some(&prior));
    }

    #[test]
    fn exact_centres_of_one_plane_give_the_exact_pose(
        (mm, deg) in motion(), chosen in choice(28), method in methods(), warm in any::<bool>(),
    ) {
        let scene = flat();
        prop_assume!(spread(&scene, &chosen));
        let truth = scene.pose(mm, deg);
        let prior = scene.pose([mm[0] + 9.0, mm[1] - 14.0, mm[2] + 8.0], [deg[0], deg[1] + 0.2, deg[2] - 0.4]);
        check(&scene, &chosen, &truth, method, warm.then_some(&prior));
    }
}
