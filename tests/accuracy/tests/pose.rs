//! The claims about the pose, asserted in short form; `cargo run --release -p accuracy` prints the whole
//! tables.

use accuracy::outliers::{self, Outcome, Wrong};
use accuracy::sets::Kind;
use accuracy::{bound, methods, plane, scatter, shutter};
use gangway_pose::Method;

/// Six, the mean of a true normalised squared error, within 15 %: the claim. The mean over 600 scatters by
/// 2.4 %.
const TRUE: std::ops::Range<f64> = 6.0 * 0.85..6.0 * 1.15;

fn sum(outcomes: &[Outcome], part: impl Fn(&Outcome) -> u32) -> u32 {
    outcomes.iter().map(part).sum()
}

#[test]
fn three_in_ten_wrong_circles_leave_the_pose_within_its_uncertainty_and_are_named() {
    for kind in [Kind::General, Kind::Planar] {
        for wrong in Wrong::ALL {
            for circles in [10, 14, 20, 28] {
                let case = format!("{circles} circles, {kind:?}, {wrong:?}");
                let outcomes = [false, true].map(|warm| outliers::run(kind, circles, wrong, warm, 3, 60));
                assert_eq!(sum(&outcomes, |o| o.refused), 0, "{case}");
                // What fits the picture as well as the truth does cannot be told from it: it takes a wrong
                // circle near by of few that hold a degree of freedom.
                let beyond = sum(&outcomes, |o| o.beyond - o.marked - o.undecidable);
                assert_eq!(beyond, 0, "{case}");
                let undecidable = sum(&outcomes, |o| o.undecidable);
                assert!(undecidable <= if circles < 14 { 5 } else { 1 }, "{case}: {undecidable} of 120");
                assert!(sum(&outcomes, |o| o.taken) <= undecidable, "{case}: wrong circles are named");
            }
        }
    }
}

#[test]
fn one_wrong_circle_of_seven_and_more_is_taken_out() {
    for kind in [Kind::General, Kind::Planar] {
        for wrong in Wrong::ALL {
            for circles in [7, 9] {
                let case = format!("{circles} circles, {kind:?}, {wrong:?}");
                let outcomes = [false, true].map(|warm| outliers::run(kind, circles, wrong, warm, 5, 60));
                assert_eq!(sum(&outcomes, |o| o.beyond - o.marked - o.undecidable), 0, "{case}");
                assert_eq!(sum(&outcomes, |o| o.taken), 0, "{case}");
                // Of two circles that alone hold a degree of freedom it may be either: then there is no pose.
                let refused = sum(&outcomes, |o| o.refused);
                let allowed = match wrong {
                    Wrong::Near => 12,
                    Wrong::Far => 2,
                    _ => 0,
                };
                assert!(refused <= allowed, "{case}: {refused} refused");
            }
        }
    }
}

#[test]
fn one_wrong_circle_of_five_or_six_is_out_or_covered_wherever_the_picture_tells() {
    for kind in [Kind::General, Kind::Planar] {
        for wrong in Wrong::ALL {
            for circles in [5, 6] {
                let case = format!("{circles} circles, {kind:?}, {wrong:?}");
                let outcomes = [false, true].map(|warm| outliers::run(kind, circles, wrong, warm, 7, 300));
                // Of four circles left in a plane the profile of the tilt is a bent valley: one in a
                // thousand.
                assert!(sum(&outcomes, |o| o.beyond - o.marked - o.undecidable) <= 1, "{case}: {outcomes:?}");
                // A set-back circle 2 px off is another pose's right one: 3.4 % at five.
                assert!(sum(&outcomes, |o| o.undecidable) <= 36, "{case}: {outcomes:?}");
                assert!(sum(&outcomes, |o| o.refused) <= 48, "{case}: {outcomes:?}");
            }
        }
    }
}

#[test]
fn a_plane_that_merges_with_its_mirror_image_is_as_uncertain_as_it_says() {
    // At 0.05 and 0.1 px one 7-CCC at 4.5 m and 1 degree has one pose in many frames, and no second to be
    // marked by. A rest pose of ten such pictures shares their error and is surer than they are: up to 0.5 %,
    // linearised 2 to 4 %.
    for sigma_px in [0.02, 0.05, 0.1] {
        let outcome = plane::run(sigma_px, 1.0, 5, 1500);
        assert!(outcome.beyond <= 8, "{sigma_px} px: {outcome:?}");
    }
}

#[test]
fn the_error_is_within_1_2_times_its_bound_and_its_covariance_is_true() {
    for (kind, circles) in [
        (Kind::General, 4),
        (Kind::General, 7),
        (Kind::General, 15),
        (Kind::General, 28),
        (Kind::Planar, 4),
        (Kind::Planar, 7),
        (Kind::Planar, 21),
    ] {
        let outcome = bound::run(kind, circles, 0.02, 1, 600);
        assert_eq!(outcome.lost, 0, "noise is no outlier");
        assert!(outcome.of_bound < 1.2 && outcome.worst < 1.2, "{circles}, {kind:?}: {outcome:?}");
        assert!(TRUE.contains(&outcome.squared), "{circles}, {kind:?}: {outcome:?}");
    }
}

