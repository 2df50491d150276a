//! Rides with a recorder of its own rate and clock, made up with known offsets.

use gangway_wire::PoseFlags;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

use super::{Alignment, Recorder, synchronise};
use crate::{Measured, ReportError, Sample};

/// What a simulated pair of recordings is like.
#[derive(Clone, Copy)]
struct Pair {
    frames: u32,
    recorder_hz: f64,
    /// Box time less recorder time in the middle of the frames, s.
    offset: f64,
    drift: f64,
    /// Recorder's noise, mm and degrees.
    noise: [f64; 2],
    /// Seconds of rest at the beginning.
    rest: f64,
    /// What the box measures is larger by this share, and turned by this angle (radians) about z.
    systematic: [f64; 2],
    /// Amplitude with which x follows y a quarter of a turn later, mm: then a misaligned frame looks like
    /// time.
    swing: f64,
}

const USUAL: Pair = Pair {
    frames: 500,
    recorder_hz: 50.0,
    offset: 3.2071,
    drift: 60e-6,
    noise: [0.3, 0.02],
    rest: 0.6,
    systematic: [0.0, 0.0],
    swing: 0.0,
};

/// Swaying that fades in after rest.
fn motion(t: f64, pair: &Pair) -> [f64; 6] {
    let t = t - pair.rest;
    if t <= 0.0 {
        return [0.0; 6];
    }
    let fade = (t / 0.5).min(1.0);
    let sway = |amplitude: f64, hz: f64| fade * amplitude * (std::f64::consts::TAU * hz * t).sin();
    [
        sway(6.0, 0.9) + fade * pair.swing * (std::f64::consts::TAU * 0.7 * t).cos(),
        sway(55.0, 0.7) + sway(0.8, 5.0),
        sway(6.0, 1.9),
        sway(0.5, 1.3),
        sway(0.25, 2.3),
        sway(2.2, 0.53),
    ]
}

const FIRST_FRAME_NS: u64 = 123_456_789_000;
const RECORDER_CLOCK: f64 = 1_700_000_000.0;

fn simulate(pair: &Pair, seed: u64) -> (Vec<Sample>, Recorder) {
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    let mut normal = |sigma: f64| -> f64 {
        let value: f64 = StandardNormal.sample(&mut random);
        sigma * value
    };
    let [scale, turn] = pair.systematic;
    let sample = |frame: u32, normal: &mut dyn FnMut(f64) -> f64| {
        let truth = motion(f64::from(frame) / 50.0, pair);
        let mut values: [f64; 6] = std::array::from_fn(|k| truth[k] * (1.0 + scale));
        values[0] += turn * truth[1];
        values[1] -= turn * truth[0];
        let sigmas = [0.02, 0.02, 0.006, 0.0005, 0.001, 0.003];
        let values = std::array::from_fn(|k| values[k] + normal(sigmas[k]));
        let waiting = frame < 10;
        Sample {
            frame,
            time_ns: FIRST_FRAME_NS + u64::from(frame) * 20_000_000,
            measured: (!waiting).then_some(Measured { values, sigmas, residual_px: 0.03 }),
            markers: 19,
            flags: if waiting { PoseFlags::WAITING } else { PoseFlags::default() },
        }
    };
    let samples: Vec<Sample> = (0..pair.frames).map(|frame| sample(frame, &mut normal)).collect();
    // Frames 10 to the last have a pose; the middle of them is where the offset is told.
    let middle = 0.5 * (10.0 + f64::from(pair.frames - 1)) / 50.0;
    let seconds = f64::from(pair.frames) / 50.0 + 2.0;
    let rows = (0..(seconds * pair.recorder_hz) as u32).map(|i| {
        let s = f64::from(i) / pair.recorder_hz;
        // s = t - offset - drift (t - middle)
        let t = (s + pair.offset - pair.drift * middle) / (1.0 - pair.drift);
        let truth = motion(t, pair);
        (RECORDER_CLOCK + s, std::array::from_fn(|k| truth[k] + normal(pair.noise[k / 3])))
    });
    let rows: Vec<(f64, [f64; 6])> = rows.collect();
    (samples, Recorder::new("recorder.csv", rows).unwrap())
}

