//! `gangway setup`: check a setup file, show what it results in.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use gangway_setup::{Allowed, Row, Setup, Value};
use serde_json::json;

/// Arguments of `gangway setup`.
#[derive(clap::Args)]
pub(crate) struct Args {
    #[command(subcommand)]
    action: Action,
}

#[derive(clap::Subcommand)]
enum Action {
    /// Say whether a setup file is good, and every mistake in it if not.
    Check {
        /// The setup file.
        file: PathBuf,
    },
    /// Show every setting with its value, unit, default, bounds and where it came from.
    Show {
        /// The setup file.
        file: PathBuf,
        /// As JSON, with the meaning of every setting.
        #[arg(long)]
        json: bool,
    },
}

/// Runs `gangway setup`.
pub(crate) fn run(args: Args) -> anyhow::Result<()> {
    let mut out = io::BufWriter::new(io::stdout().lock());
    match args.action {
        Action::Check { file } => {
            let setup = Setup::read(&file)?;
            writeln!(out, "{}: {}", file.display(), summary(&setup))?;
        }
        Action::Show { file, json: true } => {
            // As an error of the system, so that a closed pipe is known as one.
            serde_json::to_writer_pretty(&mut out, &as_json(&file, &Setup::read(&file)?))
                .map_err(io::Error::from)?;
            writeln!(out)?;
        }
        Action::Show { file, json: false } => {
            let setup = Setup::read(&file)?;
            writeln!(out, "{}: {}\n", file.display(), summary(&setup))?;
            as_text(&mut out, &setup)?;
        }
    }
    Ok(out.flush()?)
}

/// One line on a good setup.
fn summary(setup: &Setup) -> String {
    let parts = setup.parts();
    let (targets, circles, seeds) = parts.targets.iter().fold((0, 0, 0), |sum, target| {
        (sum.0 + 1, sum.1 + target.circles_mm.len(), sum.2 + target.seeds_px.len())
    });
    format!(
        "good; \"{}\", {targets} {}, {circles} circles, {seeds} seeds, digest {}",
        parts.name,
        if targets == 1 { "target" } else { "targets" },
        hex(&setup.digest())
    )
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// The table in aligned columns; a list of pairs takes a line a pair.
fn as_text(out: &mut impl Write, setup: &Setup) -> io::Result<()> {
    let head = ["setting", "value", "unit", "default", "allowed", "from"].map(str::to_owned);
    let mut cells = vec![head];
    for row in setup.table() {
        let allowed = row.allowed.to_string();
        let default = row.default.as_ref().map_or("required".to_owned(), Value::to_string);
        let from = |line: Option<usize>| line.map_or("default".to_owned(), |line| format!("line {line}"));
        match &row.value {
            Value::Pairs(pairs) if !pairs.is_empty() => {
                for (i, pair) in pairs.iter().enumerate() {
                    let path = format!("{}[{i}]", row.path);
                    let from = from(setup.line(&path));
                    let value = Value::Numbers(pair.to_vec()).to_string();
                    let default = if i == 0 { default.clone() } else { String::new() };
                    let allowed = if i == 0 { allowed.clone() } else { String::new() };
                    cells.push([path, value, row.unit.to_owned(), default, allowed, from]);
                }
            }
            value => cells.push([
                row.path,
                value.to_string(),
                row.unit.to_owned(),
                default,
                allowed,
                from(row.line),
            ]),
        }
    }
    let mut widths = [0; 6];
    for line in &cells {
        for (width, cell) in widths.iter_mut().zip(line) {
            *width = (*width).max(cell.chars().count());
        }
    }
    for line in &cells {
        let padded: Vec<String> =
            line.iter().zip(widths).map(|(cell, width)| format!("{cell:width$}")).collect();
        writeln!(out, "{}", padded.join("  ").trim_end())?;
    }
    Ok(())
}

fn as_json(file: &Path, setup: &Setup) -> serde_json::Value {
    let settings: Vec<_> = setup
        .table()
        .iter()
        .map(|row: &Row| {
            json!({
                "setting": row.path,
                "value": value(&row.value),
                "unit": row.unit,
                "default": row.default.as_ref().map(value),
                "allowed": allowed(&row.allowed),
                "line": row.line,
                "meaning": row.meaning,
                "source": row.source,
            })
        })
        .collect();
    json!({
        "file": file.display().to_string(),
        "bytes": setup.text().len(),
        "digest": hex(&setup.digest()),
        "settings": settings,
    })
}

fn value(value: &Value) -> serde_json::Value {
    match value {
        Value::Text(text) => json!(text),
        Value::Flag(flag) => json!(flag),
        Value::Whole(number) => json!(number),
        Value::Number(number) => json!(number),
        Value::Numbers(numbers) => json!(numbers),
        Value::Pairs(pairs) => json!(pairs),
        Value::Wholes(numbers) => json!(numbers),
    }
}

fn allowed(allowed: &Allowed) -> serde_json::Value {
    match allowed {
        Allowed::Between(least, greatest) => json!({ "least": least, "greatest": greatest }),
        Allowed::Bytes(least, greatest) => json!({ "least_bytes": least, "greatest_bytes": greatest }),
        Allowed::Words(words) => json!({ "words": words }),
        Allowed::Flag => json!({ "values": [true, false] }),
    }
}
