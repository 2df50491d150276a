//! The table of finding and keeping, over every scene of `tests/scenes/keeping` or those named, twenty seeds
//! each:
//!
//!     cargo run --release -p e2e --bin keeping -- [--seeds N] [--pictures FOLDER] [SCENE ...]
//!     cargo run --release -p e2e --bin keeping -- --pictures FOLDER --frame N [--seed S] SCENE ...
//!
//! Of the frames with six rings or more free to see (`6 free`) most have a pose. The others come before the
//! first pose of all (`first`: a picture is searched in slices, and no frame has what two of them find),
//! before the first one after people, darkness or glare (`again`), or in between (`lost`); `longest` is the
//! most of these two on end. `ring` is how long a single ring that was free to see stayed without its place
//! in a pose. Marked frames are those whose record says that the camera may have moved: their motion is not
//! compared. Times are processor time, of each frame the least of several plays; `times` and `work` are the
//! slowest frame over the median one of those that track, in time and in counted work: its prices are those
//! of pictures of 1920 x 1080; a small one is swept in less time than it says.
//!
//! With `--pictures` two frames of each scene are written there, with windows, centres and refusals drawn in:
//! `SCENE.png` is the worst one, by wrong rings, missing pose and error in standard deviations, and
//! `SCENE-empty.png` the one with the most windows without a ring, of those with six rings or more free if
//! they have any. With `--frame` any frame is, of the first seed or of the one named, and nothing is played.

use std::path::PathBuf;
use std::process::ExitCode;

use e2e::keeping::{Outcome, play};
use e2e::{Keeping, drawing};
use rayon::prelude::*;

/// First seed; the ones after it follow.
const FIRST_SEED: u64 = 100;

const USAGE: &str = "keeping [--seeds N] [--pictures FOLDER] [SCENE ...]
keeping --pictures FOLDER --frame N [--seed S] SCENE ...
Without a scene the table is over all; what its columns are stands at the top of tests/src/bin/keeping.rs.";

/// What the command line says.
struct Asked {
    help: bool,
    seeds: u64,
    pictures: Option<PathBuf>,
    /// The only frame that is wanted, and of which seed.
    frame: Option<usize>,
    seed: u64,
    scenes: Vec<Keeping>,
}

fn main() -> ExitCode {
    let asked = match asked(std::env::args().skip(1)) {
        Ok(asked) => asked,
        Err(sentence) => {
            eprintln!("keeping: {sentence}");
            return ExitCode::from(2);
        }
    };
    if asked.help {
        println!("{USAGE}");
        return ExitCode::SUCCESS;
    }
    match shown(&asked) {
        Ok(()) => ExitCode::SUCCESS,
        Err(sentence) => {
            eprintln!("keeping: {sentence}");
            ExitCode::FAILURE
        }
    }
}

/// Prints and draws what is asked for.
fn shown(asked: &Asked) -> Result<(), String> {
    let draw = |keeping: &Keeping, seed: u64, frame: usize, ending: &str| {
        let Some(folder) = &asked.pictures else { return Ok(()) };
        let file = folder.join(format!("{}{ending}.png", keeping.name));
        drawing::draw(keeping, seed, frame, &file)
            .map_err(|error| format!("{} cannot be written: {error}", file.display()))
    };
    if let Some(frame) = asked.frame {
        return asked.scenes.iter().try_for_each(|keeping| {
            let frames = keeping.scene(asked.seed).frames();
            if frame >= frames as usize {
                return Err(format!(
                    "--frame is {frame}; {} has the frames 0 to {}",
                    keeping.name,
                    frames - 1
                ));
            }
            draw(keeping, asked.seed, frame, &format!("-{frame}"))
        });
    }
    heading();
    for keeping in &asked.scenes {
        let seeds = (FIRST_SEED..FIRST_SEED + asked.seeds).into_par_iter();
        let outcomes: Vec<Outcome> = seeds.map(|seed| play(keeping, seed)).collect();
        let mut all = Outcome::default();
        outcomes.into_iter().for_each(|outcome| all.add(outcome));
        row(&keeping.name, asked.seeds, &all);
        draw(keeping, all.worst.seed, all.worst.frame, "")?;
        draw(keeping, all.emptiest.seed, all.emptiest.frame, "-empty")?;
    }
    Ok(())
}

