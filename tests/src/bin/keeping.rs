//! The table of finding and keeping, over every scene of `tests/scenes/keeping` or those named, twenty seeds each:
//!
//!     cargo run --release -p e2e --bin keeping -- [--seeds N] [--pictures FOLDER] [SCENE ...]
//!
//! With `--pictures` the worst frame of each scene is written there, with windows, centres and refusals drawn in.

use std::path::PathBuf;
use std::process::ExitCode;

use e2e::keeping::{Outcome, play};
use e2e::{Keeping, drawing};
use rayon::prelude::*;

/// First seed; the ones after it follow.
const FIRST_SEED: u64 = 100;

/// What the command line says.
struct Asked {
    seeds: u64,
    pictures: Option<PathBuf>,
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
    heading();
    for keeping in &asked.scenes {
        let seeds = (FIRST_SEED..FIRST_SEED + asked.seeds).into_par_iter();
        let outcomes: Vec<Outcome> = seeds.map(|seed| play(keeping, seed)).collect();
        let mut all = Outcome::default();
        outcomes.into_iter().for_each(|outcome| all.add(outcome));
        row(&keeping.name, asked.seeds, &all);
        if let Some(folder) = &asked.pictures {
            let file = folder.join(format!("{}.png", keeping.name));
            if let Err(error) = drawing::draw(keeping, all.worst.seed, all.worst.frame, &file) {
                eprintln!("keeping: {} cannot be written: {error}", file.display());
                return ExitCode::FAILURE;
            }
        }
    }
    ExitCode::SUCCESS
}

fn asked(mut arguments: impl Iterator<Item = String>) -> Result<Asked, String> {
    let mut asked = Asked { seeds: 20, pictures: None, scenes: Vec::new() };
    let all = Keeping::all();
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            "--seeds" => {
                let number = arguments.next().and_then(|text| text.parse().ok());
                let number = number.filter(|number| (1..=10_000).contains(number));
                asked.seeds = number.ok_or("--seeds must be followed by a whole number from 1 to 10000")?;
            }
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
    if asked.scenes.is_empty() {
        asked.scenes = all;
    }
    Ok(asked)
}

fn heading() {
    println!(
        "{:15} {:>5} {:>7} {:>7} {:>7} {:>6} {:>6} {:>5} {:>7} {:>5} {:>15} {:>17} {:>6} {:>9} {:>7} {:>5} {:>5}  worst",
        "scene",
        "seeds",
        "frames",
        "6 free",
        "poses",
        "wrong",
        "marked",
        "first",
        "longest",
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
    let [median, most] = all.cost();
    let (mm, deg) = (all.off_mm, all.off_deg);
    println!(
        "{name:15} {seeds:5} {:7} {:7} {:7} {:6} {:6} {:5} {:7} {:5} {:>15} {:>17} {:6.1} {median:9.0} {most:7.0} {:5.1} {:5.2}  seed {}, frame {}",
        all.frames,
        all.enough,
        all.poses,
        all.wrong,
        all.marked,
        all.first,
        all.longest,
        all.ring_longest,
        format!("{:.3} ({:.3})", mm[0], mm[1]),
        format!("{:.4} ({:.4})", deg[0], deg[1]),
        all.most_sigmas,
        most / median,
        all.most_work(),
        all.worst.seed,
        all.worst.frame,
    );
}