#[test]
fn no_flip_of_a_plane_about_the_frontal_view_is_unmarked() {
    for sigma_px in [0.005, 0.02, 0.05, 0.1, 0.3] {
        let outcome = plane::run(sigma_px, 1.0, 11, 1500);
        assert_eq!(outcome.unmarked, 0, "{sigma_px} px: {outcome:?}");
        // At what the tracker reaches the right pose is kept, and few frames are marked.
        if sigma_px <= 0.02 {
            assert!(outcome.flips <= 3 && outcome.marked <= 45, "{sigma_px} px: {outcome:?}");
        }
    }
}

#[test]
fn a_rolling_shutter_leaves_no_more_than_the_noise_of_the_centres_at_walking_pace() {
    let still = shutter::run(0.0, 1.0, 1.0, 2, 150);
    for (line_time_us, allowed) in [(10.0, 1.25), (20.0, 2.5)] {
        let outcome = shutter::run(line_time_us, 5.0, 1.0, 2, 150);
        assert!(outcome.mm[0] > 1.0, "uncorrected it is millimetres: {outcome:?}");
        assert!(outcome.mm[1] < allowed * still.mm[1], "{line_time_us} us: {outcome:?}, still {still:?}");
        assert!(outcome.deg[1] < allowed * still.deg[1], "{line_time_us} us: {outcome:?}, still {still:?}");
    }
}

#[test]
fn a_rolling_shutter_leaves_a_covariance_that_is_true() {
    for (line_time_us, hz) in [(10.0, 0.5), (10.0, 2.0), (20.0, 1.0), (20.0, 2.0)] {
        let outcomes = [0, 1, 2].map(|seed| shutter::run(line_time_us, 5.0, hz, seed, 400).squared);
        let mean = outcomes.iter().sum::<f64>() / 3.0;
        assert!(TRUE.contains(&mean), "{line_time_us} us, {hz} Hz: {outcomes:?}");
    }
}

#[test]
fn the_exposures_own_smear_is_taken_off() {
    let outcome = shutter::run(0.0, 5.0, 2.0, 2, 200);
    // a T^2 / 24 is 0.013 mm where the sway turns: more than the noise, and visible in the mean.
    assert!(outcome.mm[0] > 1.15 * outcome.mm[1], "{outcome:?}");
    assert!(outcome.squared < 6.0 * 1.2, "{outcome:?}");
}

#[test]
fn what_is_left_of_the_exposures_smear_is_in_the_covariance() {
    for hz in [2.0, 4.0, 6.5] {
        let outcomes = [0, 1, 2].map(|seed| shutter::run(0.0, 10.0, hz, seed, 400));
        let mean = outcomes.iter().map(|outcome| outcome.squared).sum::<f64>() / 3.0;
        assert!(TRUE.contains(&mean), "{hz} Hz: {outcomes:?}");
        // What could only be foretold too late stays.
        assert!(outcomes.iter().all(|outcome| outcome.mm[1] < 0.75 * outcome.mm[0]), "{hz} Hz: {outcomes:?}");
    }
}

#[test]
fn a_cold_start_by_auto_finds_the_best_pose_wherever_dlt_or_epnp_does() {
    for kind in Kind::ALL {
        for circles in [4, 5, 6, 7, 15, 16, 28] {
            let all = methods::run(kind, circles, 0.1, &[Method::Dlt, Method::Epnp, Method::Auto], 4, 60);
            let [dlt, epnp, auto] = all[..] else { panic!("three methods") };
            assert_eq!(auto.refused, 0, "{kind:?}, {circles}");
            assert!(
                auto.worse <= dlt.worse.max(epnp.worse) && auto.worse <= 1,
                "{kind:?}, {circles}: {all:?}"
            );
        }
    }
}

#[test]
fn where_centres_scatter_more_than_they_say_the_pose_says_so_too() {
    for kind in [Kind::General, Kind::Planar] {
        for circles in [7, 15, 28] {
            let white = scatter::run(kind, circles, 1.0, 1, 600);
            assert!(TRUE.contains(&white), "{circles}, {kind:?}: {white} where nothing is to be scaled");
            // 150 unscaled. The factor is an estimate: with eight degrees of freedom its mean has a long
            // tail.
            let scaled = scatter::run(kind, circles, 5.0, 1, 600);
            assert!((4.5..8.0).contains(&scaled), "{circles}, {kind:?}: {scaled}");
            // Between, eight degrees of freedom cannot tell a factor of two from chance every time; what is
            // left of 24 is 7.9 by the mean over the factor's distribution, by decision it would be 10.7.
            let doubled = scatter::run(kind, circles, 2.0, 1, 600);
            assert!(doubled < 9.0, "{circles}, {kind:?}: {doubled}");
        }
    }
}