fn asked(mut arguments: impl Iterator<Item = String>) -> Result<Asked, String> {
    let mut asked =
        Asked { help: false, seeds: 20, pictures: None, frame: None, seed: FIRST_SEED, scenes: Vec::new() };
    let all = Keeping::all();
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            "--seeds" => {
                let number = arguments.next().and_then(|text| text.parse().ok());
                let number = number.filter(|number| (1..=10_000).contains(number));
                asked.seeds = number.ok_or("--seeds must be followed by a whole number from 1 to 10000")?;
            }
            "--frame" => {
                let number = arguments.next().and_then(|text| text.parse().ok());
                asked.frame =
                    Some(number.ok_or("--frame must be followed by the number of a frame, from 0")?);
            }
            "--seed" => {
                let number = arguments.next().and_then(|text| text.parse().ok());
                asked.seed = number.ok_or("--seed must be followed by a whole number from 0")?;
            }
            "--help" => asked.help = true,
            "--pictures" => {
                let folder = arguments.next().map(PathBuf::from).filter(|folder| folder.is_dir());
                asked.pictures = Some(folder.ok_or("--pictures must be followed by a folder that is there")?);
            }
            name => match all.iter().find(|keeping| keeping.name == name) {
                Some(keeping) => asked.scenes.push(keeping.clone()),
                None => {
                    let names: Vec<&str> = all.iter().map(|keeping| keeping.name.as_str()).collect();
                    return Err(format!("{name} is no scene; there are {}", names.join(", ")));
                }
            },
        }
    }
    if asked.frame.is_some() && (asked.pictures.is_none() || asked.scenes.is_empty()) {
        return Err("--frame draws one frame of the scenes named: give --pictures FOLDER and a scene".into());
    }
    if asked.scenes.is_empty() {
        asked.scenes = all;
    }
    Ok(asked)
}

fn heading() {
    println!(
        "{:15} {:>5} {:>7} {:>7} {:>7} {:>5} {:>5} {:>4} {:>7} {:>6} {:>6} {:>4} {:>15} {:>17} {:>6} {:>9} {:>7} {:>5} {:>5}  worst",
        "scene",
        "seeds",
        "frames",
        "6 free",
        "poses",
        "first",
        "again",
        "lost",
        "longest",
        "wrong",
        "marked",
        "ring",
        "mm (sigma)",
        "deg (sigma)",
        "sigmas",
        "median us",
        "most us",
        "times",
        "work"
    );
}

fn row(name: &str, seeds: u64, all: &Outcome) {
    let (median, most) = all.cost_us();
    let (mm, deg) = (all.off_mm, all.off_deg);
    // Where nothing is ever tracked there is no median of it.
    let shown =
        |value: Option<f64>, decimals: usize| value.map_or("-".to_owned(), |v| format!("{v:.decimals$}"));
    println!(
        "{name:15} {seeds:5} {:7} {:7} {:7} {:5} {:5} {:4} {:7} {:6} {:6} {:4} {:>15} {:>17} {:6.1} {:>9} {most:7.0} {:>5} {:>5}  seed {}, frame {}",
        all.frames,
        all.enough,
        all.poses,
        all.first[0],
        all.again[0],
        all.lost[0],
        all.longest(),
        all.wrong,
        all.marked,
        all.ring_longest,
        format!("{:.3} ({:.3})", mm[0], mm[1]),
        format!("{:.4} ({:.4})", deg[0], deg[1]),
        all.most_sigmas,
        shown(median, 0),
        shown(median.map(|median| most / median), 1),
        shown(all.most_work(), 2),
        all.worst.seed,
        all.worst.frame,
    );
}
