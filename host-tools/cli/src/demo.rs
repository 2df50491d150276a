//! `gangway demo`: a simulated ride through the box's own frame loop, over a real TCP socket, into a session
//! on disk, and out as a table against the truth and pictures.

use std::collections::VecDeque;
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Instant, SystemTime, UNIX_EPOCH};

use anyhow::{Context, bail};
use gangway_bench::link::TcpServer;
use gangway_bench::{FrameSource, Identity, Play, Shape, SourceError, Summary};
use gangway_report::{Page, Reference, Sample};
use gangway_scene::Scene;
use gangway_setup::Setup;
use gangway_store::{Address, Received, Receiver, Session, Until};
use indicatif::ProgressBar;
use rayon::prelude::*;

use crate::{simulate, tell};

/// Frames that are rendered at a time, on all cores.
const FRAMES_AT_ONCE: u32 = 8;

/// Arguments of `gangway demo`.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// The simulated scene: ride, rig, or a scene file.
    #[arg(default_value = "ride")]
    scene: String,
    /// Frames to simulate [default: as many as the scene says].
    #[arg(
        long, value_name = "N",
        value_parser = clap::value_parser!(u32).range(20..), allow_negative_numbers = true
    )]
    frames: Option<u32>,
    /// Folder for everything that comes of it.
    #[arg(long, default_value = "demo", value_name = "DIR")]
    out: PathBuf,
}

/// Runs `gangway demo`.
pub(crate) fn run(args: Args) -> anyhow::Result<()> {
    let began = Instant::now();
    let mut scene = simulate::named(&args.scene)?;
    if let Some(frames) = args.frames {
        scene = scene.with_frames(frames);
    }
    let scene = Arc::new(scene);
    let write = |name: &str, text: String| {
        let path = args.out.join(name);
        gangway_report::write_file(&path, text.as_bytes()).map(|()| path)
    };
    let setup_file = write("setup.toml", scene.setup_text())?;
    let truth_file = write("truth.csv", scene.truth_text())?;
    let setup = Setup::read(&setup_file)?;
    let reference = Reference::read(&truth_file)?;

    let (received, summary) = ride(&setup, &scene, &args.out.join("rides"))?;
    let (session, recovery) = Session::open(&received.folder)?;
    if !recovery.is_whole() {
        tell(&format!("{}: {recovery}", received.folder.display()));
    }
    let samples: Vec<Sample> = session.poses()?.iter().map(Sample::from).collect();
    let name = received.folder.display().to_string();
    let evaluation = gangway_report::evaluate(&name, &samples, Some(&reference))?;
    let mut out = io::stdout().lock();
    write!(out, "{}", evaluation.table())?;

    let pictures = args.out.join("evaluation");
    evaluation.write_all(&pictures)?;
    let page = Page {
        title: format!("Gangway: the simulated {}", scene.name()),
        about:
            "Every frame was rendered with noise, measured by the frame loop that runs on the box, sent over \
                a TCP socket, stored, and compared with the motion that was simulated."
                .to_owned(),
        made: vec![
            ("Frames".to_owned(), format!("{} at {} a second", scene.frames(), scene.rate_hz())),
            ("Frame loop".to_owned(), summary.to_string()),
            ("Received".to_owned(), received.tally.to_string()),
        ],
        files: vec![
            ("setup.toml".to_owned(), "what the box was told".to_owned()),
            ("truth.csv".to_owned(), "the simulated motion".to_owned()),
            (relative(&received.folder, &args.out), "the session as received".to_owned()),
        ],
        pictures: "evaluation".to_owned(),
    };
    let page_file = write("index.html", gangway_report::html(&evaluation, &page))?;

    writeln!(out, "\nframe loop   {summary}")?;
    writeln!(out, "session      {}", received.folder.display())?;
    writeln!(out, "setup, truth {}, {}", setup_file.display(), truth_file.display())?;
    writeln!(out, "pictures     {}", pictures.display())?;
    writeln!(out, "page         {}", page_file.display())?;
    writeln!(out, "all of it in {:.1} s", began.elapsed().as_secs_f64())?;
    Ok(())
}

/// The ride: rendered, measured and received at the same time, at full speed.
fn ride(setup: &Setup, scene: &Arc<Scene>, rides: &Path) -> anyhow::Result<(Received, Summary)> {
    let server = TcpServer::bind("127.0.0.1", 0)?;
    let from: Address = format!("tcp://{}", server.local_addr()).parse()?;
    let receiver = Receiver::open(&from, rides, Until { once: true, ..Until::default() })?;
    let bar = simulate::progress(scene);
    let source = Box::new(Simulation::new(Arc::clone(scene), bar.clone()));
    let session_id = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |now| now.as_millis() as u64);
    let identity =
        Identity { box_id: 0, boot_id: session_id, session_id, firmware: env!("CARGO_PKG_VERSION") };
    let settings = setup.settings();
    let (stop_receiving, stop_playing) = (AtomicBool::new(false), AtomicBool::new(false));
    let (received, summary) = thread::scope(|scope| {
        let receiving = scope.spawn(|| {
            let received = receiver.run(&stop_receiving, |_| {}, |_| {});
            // Who is gone is waited for by nobody.
            stop_playing.store(true, Ordering::Release);
            received
        });
        let play = Play::new(identity);
        let summary = gangway_bench::run(&settings, source, server, &play, &stop_playing, &|_| {});
        if summary.is_err() {
            stop_receiving.store(true, Ordering::Relaxed);
        }
        (receiving.join(), summary)
    });
    bar.finish_and_clear();
    let summary = summary.map_err(|failure| failure.error).context("the frame loop stopped")?;
    let Ok(received) = received else { bail!("the receiving thread failed") };
    match received?.pop() {
        Some(received) => Ok((received, summary)),
        None => bail!("nothing was received"),
    }
}

fn relative(path: &Path, to: &Path) -> String {
    path.strip_prefix(to).unwrap_or(path).display().to_string()
}

/// The simulated camera: frames rendered a few at a time on all cores, read in order.
struct Simulation {
    scene: Arc<Scene>,
    bar: ProgressBar,
    next: u32,
    ready: VecDeque<Vec<u8>>,
}

impl Simulation {
    fn new(scene: Arc<Scene>, bar: ProgressBar) -> Self {
        Self { scene, bar, next: 0, ready: VecDeque::new() }
    }
}

impl FrameSource for Simulation {
    fn shape(&self) -> Shape {
        let (width, height) = self.scene.size();
        Shape::grey(width as u16, height as u16, self.scene.bits() as u8)
    }

    fn rate_hz(&self) -> Option<f64> {
        Some(self.scene.rate_hz())
    }

    fn read(&mut self, into: &mut Vec<u8>) -> Result<bool, SourceError> {
        if self.ready.is_empty() {
            let to = self.scene.frames().min(self.next + FRAMES_AT_ONCE);
            let render = |frame: u32| {
                let mut samples = Vec::new();
                self.scene.render(frame, &mut samples);
                samples
            };
            let frames: Vec<_> = (self.next..to).into_par_iter().map(render).collect();
            self.ready.extend(frames);
            self.next = to;
        }
        let Some(samples) = self.ready.pop_front() else { return Ok(false) };
        *into = samples;
        self.bar.inc(1);
        Ok(true)
    }

    fn rewind(&mut self) -> Result<(), SourceError> {
        self.next = 0;
        self.ready.clear();
        Ok(())
    }
}
