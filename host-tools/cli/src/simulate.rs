//! `gangway simulate`: a scene as frames, exact truth and the setup file for a box that watches it.

use std::io::{self, Write as _};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use std::time::Duration;

use anyhow::bail;
use gangway_scene::{BUILTIN, Format, Scene, SceneError};
use indicatif::{ProgressBar, ProgressStyle};

use crate::{Usage, stop_on_signals, tell};

/// Arguments of `gangway simulate`.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// A built-in scene (rig, ride, 1a, 1b, 1c, 2b, 2c) or a scene file.
    scene: String,
    /// Directory for frames, truth.csv and setup.toml; made if need be.
    #[arg(long, value_name = "DIR", required_unless_present = "print")]
    out: Option<PathBuf>,
    /// Number of frames, instead of the scene's own.
    #[arg(
        long, value_name = "N",
        value_parser = clap::value_parser!(u32).range(1..=1_000_000), allow_negative_numbers = true
    )]
    frames: Option<u32>,
    /// Seed of background and noise, instead of the scene's own.
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// How the frames are written.
    #[arg(long, value_enum, default_value_t = Frames::Y4m)]
    format: Frames,
    /// Print a built-in scene's file, to start one's own from, and do nothing else.
    #[arg(long)]
    print: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Frames {
    /// frames.y4m, one file.
    Y4m,
    /// frames/, a PNG file a frame.
    Png,
}

/// Runs `gangway simulate`.
pub(crate) fn run(args: Args) -> anyhow::Result<()> {
    let builtin = BUILTIN.iter().find(|(name, _)| *name == args.scene);
    let Some(out) = args.out.filter(|_| !args.print) else {
        let Some((_, text)) = builtin else {
            let names = BUILTIN.map(|(name, _)| name).join(", ");
            bail!(Usage(format!("--print takes the name of a built-in scene: {names}")));
        };
        io::stdout().write_all(text.as_bytes())?;
        return Ok(());
    };
    let mut scene = named(&args.scene)?;
    if let Some(frames) = args.frames {
        scene = scene.with_frames(frames);
    }
    if let Some(seed) = args.seed {
        scene = scene.with_seed(seed);
    }
    let format = match args.format {
        Frames::Y4m => Format::Y4m,
        Frames::Png => Format::Png,
    };
    let stop = stop_on_signals()?;
    let bar = progress(&scene);
    let written = scene.write(&out, format, |done| {
        bar.set_position(done.into());
        if stop.load(Ordering::Relaxed) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    bar.finish_and_clear();
    let written = written?;
    let (width, height) = scene.size();
    tell(&format!(
        "{}: {} frames of {width} x {height}, {} bit, in {}; truth in {}, setup in {}",
        scene.name(),
        scene.frames(),
        scene.bits(),
        written.frames.display(),
        written.truth.display(),
        written.setup.display()
    ));
    Ok(())
}

/// A scene by its built-in name or from its file.
pub(crate) fn named(name: &str) -> Result<Scene, SceneError> {
    let path = Path::new(name);
    // A plain word that is no file was meant as a built-in scene: the error then says which there are.
    let word = !path.exists() && path.extension().is_none() && path.components().count() == 1;
    if word || BUILTIN.iter().any(|(known, _)| *known == name) {
        Scene::builtin(name)
    } else {
        Scene::read(path)
    }
}

/// A bar over the scene's frames; hidden by itself where standard error is no terminal.
pub(crate) fn progress(scene: &Scene) -> ProgressBar {
    let bar = ProgressBar::new(scene.frames().into());
    if let Ok(style) = ProgressStyle::with_template("{msg} {wide_bar} {pos}/{len} frames, {eta} left") {
        bar.set_style(style);
    }
    bar.set_message(scene.name().to_owned());
    bar.enable_steady_tick(Duration::from_millis(250));
    bar
}
