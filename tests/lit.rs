//! Lit targets: measured by their own light, whatever drives it, and driven by the loop between the exposures
//! of a camera that runs freely.

use std::cell::{Cell, RefCell};
use std::convert::Infallible;

use e2e::{Ride, sigmas_off};
use embedded_hal::digital::{ErrorType, OutputPin};
use gangway_device::{Camera, CameraErrorKind, Clock, Frame, Layout};
use gangway_engine::LampMode;
use gangway_scene::Scene;
use gangway_wire::{Pose, PoseFlags, Record};

const BASE: &str = include_str!("scenes/lit.toml");
const TUNNEL: &str = "
[[light.fall]]
start_s = 0.5
fall_s = 0.1
level = 0.0
end_s = 0.9
rise_s = 0.1
";

fn scene(added: &str) -> Scene {
    Scene::parse(&format!("{BASE}{added}"), "lit.toml").expect("the scene is right")
}

/// The pose of every frame of a recording.
fn poses(scene: &Scene, mode: LampMode) -> Vec<Pose> {
    let mut ride = Ride::of(scene);
    ride.settings.lamps = mode;
    let mut frame_loop = ride.start();
    let mut poses = Vec::new();
    for frame in 0..ride.frames.len() {
        frame_loop.step(frame, frame as u32, |record| {
            if let Record::Pose(pose) = record {
                poses.push(*pose);
            }
        });
    }
    poses
}

/// Mean squared error of all motions over their stated variances: 1 if they are true.
fn normalised(scene: &Scene, poses: &[Pose]) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for pose in poses {
        let Some(motion) = pose.motion else { continue };
        for off in sigmas_off(&motion, &scene.truth(pose.frame)) {
            sum += off * off;
            count += 1.0;
        }
    }
    sum / count
}

/// The rest pose's own error is common to a whole ride: one ride's mean square lies within this of 1 by far
/// most often.
const TRUE: std::ops::Range<f64> = 0.3..2.5;

#[test]
fn lamps_that_are_on_carry_the_pose_through_a_tunnel_without_a_gap_and_without_seeds() {
    let scene = scene(&format!("{TUNNEL}[setup]\nseeds = false\n"));
    let poses = poses(&scene, LampMode::On);
    let first = poses.iter().position(|pose| pose.markers > 0).unwrap();
    assert!(first < 3, "found in frame {first}");
    assert!(poses[first..].iter().all(|pose| pose.markers == 15), "{poses:?}");
    assert!(poses[first + 12..].iter().all(|pose| pose.motion.is_some()));
    assert!(poses.iter().all(|pose| !pose.flags.contains(PoseFlags::DARK)));
    let normalised = normalised(&scene, &poses);
    assert!(TRUE.contains(&normalised), "{normalised}");
}

#[test]
fn alternate_lamps_give_poses_in_lit_frames_and_mark_the_dark_ones() {
    for (starts_dark, light) in [(false, TUNNEL), (true, TUNNEL), (false, ""), (true, "")] {
        let scene = scene(&format!("{light}[lamp]\ndrive = \"alternate\"\nstarts_dark = {starts_dark}\n"));
        let poses = poses(&scene, LampMode::Alternate);
        // Until a lit frame was seen, dark discs in daylight are as bright as any that are known.
        for pose in &poses[2..] {
            let is_lit = (pose.frame % 2 == 0) != starts_dark;
            assert_eq!(pose.markers > 0, is_lit, "{pose:?}");
            assert_eq!(pose.flags.contains(PoseFlags::DARK), !is_lit, "{pose:?}");
            assert!(!pose.flags.contains(PoseFlags::SWITCHED), "{pose:?}");
        }
        let normalised = normalised(&scene, &poses);
        assert!(TRUE.contains(&normalised), "{normalised}");
    }
}

#[test]
fn alternate_lamps_are_found_in_a_tunnel_without_seeds() {
    for starts_dark in [false, true] {
        let drive = format!("[lamp]\ndrive = \"alternate\"\nstarts_dark = {starts_dark}\n");
        let poses = poses(&scene(&format!("{TUNNEL}{drive}[setup]\nseeds = false\n")), LampMode::Alternate);
        let first = poses.iter().position(|pose| pose.markers > 0).expect("they are found");
        // Every row is looked at in a lit frame and in a dark one.
        assert!(first <= 8, "found in frame {first}");
        let lit = poses[first..].iter().filter(|pose| (pose.frame % 2 == 0) != starts_dark);
        assert!(lit.clone().count() > 20 && lit.clone().all(|pose| pose.markers == 15), "{poses:?}");
    }
}

