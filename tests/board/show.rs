//! The short ride as a camera of the board shows it, and the box in front of that camera.

use e2e::Ride;
use e2e::guest::Guest;
use gangway_scene::Scene;

/// Frames a second that the emulation keeps up with on two cores, with room for a machine that does other
/// things.
pub(crate) const RATE_HZ: u32 = 4;

/// The short ride as raw pictures, with a setup of the emulation's rate.
pub(crate) struct Show {
    pub(crate) ride: Ride,
    pub(crate) setup: String,
    pub(crate) raw: Vec<u8>,
    pub(crate) bits: u8,
}

impl Show {
    pub(crate) fn new(more: &str) -> Self {
        Self::of_depth(8, more)
    }

    /// The ride by a sensor of so many bits; with more than 8 a sample takes two bytes, little-endian.
    pub(crate) fn of_depth(bits: u8, more: &str) -> Self {
        let scene =
            include_str!("../scenes/short.toml").replace("[sensor]", &format!("[sensor]\nbits = {bits}"));
        let scene = Scene::parse(&scene, "short.toml").expect("the scene is right");
        let ride = Ride::of(&scene);
        let setup = scene.setup_text().replace("rate_hz = 50.0", &format!("rate_hz = {RATE_HZ}.0"));
        assert!(setup.contains(&format!("rate_hz = {RATE_HZ}.0")), "{setup}");
        let raw = ride.frames.concat();
        Self { ride, setup: format!("{setup}\n{more}"), raw, bits }
    }

    pub(crate) fn boot(&self, job: &str) -> Guest {
        Guest::boot(job, &[("setup.toml", self.setup.as_bytes()), ("frames.raw", &self.raw)])
    }

    /// The picture that was fed under a number.
    pub(crate) fn picture(&self, number: u32, first: u32) -> &[u8] {
        let place = number.saturating_sub(first) as usize;
        &self.ride.frames[place.min(self.ride.frames.len() - 1)]
    }

    /// The setup of a camera of another size that shows no ride.
    pub(crate) fn setup_of_size(width_px: u32, height_px: u32) -> String {
        let mut setup = Self::new("").setup;
        for (from, to) in [
            ("width_px = 800", format!("width_px = {width_px}")),
            ("height_px = 450", format!("height_px = {height_px}")),
        ] {
            assert!(setup.contains(from));
            setup = setup.replace(from, &to);
        }
        setup
    }
}

/// A loop-back camera that shows the ride over and over; without the file /tmp/go its first picture only.
pub(crate) fn camera() -> String {
    format!(
        "insmod /modules/v4l2loopback.ko devices=1 video_nr=0 max_buffers=8
        feed /dev/video0 /frames.raw GREY 800 450 {RATE_HZ} /tmp/go &
        FEED=$!
        sleep 1
        "
    )
}

/// That camera, and the box in front of it. The job goes on line by line.
pub(crate) fn job(to: &str) -> String {
    camera()
        + &format!(
            "gangway-pi run --setup /setup.toml --to {to} --box-id 7 &
            BOX=$!
            "
        )
}

/// Lets the ride begin, and gives the number of its first frame.
pub(crate) fn begin(board: &mut Guest) -> u32 {
    board.go();
    let line = board.expect("fed from");
    line.rsplit(' ').next().and_then(|n| n.parse().ok()).expect("the number of the first frame")
}
