//! `gangway setup`: check a setup file, show what it results in.

use std::path::PathBuf;

use gangway_setup::Setup;

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
}

/// Runs `gangway setup`.
pub(crate) fn run(args: Args) -> anyhow::Result<()> {
    match args.action {
        Action::Check { file } => {
            Setup::read(&file)?;
        }
    }
    Ok(())
}
