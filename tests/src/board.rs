//! A board without hardware or threads: frames from memory through the real frame loop, record by record.

use std::convert::Infallible;

use embedded_hal::digital::{ErrorType, OutputPin};
use gangway_device::{Camera, CameraErrorKind, Clock, Frame, Lamp, Layout, Reading};
use gangway_engine::{Board, Command, Engine, Identity, Inbox, Outbox, Settings, Step};
use gangway_scene::{Scene, Truth};
use gangway_setup::Setup;
use gangway_wire::{Decoded, Decoder, Record};
use rayon::prelude::*;

/// A rendered ride in memory.
pub struct Ride {
    /// What the box is told.
    pub settings: Settings,
    /// One picture a frame.
    pub frames: Vec<Vec<u8>>,
    /// The simulated motion of each frame.
    pub truth: Vec<Truth>,
}

impl Ride {
    /// The short scene of this folder.
    pub fn short() -> Self {
        Self::of(
            &Scene::parse(include_str!("../scenes/short.toml"), "short.toml").expect("the scene is right"),
        )
    }

    /// A scene, rendered on all cores.
    pub fn of(scene: &Scene) -> Self {
        let setup = Setup::parse(&scene.setup_text(), "setup.toml").expect("a scene's setup is right");
        let render = |frame: u32| {
            let mut samples = Vec::new();
            let truth = scene.render(frame, &mut samples);
            (samples, truth)
        };
        let (frames, truth) = (0..scene.frames()).into_par_iter().map(render).unzip();
        Self { settings: setup.settings(), frames, truth }
    }

    /// A loop at its start.
    pub fn start(&self) -> Loop<'_> {
        Loop {
            ride: self,
            engine: engine(&self.settings),
            outbox: Box::new(Outbox::new()),
            inbox: Box::new(Inbox::new()),
            decoder: Box::new(Decoder::new()),
            lamp: Pin::default(),
        }
    }
}

/// A frame loop. It is some hundred KiB large, and so is each copy of it while it is made: more than a test's
/// own thread has room for.
///
/// # Panics
/// Where the settings' seeds give no pose.
pub fn engine(settings: &Settings) -> Box<Engine> {
    try_engine(settings).expect("the seeds give a pose")
}

/// The same, or nothing where the settings' seeds give no pose.
///
/// # Panics
/// There is no thread to be had.
pub fn try_engine(settings: &Settings) -> Option<Box<Engine>> {
    let identity = Identity { box_id: 1, boot_id: 2, session_id: 3, firmware: "test" };
    let made = std::thread::scope(|scope| {
        let roomy = std::thread::Builder::new().stack_size(8 << 20);
        let make = || Engine::new(settings.clone(), identity).map(Box::new);
        roomy.spawn_scoped(scope, make).expect("a thread starts").join()
    });
    made.expect("it does not panic").ok()
}

/// The recording is over.
#[derive(Debug, PartialEq, Eq)]
pub struct Ended;

/// The frame loop with its two queues.
pub struct Loop<'r> {
    ride: &'r Ride,
    /// The loop itself.
    pub engine: Box<Engine>,
    outbox: Box<Outbox>,
    inbox: Box<Inbox>,
    decoder: Box<Decoder>,
    lamp: Pin,
}

impl Loop<'_> {
    /// Gives a command to the next step.
    pub fn command(&mut self, command: Command) {
        self.inbox.enqueue(command).expect("the inbox has room");
    }

    /// Goes on with another loop, whose setup may be another one.
    pub fn change(&mut self, mut next: Box<Engine>) {
        let (mut outbox, _) = self.outbox.split();
        next.succeed(&mut self.engine, &mut outbox);
        self.engine = next;
    }

    /// One step on picture `picture` as frame `number`; every record goes to `visit`.
    pub fn step(&mut self, picture: usize, number: u32, mut visit: impl FnMut(&Record<'_>)) -> Step {
        let step = self.step_without_reading(picture, number);
        self.read(|_, _, record| visit(record));
        step
    }

    /// One step whose records stay in the outbox.
    pub fn step_without_reading(&mut self, picture: usize, number: u32) -> Step {
        let bytes = self.ride.frames.get(picture).map(Vec::as_slice);
        let mut camera = Still { bytes, size: self.ride.settings.picture, number };
        self.step_with(&mut camera)
    }

    /// One step of any camera.
    pub fn step_with<C: Camera>(&mut self, camera: &mut C) -> Step {
        let mut lamp = core::mem::take(&mut self.lamp);
        let step = self.step_on(camera, &Ticks, &mut lamp);
        self.lamp = lamp;
        step
    }

    /// One step with any camera, clock and lamp.
    pub fn step_on<C: Camera, K: Clock, L: Lamp>(&mut self, camera: &mut C, clock: &K, lamp: &mut L) -> Step {
        let vitals = &mut Reading::default();
        let mut board = Board { camera, clock, vitals, lamps: core::slice::from_mut(lamp) };
        let (mut outbox, _) = self.outbox.split();
        let (_, mut inbox) = self.inbox.split();
        self.engine.step(&mut board, &mut inbox, &mut outbox)
    }

    /// Ends the session.
    pub fn end(&mut self) {
        let lamps = core::slice::from_mut(&mut self.lamp);
        let mut board = Board { camera: &mut (), clock: &Ticks, vitals: &mut Reading::default(), lamps };
        self.engine.end(&mut board, &mut self.outbox.split().0);
    }

    /// Takes what is in the outbox: sequence, body and record of each.
    pub fn read(&mut self, mut visit: impl FnMut(u32, &[u8], &Record<'_>)) {
        let (_, mut packets) = self.outbox.split();
        while let Some(packet) = packets.dequeue() {
            let mut bytes: &[u8] = &packet.bytes;
            while !bytes.is_empty() {
                let (decoded, rest) = self.decoder.feed(bytes);
                bytes = rest;
                match decoded {
                    Some(Decoded::Record { sequence, body, record, .. }) => visit(sequence, body, &record),
                    Some(other) => panic!("the loop made something unreadable: {other:?}"),
                    None => {}
                }
            }
        }
    }
}

/// A camera with one picture.
struct Still<'a> {
    bytes: Option<&'a [u8]>,
    size: (u16, u16),
    number: u32,
}

impl Camera for Still<'_> {
    type Error = CameraErrorKind;

    fn next_frame(&mut self) -> Result<Frame<'_>, CameraErrorKind> {
        let bytes = self.bytes.ok_or(CameraErrorKind::Ended)?;
        let time_ns = u64::from(self.number) * 20_000_000;
        Frame::new(bytes, self.size, usize::from(self.size.0), Layout::GREY, self.number, time_ns)
            .map_err(|_| CameraErrorKind::Corrupt)
    }
}

/// A clock that stands still: nothing of a test depends on how fast the machine is.
struct Ticks;

impl Clock for Ticks {
    fn now_ns(&self) -> u64 {
        0
    }

    fn utc_offset_ns(&self) -> Option<(i64, u64)> {
        Some((1_700_000_000_000_000_000, 1_000))
    }
}

/// A lamp that remembers.
#[derive(Default)]
struct Pin {
    lit: bool,
}

impl ErrorType for Pin {
    type Error = Infallible;
}

impl OutputPin for Pin {
    fn set_low(&mut self) -> Result<(), Infallible> {
        self.lit = false;
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        self.lit = true;
        Ok(())
    }
}
