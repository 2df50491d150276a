//! The camera's own carbody: with reference targets on it the motion is that of the one carbody against the
//! other, however the camera is knocked or shaken; without them a moved camera is told where it can be.

use e2e::{Keeping, Ride, sigmas_off};
use gangway_scene::Scene;
use gangway_wire::{Motion, MoveEvidence, PoseFlags, Record, What};

/// Most stated standard deviations that any of some 80 frames times 6 degrees of freedom may be off. Normal
/// errors stay below 4.5; the rest pose's own part is common to all frames.
const BOUND_SIGMAS: f64 = 6.0;
/// Frame of the knocks of these scenes, at 0.85 s.
const KNOCKED: usize = 43;

/// What came of a ride: motion and flags of every frame, and the events about the camera.
struct Played {
    ride: Ride,
    poses: Vec<(PoseFlags, Option<Motion>)>,
    events: Vec<(u32, What<'static>)>,
}

fn play(scene: &Scene) -> Played {
    let ride = Ride::of(scene);
    let (mut poses, mut events) = (Vec::new(), Vec::new());
    let mut frame_loop = ride.start();
    for frame in 0..ride.frames.len() {
        frame_loop.step(frame, frame as u32, |record| match record {
            Record::Pose(pose) => poses.push((pose.flags, pose.motion)),
            Record::Event(event) => match event.what {
                What::CameraMoved { evidence, shift_mm, turn_deg } => {
                    events.push((event.frame, What::CameraMoved { evidence, shift_mm, turn_deg }));
                }
                What::CameraShaking { shift_mm, turn_deg } => {
                    events.push((event.frame, What::CameraShaking { shift_mm, turn_deg }));
                }
                _ => {}
            },
            _ => {}
        });
    }
    drop(frame_loop);
    Played { ride, poses, events }
}

fn play_named(name: &str) -> Played {
    play(&Keeping::named(name).scene(7))
}

impl Played {
    /// The largest error of all frames in its own standard deviations.
    fn worst(&self) -> f64 {
        let frames = self.poses.iter().zip(&self.ride.truth);
        let errors = frames.filter_map(|((_, motion), truth)| Some(sigmas_off(motion.as_ref()?, truth)));
        errors.flatten().fold(0.0, f64::max)
    }

    fn measured(&self) -> usize {
        self.poses.iter().filter(|(_, motion)| motion.is_some()).count()
    }

    #[track_caller]
    fn assert_unchanged(&self) {
        assert!(self.worst() < BOUND_SIGMAS, "{} standard deviations off", self.worst());
        // Rest takes ten frames, once both carbodies are found.
        assert!(self.measured() >= self.poses.len() - 14, "{} frames measured", self.measured());
        let after_rest = self.poses.iter().filter(|(_, motion)| motion.is_some());
        let flags = after_rest.fold(0, |all, (flags, _)| all | flags.0);
        assert_eq!(flags, 0, "nothing to be marked");
    }
}

#[test]
fn a_knocked_camera_with_reference_targets_measures_on_and_tells_the_knock() {
    let played = play_named("knock");
    played.assert_unchanged();
    let [(frame, What::CameraMoved { evidence, shift_mm, turn_deg })] = played.events[..] else {
        panic!("one event: {:?}", played.events)
    };
    assert_eq!((frame as usize, evidence), (KNOCKED + 2, MoveEvidence::References));
    // 1.2 and 1.6 mm; 0.1, 0.2 and 0.2 degrees. As well as the reference targets tell: 0.04 mm, 0.003
    // degrees.
    assert!(
        (shift_mm - 2.0).abs() < 0.2 && (turn_deg - 0.3).abs() < 0.015,
        "{shift_mm} mm, {turn_deg} degrees"
    );
}

#[test]
fn a_shaking_camera_with_reference_targets_finds_its_rest_measures_on_and_tells_the_shake() {
    let played = play_named("shake");
    played.assert_unchanged();
    let [(_, What::CameraShaking { shift_mm, turn_deg })] = played.events[..] else {
        panic!("one event: {:?}", played.events)
    };
    // Amplitudes of 0.73 mm and 0.15 degrees, over the root of two.
    assert!((shift_mm - 0.52).abs() < 0.05 && (turn_deg - 0.106).abs() < 0.01, "{shift_mm} mm, {turn_deg}");
}

#[test]
fn hidden_reference_targets_are_marked_and_the_motion_goes_on_against_where_they_were() {
    let mut keeping = Keeping::named("references");
    // Somebody's back before the reference targets, from 0.9 to 1.4 s: they are all in the upper half, or
    // below.
    keeping.extend(
        "
        [[occluder]]
        size_px = [800.0, 110.0]
        path = [[0.9, 400.0, 55.0], [1.4, 400.0, 55.0]]
        [[occluder]]
        size_px = [160.0, 140.0]
        path = [[0.9, 400.0, 400.0], [1.4, 400.0, 400.0]]
        ",
    );
    let played = play(&keeping.scene(7));
    let marked = |frame: usize| played.poses[frame].0.contains(PoseFlags::UNREFERENCED);
    assert!((50..70).all(marked) && !(20..45).any(marked) && !(73..90).any(marked));
    assert!((20..90).all(|frame| played.poses[frame].1.is_some()), "with a motion all the time");
    assert!(played.worst() < BOUND_SIGMAS, "{} standard deviations off", played.worst());
    assert!(played.events.is_empty(), "{:?}", played.events);
}

#[test]
fn a_knock_without_reference_targets_is_told_and_every_frame_from_then_on_is_marked() {
    let played = play_named("knock-alone");
    let [(frame, What::CameraMoved { evidence, turn_deg, .. })] = played.events[..] else {
        panic!("one event: {:?}", played.events)
    };
    assert_eq!((frame as usize, evidence), (KNOCKED, MoveEvidence::Shock));
    assert!((turn_deg - 0.3).abs() < 0.15, "{turn_deg} degrees, the train's own turn within a frame in it");
    let marked: Vec<bool> =
        played.poses.iter().map(|(flags, _)| flags.contains(PoseFlags::CAMERA_MOVED)).collect();
    assert!(
        marked[KNOCKED..].iter().all(|marked| *marked) && !marked[..KNOCKED].iter().any(|marked| *marked)
    );
    assert!(played.worst() > 100.0, "what the camera did is in the motion: that is why it is marked");
}

#[test]
fn no_ride_of_a_train_alone_raises_a_suspicion() {
    for name in ["plain", "fast"] {
        let played = play_named(name);
        assert!(played.events.is_empty(), "{name}: {:?}", played.events);
        assert!(!played.poses.iter().any(|(flags, _)| flags.contains(PoseFlags::CAMERA_MOVED)));
    }
}

#[test]
fn a_camera_that_was_turned_slowly_is_told_when_the_train_stands_again() {
    let mut keeping = Keeping::named("plain");
    keeping.still();
    keeping.extend("[[knock]]\nat_s = 0.5\ntakes_s = 0.4\nturn_deg = [0.0, 0.0, 0.5]\n");
    let played = play(&keeping.scene(7));
    let [(frame, What::CameraMoved { evidence, turn_deg, .. })] = played.events[..] else {
        panic!("one event: {:?}", played.events)
    };
    assert_eq!(evidence, MoveEvidence::Standing);
    assert!((45..60).contains(&frame) && (turn_deg - 0.5).abs() < 0.05, "frame {frame}: {turn_deg}");
    assert!(played.poses[60..].iter().all(|(flags, _)| flags.contains(PoseFlags::CAMERA_MOVED)));
}