fn aligned(pair: &Pair, seed: u64) -> Alignment {
    let (samples, recorder) = simulate(pair, seed);
    synchronise("ride", &samples, &recorder).unwrap().0
}

/// Means over 24 seeds of the squared errors of offset and drift, each over its stated variance.
fn normalised(pair: &Pair) -> [f64; 2] {
    const SEEDS: u64 = 24;
    let mut sums = [0.0; 2];
    for seed in 0..SEEDS {
        let found = aligned(pair, seed);
        sums[0] += ((found.offset_s - pair.offset) / found.offset_sigma_s).powi(2);
        sums[1] += ((found.drift_ppm - 1e6 * pair.drift) / found.drift_sigma_ppm).powi(2);
    }
    sums.map(|sum| sum / SEEDS as f64)
}

/// The mean of 24 squared normal numbers is below 0.34 or above 2.0 once in a thousand.
const TRUE_BAND: std::ops::Range<f64> = 0.34..2.0;

/// The drift's prior is a part of its stated uncertainty and not of a fixed true drift: it may be too
/// careful.
const DRIFT_BAND: std::ops::Range<f64> = 0.1..2.0;

#[test]
fn the_stated_uncertainty_is_true_at_any_rate_of_the_recorder() {
    for recorder_hz in [100.0, 50.0, 31.7] {
        // The offset in parts of the recorder's interval changes with the rate: none is drawn to a half
        // sample.
        let pair = Pair { recorder_hz, offset: -0.735 + 1.0 / recorder_hz * 0.31, ..USUAL };
        let [offset, drift] = normalised(&pair);
        assert!(TRUE_BAND.contains(&offset), "{recorder_hz} Hz: offset {offset}");
        assert!(DRIFT_BAND.contains(&drift), "{recorder_hz} Hz: drift {drift}");
    }
}

#[test]
fn a_scale_and_a_misaligned_frame_do_not_pass_for_time() {
    // Three parts in a thousand and 0.3 degrees, as from calibration and mounting; 2 x 20 x 55 x 0.005 /
    // (20^2 + 55^2) of a period's radian, 0.7 ms, would go into the offset, ten times its uncertainty.
    let pair = Pair { systematic: [0.003, 0.005], swing: 20.0, offset: -0.73, ..USUAL };
    let [offset, _] = normalised(&pair);
    assert!(TRUE_BAND.contains(&offset), "offset {offset}");
}

#[test]
fn a_perfect_recorder_is_met_to_a_few_microseconds() {
    let pair = Pair { noise: [0.0; 2], recorder_hz: 200.0, offset: -0.73, ..USUAL };
    let found = aligned(&pair, 1);
    // The box's own noise of 0.02 mm at 240 mm/s in 490 frames: 4 us; four of them.
    assert!((found.offset_s - pair.offset).abs() < 16e-6, "{found:?}");
    assert!(found.correlation > 0.9999 && found.rival_s.is_none(), "{found:?}");
    let [session, recorder] = found.starts_s.unwrap();
    // The start shows in both within a few samples.
    assert!((session - recorder - pair.offset).abs() < 0.1, "{found:?}");
}

#[test]
fn without_rest_the_correlation_alone_finds_the_offset() {
    let pair = Pair { rest: -5.0, offset: -1.3, ..USUAL };
    let found = aligned(&pair, 3);
    assert!((found.offset_s - pair.offset).abs() < 5.0 * found.offset_sigma_s, "{found:?}");
}

#[test]
fn frames_get_the_recorders_word_for_their_own_time() {
    let pair = Pair { noise: [0.0; 2], recorder_hz: 100.0, offset: -0.73, ..USUAL };
    let (samples, recorder) = simulate(&pair, 4);
    let (_, reference) = synchronise("ride", &samples, &recorder).unwrap();
    for frame in [60, 200, 480] {
        let truth = motion(f64::from(frame) / 50.0, &pair);
        let told = reference.at(frame).unwrap();
        // A spline at 100 Hz through 5 Hz of 0.8 mm: (w h)^4 / 384 = 3e-5; 4 us at 240 mm/s: 0.001 mm.
        assert!((told[1] - truth[1]).abs() < 5e-3, "{frame}: {} {}", told[1], truth[1]);
    }
}

