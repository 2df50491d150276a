//! Microseconds a pose at 5, 15, 19 and 28 circles: cold by the default method, cold by EPnP, and warm from
//! the last pose; each with refinement, gating and covariance.

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use gangway_pose::{Method, Observation, Pose, Settings, solve};

#[path = "../tests/scenes/mod.rs"]
mod scenes;

/// Fixed errors of about 0.02 px, so that the residual is that of a real picture.
fn with_errors(mut observations: Vec<Observation>) -> Vec<Observation> {
    let mut state = 1_u32;
    for observation in &mut observations {
        for coordinate in &mut observation.centre.at {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            *coordinate += (f64::from(state >> 8) / f64::from(1_u32 << 24) - 0.5) * 0.07;
        }
    }
    observations
}

fn cases() -> [(&'static str, Vec<Observation>, Pose, gangway_pose::Lens); 5] {
    let (rig, ride) = (scenes::rig(), scenes::ride());
    let motion = ([12.0, -40.0, 15.0], [0.4, -0.3, 1.2]);
    // One frame earlier: the centres move by up to 26 px.
    let before = ([10.0, -15.0, 10.0], [0.3, -0.2, 0.7]);
    let case = |name, scene: scenes::Scene, chosen: &[usize]| {
        let observed = scene.observe(chosen, &scene.pose(motion.0, motion.1), 0.02);
        let prior = scene.pose(before.0, before.1);
        (name, with_errors(observed), prior, scene.lens)
    };
    let fifteen: Vec<usize> = (0..5).chain(5..10).chain(12..17).collect();
    let ride_all: Vec<usize> = (0..19).collect();
    let rig_all: Vec<usize> = (0..28).collect();
    [
        case("5 (plane)", scenes::ride(), &[0, 1, 2, 3, 4]),
        case("15", scenes::ride(), &fifteen),
        case("19", ride, &ride_all),
        case("21 (plane)", scenes::rig(), &rig_all[..21]),
        case("28", rig, &rig_all),
    ]
}

fn pose(criterion: &mut Criterion) {
    let auto = Settings::default();
    let epnp = Settings { method: Method::Epnp, ..auto };
    for (name, settings, warm) in [("cold", auto, false), ("cold EPnP", epnp, false), ("warm", auto, true)] {
        let mut group = criterion.benchmark_group(name);
        for (circles, observations, prior, lens) in &cases() {
            let prior = warm.then_some(prior);
            assert!(solve(observations, lens, &settings, prior).is_ok(), "{name} {circles}");
            group.bench_function(BenchmarkId::from_parameter(circles), |b| {
                b.iter(|| solve(black_box(observations), black_box(lens), &settings, black_box(prior)));
            });
        }
        group.finish();
    }
}

/// What a frame costs at worst: a third of the circles wrong.
fn pose_among_wrong_circles(criterion: &mut Criterion) {
    let settings = Settings::default();
    let mut group = criterion.benchmark_group("30 % wrong");
    for (circles, mut observations, prior, lens) in cases().into_iter().skip(1) {
        let wrong = observations.len() * 3 / 10;
        for (observation, i) in observations.iter_mut().zip(0..wrong) {
            observation.centre.at[i % 2] += 40.0 + 9.0 * i as f64;
        }
        for (start, prior) in [("cold", None), ("warm", Some(&prior))] {
            assert!(solve(&observations, &lens, &settings, prior).is_ok(), "{start} {circles}");
            group.bench_function(BenchmarkId::new(start, circles), |b| {
                b.iter(|| solve(black_box(&observations), black_box(&lens), &settings, black_box(prior)));
            });
        }
    }
    group.finish();
}

criterion_group!(benches, pose, pose_among_wrong_circles);
criterion_main!(benches);
