//! What has no pose gets a typed error; wrong circles are named and left out; nothing panics, and no pose is
//! wrong.

mod scenes;

use gangway_pose::{
    Centre, Lens, LensError, Method, Observation, Pose, PoseError, Settings, project_circle, rest_mean, solve,
};
use nalgebra::{Matrix3, Vector3};
use proptest::prelude::*;
use scenes::{Scene, ride, rig};

/// What the solver says without a prior.
fn refused(observations: &[Observation], scene: &Scene) -> PoseError {
    solve(observations, &scene.lens, &Settings::default(), None).expect_err("there is no pose")
}

#[test]
fn degenerate_input_is_refused_with_its_reason() {
    let scene = rig();
    let good = scene.observe(&[0, 1, 2, 7, 14, 21, 24], &scene.rest, 0.02);
    assert_eq!(refused(&good[..3], &scene), PoseError::TooFew { circles: 3, needed: 4 });
    assert_eq!(refused(&[], &scene), PoseError::TooFew { circles: 0, needed: 4 });
    assert_eq!(refused(&[good[0]; 65], &scene), PoseError::TooMany);
    let repeated = [good[0], good[1], good[2], good[0], good[1], good[2]];
    assert_eq!(refused(&repeated, &scene), PoseError::TooFew { circles: 3, needed: 4 });
    let line: Vec<_> = [5, 0, 2, 6].map(|i| i as f64).iter().map(|i| on_line(&scene, *i)).collect();
    assert_eq!(refused(&line, &scene), PoseError::OnOneLine);

    for bad in [f64::NAN, f64::INFINITY, f64::MAX] {
        let mut seen = good.clone();
        seen[2].centre.at[1] = bad;
        assert_eq!(refused(&seen, &scene), PoseError::NotFinite { circle: 2 });
        let mut seen = good.clone();
        seen[3].point.y = bad;
        assert_eq!(refused(&seen, &scene), PoseError::NotFinite { circle: 3 });
    }
    for bad in [[0.0, 0.0, 1.0], [1.0, 1.0, 1.0], [1.0, 0.0, -1.0], [f64::NAN, 0.0, 1.0], [0.0; 3]] {
        let mut seen = good.clone();
        seen[1].centre.covariance = bad;
        assert_eq!(refused(&seen, &scene), PoseError::Covariance { circle: 1 });
    }
    let lens = Lens { focal: [0.0, 1470.0], ..scene.lens };
    assert_eq!(solve(&good, &lens, &Settings::default(), None), Err(PoseError::Lens));
    let mut far = good.clone();
    far[4].centre.at = [90_000.0, 546.8];
    let barrel = Lens { distortion: [-0.3, 0.0, 0.0, 0.0, 0.0], ..scene.lens };
    assert_eq!(
        solve(&far, &barrel, &Settings::default(), None),
        Err(PoseError::NoRay { circle: 4, reason: LensError::NotInvertible })
    );
    assert_eq!(rest_mean(&[]), Err(PoseError::TooFew { circles: 0, needed: 1 }));
}

fn on_line(scene: &Scene, step: f64) -> Observation {
    let point = Vector3::new(0.0, 100.0 * step, 330.0);
    let at = scene.lens.project(&scene.rest.transform(&point)).expect("it is before the camera");
    Observation { point, centre: Centre { at, covariance: [4e-4, 0.0, 4e-4] } }
}

#[test]
fn the_dlt_says_that_a_plane_and_one_circle_is_degenerate_for_it() {
    let scene = rig();
    let chosen: Vec<usize> = (0..14).chain([23]).collect();
    let observations = scene.observe(&chosen, &scene.rest, 0.02);
    let by = |method| {
        solve(&observations, &scene.lens, &Settings { method, ..Settings::default() }, None).map(|s| s.pose)
    };
    assert_eq!(by(Method::Dlt), Err(PoseError::NearlyOnePlane));
    assert!(by(Method::Epnp).is_ok() && by(Method::Auto).is_ok());
}

