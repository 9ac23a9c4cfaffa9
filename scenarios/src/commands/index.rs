//! `scenarios index`: a file that stands for a set and is opened at once.

use std::io::Write;

use scenarios::SceneSet;

use super::Failure;
use super::table::count;
use super::whole_file::{folder_of, write_whole};
use crate::cli::IndexArguments;

pub fn run(arguments: &IndexArguments, out: &mut impl Write) -> Result<bool, Failure> {
    let set = SceneSet::open(&arguments.paths)?;
    for note in set.notes() {
        eprintln!("note: {note}");
    }
    let index = set.index(folder_of(&arguments.out));
    write_whole(&arguments.out, &index)?;
    let (scenes, kilobytes) = (count(set.entries().len(), "scene"), index.len() as f64 / 1e3);
    writeln!(out, "{scenes} in {} ({kilobytes:.1} kB)", arguments.out.display()).map_err(Failure::Output)?;
    Ok(false)
}