#[test]
fn alternate_lamps_are_found_in_the_first_lit_frame_where_darkness_is_swept_whole() {
    let night = TUNNEL.replace("start_s = 0.5", "start_s = 0.0").replace("fall_s = 0.1", "fall_s = 0.0");
    for starts_dark in [false, true] {
        let drive = format!("[lamp]\ndrive = \"alternate\"\nstarts_dark = {starts_dark}\n");
        let poses = poses(&scene(&format!("{night}{drive}[setup]\nseeds = false\n")), LampMode::Alternate);
        let first = poses.iter().position(|pose| pose.markers > 0).expect("they are found");
        assert_eq!(first, usize::from(starts_dark), "the frame they are found in");
        assert_eq!(poses[first].markers, 15);
    }
}

#[test]
fn a_frame_switched_within_its_exposure_is_marked_and_gives_no_pose() {
    // Off in the middle of frame 20's exposure, on again in that of frame 30.
    let scene = scene("[lamp]\nswitches_s = [0.4, 0.6]\n");
    let poses = poses(&scene, LampMode::On);
    for pose in &poses[15..] {
        let marks = [PoseFlags::DARK, PoseFlags::SWITCHED].map(|mark| pose.flags.contains(mark));
        match pose.frame {
            20 => assert_eq!(marks, [false, true], "{pose:?}"),
            21..30 => assert_eq!(marks, [true, false], "{pose:?}"),
            // Where the targets were lost meanwhile, no window says more than that nothing shines as it
            // should.
            30 => assert!(marks[0] || marks[1], "{pose:?}"),
            // Until they are found again nobody has seen that they shine.
            31..34 if pose.markers == 0 => assert!(!marks[1], "{pose:?}"),
            _ => assert_eq!(marks, [false, false], "{pose:?}"),
        }
        assert!(pose.motion.is_none() || !(20..=30).contains(&pose.frame), "{pose:?}");
        // Found again within three frames.
        assert!(pose.motion.is_some() || (20..34).contains(&pose.frame), "{pose:?}");
    }
}

const PERIOD_NS: u64 = 20_000_000;
const EXPOSURE_NS: u64 = 8_000_000;
/// From the end of an exposure to the frame's arrival.
const READOUT_NS: u64 = 11_000_000;

/// Time as it goes on in a test, and when the lamp was switched over.
#[derive(Default)]
struct World {
    now_ns: Cell<u64>,
    switches: RefCell<Vec<(u64, bool)>>,
}

impl World {
    /// Share of an exposure in which the lamp shone.
    fn lit_share(&self, from: u64, to: u64) -> f64 {
        let switches = self.switches.borrow();
        let (mut lit, mut since, mut sum) = (false, from, 0);
        for (at, state) in switches.iter() {
            let at = (*at).clamp(from, to);
            sum += if lit { at - since } else { 0 };
            (lit, since) = (*state, at);
        }
        sum += if lit { to - since } else { 0 };
        sum as f64 / (to - from) as f64
    }
}

impl Clock for &World {
    /// Goes on while it is read, as every clock does.
    fn now_ns(&self) -> u64 {
        let now_ns = self.now_ns.get();
        self.now_ns.set(now_ns + 300);
        now_ns
    }
    fn utc_offset_ns(&self) -> Option<(i64, u64)> {
        None
    }
    fn wait_until_ns(&self, time_ns: u64) {
        self.now_ns.set(self.now_ns.get().max(time_ns));
    }
}

struct WorldLamp<'w>(&'w World);

impl ErrorType for WorldLamp<'_> {
    type Error = Infallible;
}

impl OutputPin for WorldLamp<'_> {
    fn set_low(&mut self) -> Result<(), Infallible> {
        self.0.switches.borrow_mut().push((self.0.now_ns.get(), false));
        Ok(())
    }
    fn set_high(&mut self) -> Result<(), Infallible> {
        self.0.switches.borrow_mut().push((self.0.now_ns.get(), true));
        Ok(())
    }
}