/// A point reflected at the camera's centre has the same pixel: such a pose must never come out.
#[test]
fn a_prior_behind_the_camera_or_far_off_is_of_no_consequence() {
    let scene = ride();
    let truth = scene.pose([10.0, 200.0, -50.0], [1.0, 2.0, -8.0]);
    for chosen in [(0..19).collect::<Vec<_>>(), (5..12).collect()] {
        let observations = scene.observe(&chosen, &truth, 0.02);
        let flip = Matrix3::new(-1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, -1.0);
        let priors = [
            Pose { rotation: truth.rotation, translation: -truth.translation },
            Pose { rotation: flip * truth.rotation, translation: truth.translation },
            Pose { rotation: truth.rotation * flip, translation: truth.translation },
            Pose { rotation: Matrix3::zeros(), translation: truth.translation },
            Pose { rotation: truth.rotation * f64::NAN, translation: truth.translation },
            Pose { rotation: truth.rotation, translation: Vector3::new(9e3, -8e3, 50.0) },
            Pose { rotation: -truth.rotation, translation: truth.translation * 1e30 },
        ];
        for (i, prior) in priors.iter().enumerate() {
            let solution = solve(&observations, &scene.lens, &Settings::default(), Some(prior));
            let pose = solution.expect("the picture alone suffices").pose;
            let off = (pose.translation - truth.translation).norm();
            assert!(off < 1e-6, "prior {i}, {} circles: {off} mm", chosen.len());
        }
    }
}

/// From ten circles up to 30 % of them, with fewer one; half a ring to half a picture off.
fn wrong_circles() -> impl Strategy<Value = (Vec<usize>, Vec<(usize, f64, f64)>)> {
    proptest::sample::subsequence((0..19).collect::<Vec<_>>(), 6..=19).prop_flat_map(|chosen| {
        let most = if chosen.len() < 10 { 1 } else { chosen.len() * 3 / 10 };
        let positions: Vec<usize> = (0..chosen.len()).collect();
        let wrong = proptest::sample::subsequence(positions, 1..=most).prop_flat_map(|wrong| {
            wrong
                .into_iter()
                .map(|i| (Just(i), 12.0..600.0_f64, 0.0..std::f64::consts::TAU))
                .collect::<Vec<_>>()
        });
        (Just(chosen), wrong)
    })
}

#[test]
fn one_wrong_circle_of_six_does_not_turn_two_right_ones_out() {
    let scene = ride();
    let truth = scene.pose([10.0, 40.0, -20.0], [1.0, -1.0, 0.0]);
    for distance in 12..200 {
        let mut observations = scene.observe(&[1, 2, 3, 6, 8, 18], &truth, 0.02);
        observations[3].centre.at[0] += f64::from(distance);
        let solution = solve(&observations, &scene.lens, &Settings::default(), None);
        let used = solution.map(|solution| solution.used);
        assert!(matches!(used, Ok(0b11_0111) | Err(PoseError::NoConsensus)), "{distance} px: {used:?}");
    }
}

