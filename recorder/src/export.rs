//! A Rerun file from a recording: the same drawing as when it is recorded.

use std::path::Path;

use anyhow::Context as _;

use crate::mcap::{Contents, read};
use crate::partial_file::{FileError, PartialFile};
use crate::rrd::Drawing;

/// Reads the recording at `path`.
///
/// # Errors
/// Where it cannot be read, or is none.
pub fn open(path: &Path) -> anyhow::Result<Contents> {
    let bytes = std::fs::read(path).map_err(FileError::at("read", path))?;
    read(&bytes).with_context(|| format!("cannot use {}", path.display()))
}

/// Draws the recording at `mcap` into `rrd`, under the name of `run`. Says why the recording is cut, if it is.
///
/// # Errors
/// Where one cannot be read or the other not be written.
pub fn export(mcap: &Path, rrd: &Path, run: Option<&str>) -> anyhow::Result<Option<String>> {
    let contents = open(mcap)?;
    let mut drawing = Drawing::default();
    contents.messages.iter().for_each(|message| drawing.push(message));
    let run = run.map_or_else(|| run_of(mcap), str::to_owned);
    let bytes = drawing.finish(&run, &contents.settings).with_context(|| format!("cannot draw {}", mcap.display()))?;
    let mut file = PartialFile::create(rrd)?;
    file.append(&bytes)?;
    file.commit()?;
    Ok(contents.cut)
}

/// The run that a recording belongs to, by the folder where it lies: `<run>/episodes/<scene>.mcap`.
fn run_of(mcap: &Path) -> String {
    let absolute = std::path::absolute(mcap).unwrap_or_else(|_| mcap.to_owned());
    let episodes = absolute.parent().filter(|folder| folder.ends_with("episodes"));
    let run = episodes.and_then(Path::parent).and_then(Path::file_name);
    run.map_or_else(|| "export".to_owned(), |name| name.to_string_lossy().into_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_recording_in_a_run_s_folder_is_of_that_run() {
        assert_eq!(run_of(Path::new("/data/runs/idm-7/episodes/a.mcap")), "idm-7");
        assert_eq!(run_of(Path::new("/data/a.mcap")), "export");
    }
}