/// A camera that runs freely and sees the lamp.
struct Watching<'w> {
    world: &'w World,
    lit: &'w Ride,
    dark: &'w Ride,
    next: u32,
    picture: Vec<u8>,
    shares: Vec<f64>,
}

impl Camera for Watching<'_> {
    type Error = CameraErrorKind;

    fn next_frame(&mut self) -> Result<Frame<'_>, CameraErrorKind> {
        let number = self.next;
        self.next += 1;
        let (lit, dark) = (self.lit.frames.get(number as usize), self.dark.frames.get(number as usize));
        let (Some(lit), Some(dark)) = (lit, dark) else { return Err(CameraErrorKind::Ended) };
        let middle = (u64::from(number) + 1) * PERIOD_NS;
        let (from, to) = (middle - EXPOSURE_NS / 2, middle + EXPOSURE_NS / 2);
        assert!(self.world.now_ns.get() <= to + READOUT_NS, "frame {number}: the loop held up the camera");
        self.world.now_ns.set(to + READOUT_NS);
        let share = self.world.lit_share(from, to);
        self.shares.push(share);
        let mix = |(lit, dark): (&u8, &u8)| {
            (share * f64::from(*lit) + (1.0 - share) * f64::from(*dark)).round() as u8
        };
        self.picture = lit.iter().zip(dark).map(mix).collect();
        let size = self.lit.settings.picture;
        Frame::new(&self.picture, size, usize::from(size.0), Layout::GREY, number, middle)
            .map_err(|_| CameraErrorKind::Corrupt)
    }
}

/// Poses of the loop with a camera that sees its lamp, and the share of each frame's exposure in which the
/// lamp shone.
fn closed_loop(mode: LampMode) -> (Vec<Pose>, Vec<f64>) {
    let ride = |drive: &str| {
        let mut ride = Ride::of(&scene(&format!("{TUNNEL}[lamp]\ndrive = \"{drive}\"\n")));
        ride.settings.lamps = mode;
        ride.settings.shutter.exposure_s = EXPOSURE_NS as f64 / 1e9;
        ride
    };
    let (lit, dark) = (ride("on"), ride("off"));
    let world = World::default();
    let mut camera =
        Watching { world: &world, lit: &lit, dark: &dark, next: 0, picture: Vec::new(), shares: Vec::new() };
    let mut frame_loop = lit.start();
    let (mut lamp, mut poses) = (WorldLamp(&world), Vec::new());
    for _ in 0..lit.frames.len() {
        frame_loop.step_on(&mut camera, &&world, &mut lamp);
        frame_loop.read(|_, _, record| {
            if let Record::Pose(pose) = record {
                poses.push(*pose);
            }
        });
    }
    (poses, camera.shares)
}

#[test]
fn the_loop_switches_lamps_between_exposures_only_and_measures_what_came_of_it() {
    let (poses, shares) = closed_loop(LampMode::Alternate);
    // When a frame arrives, the next one is being exposed: the first switch tells in the one after.
    assert!(shares.iter().all(|share| *share == 0.0 || *share == 1.0), "{shares:?}");
    let lit: Vec<bool> = shares.iter().map(|share| *share == 1.0).collect();
    assert!(lit[2..].windows(2).all(|pair| pair[0] != pair[1]), "every other frame: {lit:?}");
    for (pose, lit) in poses.iter().zip(&lit).skip(3) {
        assert_eq!((pose.markers > 0, pose.flags.contains(PoseFlags::DARK)), (*lit, !*lit), "{pose:?}");
    }
    let (poses, shares) = closed_loop(LampMode::On);
    assert!(shares[2..].iter().all(|share| *share == 1.0));
    assert!(poses[3..].iter().all(|pose| pose.markers == 15), "through the tunnel: {poses:?}");
    let (poses, shares) = closed_loop(LampMode::Off);
    assert!(shares.iter().all(|share| *share == 0.0));
    assert!(poses[35..40].iter().all(|pose| pose.markers == 0), "nothing is to be seen in the dark");
}