#[test]
fn a_pose_that_a_wrong_circle_had_drawn_away_is_refined_to_its_end() {
    let scene = ride();
    // Six circles, which of them is wrong, how far in px and in which direction; the turn of the carbody.
    for (chosen, (i, distance, angle), warm, yaw) in [
        ([5, 13, 14, 15, 16, 18], (3, 449.3_f64, 0.0_f64), true, 0.0),
        ([0, 1, 4, 12, 14, 16], (0, 473.9, 0.328), true, -2.448),
        ([1, 2, 4, 5, 7, 11], (1, 309.9, 5.446), false, -11.574),
    ] {
        let truth = scene.pose([10.0, 40.0, -20.0], [1.0, -1.0, yaw]);
        let prior = scene.pose([5.0, 30.0, -15.0], [1.0, -0.8, yaw + 0.4]);
        let mut observations = scene.observe(&chosen, &truth, 0.02);
        observations[i].centre.at[0] += distance * angle.cos();
        observations[i].centre.at[1] += distance * angle.sin();
        let solution = solve(&observations, &scene.lens, &Settings::default(), warm.then_some(&prior));
        let pose = solution.expect("five circles agree").pose;
        let off = (pose.translation - truth.translation).norm();
        assert!(off < 1e-6, "{chosen:?}: {off} mm, of exact centres");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(600) })]

    #[test]
    fn wrong_circles_are_named_and_leave_the_pose_alone(
        (chosen, wrong) in wrong_circles(), warm in any::<bool>(), yaw in -12.0..12.0_f64,
    ) {
        let scene = ride();
        let truth = scene.pose([10.0, 40.0, -20.0], [1.0, -1.0, yaw]);
        let prior = scene.pose([5.0, 30.0, -15.0], [1.0, -0.8, yaw + 0.4]);
        let mut observations = scene.observe(&chosen, &truth, 0.02);
        let mut right = u64::MAX >> (64 - chosen.len());
        for (i, distance, angle) in &wrong {
            observations[*i].centre.at[0] += distance * angle.cos();
            observations[*i].centre.at[1] += distance * angle.sin();
            right &= !(1 << i);
        }
        match solve(&observations, &scene.lens, &Settings::default(), warm.then_some(&prior)) {
            Ok(solution) => {
                prop_assert_eq!(solution.used, right);
                // Only exact centres are left: a tenth of a standard deviation is for sets that hardly have a
                // pose.
                let squared = |pose: &Pose| {
                    let off = truth.translation - pose.translation;
                    let covariance = solution.covariance.fixed_view::<3, 3>(0, 0).into_owned();
                    off.dot(&covariance.cholesky().expect("positive definite").solve(&off))
                };
                // Where the picture cannot tell two poses apart, the one that follows from the prior stands,
                // and the other one is told.
                let other = solution.alternative.filter(|other| other.evidence < 25.0);
                let nearest = other.map_or(f64::INFINITY, |other| squared(&other.pose)).min(squared(&solution.pose));
                prop_assert!(nearest < 0.01, "normalised squared error {}", nearest);
            }
            // What is left may be too little to say which circle is wrong: then it is said.
            Err(error) => prop_assert!(
                error == PoseError::NoConsensus && chosen.len() < 10, "{:?} of {} circles", error, chosen.len()
            ),
        }
    }

    #[test]
    fn random_rubbish_never_panics_and_never_passes_for_a_good_pose(
        numbers in proptest::collection::vec((any::<[f64; 3]>(), -500.0..2500.0_f64, any::<[f64; 3]>(), 0..8), 0..70),
        lens in any::<[f64; 10]>(), odd_lens in any::<bool>(), prior in any::<[f64; 12]>(), circles in any::<u8>(),
    ) {
        let good = ride();
        let lens = if odd_lens {
            Lens {
                focal: [lens[0], lens[1]], skew: lens[2], principal: [lens[3], lens[4]],
                distortion: [lens[5], lens[6], lens[7], lens[8], lens[9]],
            }
        } else {
            good.lens
        };
        let observations: Vec<Observation> = numbers
            .iter()
            .map(|(point, u, covariance, plain)| Observation {
                // Mostly numbers of a usual size, at random; now and then any bits at all.
                point: if *plain == 0 { Vector3::from(*point) } else { point.map(|c| (c.to_bits() % 2000) as f64).into() },
                centre: Centre {
                    at: [*u, (covariance[0].to_bits() % 1080) as f64],
                    covariance: if *plain == 1 { *covariance } else { [1e-3, 0.0, 1e-3] },
                },
            })
            .collect();
        let [a, b, c, d, e, f, g, h, i, x, y, z] = prior;
        let prior = Pose { rotation: Matrix3::new(a, b, c, d, e, f, g, h, i), translation: Vector3::new(x, y, z) };
        let settings = Settings { min_circles: circles, ..Settings::default() };
        if let Ok(solution) = solve(&observations, &lens, &settings, Some(&prior)) {
            prop_assert!(solution.used.count_ones() >= 4 && solution.residual_px.is_finite());
            prop_assert!(observations.len() < 8, "{} random circles agree", observations.len());
        }
        let circle = gangway_pose::Circle {
            point: Vector3::new(x, y, z), normal: Vector3::new(a, b, c), outer_mm: d, inner_mm: e, target: 0,
        };
        let _ = project_circle(&circle, &prior, &lens);
        let _ = lens.pixel_to_ray([x, y]);
    }
}
