//! Prints the tables: `cargo run --release -p accuracy [TABLE] [SEEDS]`.

use std::process::ExitCode;

use accuracy::table::Table;
use accuracy::{bound, centres, drawn, methods, outliers, plane, scatter, shutter};

/// Seeds where none are asked for.
const SEEDS: u64 = 20;

/// Makes a table over so many seeds.
type Maker = fn(u64) -> Table;

/// Name and maker of each table.
const TABLES: &[(&str, Maker)] = &[
    ("centres", centres::table),
    ("drawn", drawn::table),
    ("outliers", outliers::table),
    ("bound", bound::table),
    ("plane", plane::table),
    ("shutter", shutter::table),
    ("methods", methods::table),
    ("scatter", scatter::table),
];

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let names = || TABLES.iter().map(|(name, _)| *name).collect::<Vec<_>>().join(", ");
    let wanted = arguments.first().map(String::as_str);
    let seeds = match arguments.get(1).map(|text| text.parse()) {
        None => SEEDS,
        Some(Ok(seeds)) if seeds > 0 => seeds,
        Some(_) => {
            eprintln!("error: SEEDS is {}; it must be a whole number from 1", arguments[1]);
            return ExitCode::from(2);
        }
    };
    if wanted.is_some_and(|wanted| TABLES.iter().all(|(name, _)| *name != wanted)) {
        eprintln!("error: there is no table {}; there are {}", arguments[0], names());
        return ExitCode::from(2);
    }
    for (name, table) in TABLES.iter().filter(|(name, _)| wanted.is_none_or(|wanted| wanted == *name)) {
        println!("## {name}, {seeds} seeds\n\n{}", table(seeds));
    }
    ExitCode::SUCCESS
}
