//! Files of the report. Each is written under a temporary name, then renamed: no half-written file is ever
//! seen.

use std::io::ErrorKind;
use std::io::Write;
use std::path::{Path, PathBuf};

use crate::{Evaluation, ReportError, plots};

impl Evaluation {
    /// Writes `evaluation.txt`, `evaluation.json`, `motions.svg` and `.png` and, where there is a reference,
    /// `deviations.svg` and `.png` into a folder, which is made if need be; without one, those of an earlier
    /// evaluation are taken away. Gives back the paths of what was written.
    ///
    /// # Errors
    ///
    /// The first file that cannot be written.
    pub fn write_all(&self, folder: &Path) -> Result<Vec<PathBuf>, ReportError> {
        let mut written = Vec::new();
        let mut write = |name: &str, bytes: &[u8]| {
            let path = folder.join(name);
            write_file(&path, bytes)?;
            written.push(path);
            Ok(())
        };
        write("evaluation.txt", self.table().as_bytes())?;
        write("evaluation.json", format!("{}\n", self.to_json()).as_bytes())?;
        let motions = plots::motions(self);
        write("motions.svg", motions.svg().as_bytes())?;
        write("motions.png", &motions.png()?)?;
        match plots::deviations(self) {
            Some(deviations) => {
                write("deviations.svg", deviations.svg().as_bytes())?;
                write("deviations.png", &deviations.png()?)?;
            }
            // Beside these motions they would be taken for this evaluation's.
            None => ["deviations.svg", "deviations.png"].into_iter().try_for_each(|name| {
                let path = folder.join(name);
                match std::fs::remove_file(&path) {
                    Err(why) if why.kind() != ErrorKind::NotFound => Err(ReportError::Write { path, why }),
                    _ => Ok(()),
                }
            })?,
        }
        Ok(written)
    }
}

/// Writes a file under a temporary name beside it, then renames it. Makes the folder if need be.
///
/// # Errors
///
/// Where the folder cannot be made or the file cannot be written; nothing is left behind then.
pub fn write_file(path: &Path, bytes: &[u8]) -> Result<(), ReportError> {
    let error = |why| ReportError::Write { path: path.to_owned(), why };
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder).map_err(error)?;
    }
    let mut name = path.file_name().unwrap_or_default().to_owned();
    name.push(format!(".{}.tmp", std::process::id()));
    let temporary = path.with_file_name(name);
    let write = || {
        let mut file = std::fs::File::create(&temporary)?;
        file.write_all(bytes)?;
        file.sync_all()?;
        std::fs::rename(&temporary, path)
    };
    write().map_err(|why| {
        // Best effort: what matters is the error that is reported.
        let _ = std::fs::remove_file(&temporary);
        error(why)
    })
}
