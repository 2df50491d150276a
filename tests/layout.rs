//! A layout that was measured with a tape: the rest interval shows where the circles truly are, so that all
//! of them count, and the motion does not depend on which of them show.

use e2e::Ride;
use gangway_scene::Scene;
use gangway_wire::{LostReason, Motion, Record, What};

/// Printing, and mounting with a tape and a water level: standard deviations, as in the experiments.
const MOUNTED: &str = "
[tolerance]
print_mm = 0.1
print_scale_percent = 0.05
mounting_mm = 1.0
mounting_deg = 0.2
";

const FRAMES: u32 = 90;
/// The rest pose is that of the first ten frames.
const MEASURED: usize = 81;

/// The ride, in which targets come and go, with targets that are not quite where its setup says.
fn mounted(seed: u64) -> Ride {
    let text = format!("{}{MOUNTED}", include_str!("../host-tools/scene/scenes/ride.toml"));
    Ride::of(&Scene::parse(&text, "ride.toml").unwrap().with_frames(FRAMES).with_seed(seed))
}

/// The motions with the numbers of their frames, and how many circles were seen and left out of a pose.
fn play(ride: &Ride) -> (Vec<(usize, Motion)>, u32) {
    let (mut motions, mut left_out) = (Vec::new(), 0);
    let mut frame_loop = ride.start();
    for frame in 0..ride.frames.len() {
        frame_loop.step(frame, frame as u32, |record| match record {
            Record::Pose(pose) => motions.extend(pose.motion.map(|motion| (frame, motion))),
            Record::Event(event) => {
                let is_left_out = matches!(event.what, What::MarkerLost { reason: LostReason::Residual, .. });
                left_out += u32::from(is_left_out);
            }
            _ => {}
        });
    }
    (motions, left_out)
}

/// The largest error of any motion: mm, degrees, and in its own standard deviations.
fn worst(ride: &Ride, motions: &[(usize, Motion)]) -> [f64; 3] {
    let mut worst = [0.0_f64; 3];
    for (frame, motion) in motions {
        let truth = &ride.truth[*frame];
        let measured = [motion.displacement_mm, motion.rotation_deg].concat();
        let truth = [truth.displacement_mm, truth.rotation_deg].concat();
        for (i, (measured, truth)) in measured.iter().zip(truth).enumerate() {
            let off = (f64::from(*measured) - truth).abs();
            worst[i / 3] = worst[i / 3].max(off);
            worst[2] = worst[2].max(off / f64::from(motion.sigma[i]));
        }
    }
    worst
}

#[test]
fn targets_that_are_a_millimetre_off_all_count_and_the_motion_hardly_feels_it() {
    for seed in [1, 2, 7] {
        let ride = mounted(seed);
        let (motions, left_out) = play(&ride);
        assert_eq!((motions.len(), left_out), (MEASURED, 0), "seed {seed}");
        // What stays is how far off they are along the line of sight, times how far that turns: a millimetre
        // times a fifth. Without the survey it is up to 2.9 mm and 0.6 degrees, of eight seeds.
        let [mm, degrees, sigmas] = worst(&ride, &motions);
        assert!(mm < 0.6 && degrees < 0.03, "seed {seed}: {mm} mm, {degrees} degrees");
        // Of some 500 numbers; they share the layout, so that all may be off together.
        assert!(sigmas < 6.0, "seed {seed}: {sigmas} standard deviations");
    }
}

#[test]
fn a_layout_said_to_be_exact_is_taken_at_its_word() {
    let mut ride = mounted(1);
    ride.settings.rest.layout_mm = 0.0;
    let (_, left_out) = play(&ride);
    assert!(left_out > 0, "what lies a pixel off is then wrong");
}