#[test]
fn another_ride_and_a_ride_without_motion_are_refused_in_a_sentence() {
    let (samples, _) = simulate(&USUAL, 5);
    let rows = (0..600).map(|i| {
        let t = f64::from(i) / 50.0;
        (
            t,
            [
                3.0 * (9.1 * t).sin(),
                20.0 * (17.3 * t).cos(),
                9.0 * (11.7 * t).sin(),
                (8.0 * t).sin(),
                0.0,
                0.0,
            ],
        )
    });
    let other = Recorder::new("other.csv", rows).unwrap();
    let error = synchronise("ride", &samples, &other).unwrap_err().to_string();
    assert!(error.starts_with("ride cannot be aligned with other.csv"), "{error}");
    let still = Recorder::new("still.csv", (0..600).map(|i| (f64::from(i) / 50.0, [0.0; 6]))).unwrap();
    assert!(matches!(synchronise("ride", &samples, &still), Err(ReportError::NoAlignment { .. })));
    let error = synchronise("ride", &samples[..25], &other).unwrap_err().to_string();
    assert_eq!(error, "ride: 15 frames with a pose; 20 are the fewest that can be aligned with a recorder");
}

#[test]
fn a_recorders_file_is_read_in_any_unit_of_time_and_from_any_zero() {
    let text = |head: &str, time: &dyn Fn(u32) -> String| {
        let rows = (0..12)
            .map(|i| format!("{};{};0;0;0;0;{}\n", time(i), f64::from(i) * 0.5, i))
            .collect::<String>();
        format!("{head};X [mm];dy_mm;dz_mm;roll (°);pitch_deg;yaw_deg\n{rows}")
    };
    let nanoseconds = |i: u32| (1_764_000_000_000_000_000u64 + u64::from(i) * 31_546_000).to_string();
    let seconds = |i: u32| format!("{:.6}", f64::from(i) * 0.031546);
    for text in [text("time_ns", &nanoseconds), text("Time [s]", &seconds)] {
        let recorder = Recorder::parse(text.as_bytes(), "r.csv").unwrap();
        assert_eq!(recorder.track.times().len(), 12);
        assert!((recorder.track.times()[11] - 11.0 * 0.031546).abs() < 1e-9);
        assert_eq!(recorder.track.values()[3], [1.5, 0.0, 0.0, 0.0, 0.0, 3.0]);
    }
}

#[test]
fn a_mistake_in_a_recorders_file_is_one_sentence_with_its_place() {
    let head = "time_s,dx_mm,dy_mm,dz_mm,roll_deg,pitch_deg,yaw_deg\n";
    let rows: String = (0..12).map(|i| format!("{i},0,0,0,0,0,0\n")).collect();
    let error = |text: &str| Recorder::parse(text.as_bytes(), "r.csv").unwrap_err().to_string();
    assert!(error("").contains("r.csv"));
    assert!(
        error(&format!("frame{}", &head[6..]))
            .starts_with("r.csv, line 1: the column time_s or time_ms or time_us or time_ns is missing"),
    );
    assert!(
        error(&format!("{head}0,0,0,0,0,0,0\n0,0,0,0,0,0,0\n"))
            .contains("line 3, column time_s: the time is not after")
    );
    assert!(error(&format!("{head}soon,0,0,0,0,0,0\n")).contains("\"soon\" is not a time"));
    assert!(
        error(&format!("{head}{rows}12,0,0,one,0,0,0\n"))
            .contains("line 14, column dz_mm: \"one\" is not a number in mm")
    );
    assert!(error(&format!("{head}{rows}12,0,0,,0,0,0\n")).contains("the cell is empty"));
    assert!(error(&format!("{head}1,0,0,0,0,0,0\n")).contains("1 rows"));
    let garbage = error(&"\u{0}\u{1}garbage".repeat(1000));
    assert!(garbage.contains("is missing") && garbage.len() < 400 && !garbage.contains('\u{0}'), "{garbage}");
    assert!(error(&format!("{head}1e300,0,0,0,0,0,0\n")).contains("is not a time"));
    assert!(Recorder::parse(format!("{head}{rows}12,,,,,,\n").as_bytes(), "r.csv").is_ok());
}
