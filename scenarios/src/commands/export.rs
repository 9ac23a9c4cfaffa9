//! `scenarios export`: scenes as TFRecord files, one each.

use std::fs;
use std::io::Write;

use scenarios::tfrecord;

use super::Failure;
use super::scenes::Scenes;
use super::table::count;
use super::whole_file::write_whole;
use crate::cli::ExportArguments;

pub fn run(arguments: &ExportArguments, out: &mut impl Write) -> Result<bool, Failure> {
    let scenes = Scenes::open(&arguments.inputs)?;
    let folder = &arguments.out;
    if folder.is_file() {
        return Err(Failure::NoFolder(folder.clone()));
    }
    fs::create_dir_all(folder).map_err(|source| Failure::Write { path: folder.clone(), source })?;
    let mut bytes = 0;
    for (index, entry) in scenes.iter() {
        let path = folder.join(format!("{}.tfrecord", entry.id));
        if path.exists() && !arguments.force {
            return Err(Failure::Exists(path));
        }
        let mut file = Vec::new();
        tfrecord::append_record(&mut file, &scenes.set.payload(index)?);
        bytes += file.len();
        write_whole(&path, &file)?;
    }
    let megabytes = bytes as f64 / 1e6;
    writeln!(out, "{} in {} ({megabytes:.1} MB)", count(scenes.len(), "scene"), folder.display())
        .map_err(Failure::Output)?;
    Ok(false)
}
