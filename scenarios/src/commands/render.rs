//! `scenarios render`: scenes from above, as a picture.

use std::io::Write;
use std::path::Path;

use scenarios::picture::{Extent, Look, Moment, Picture, Sheet};
use world::scene::Scene;

use super::Failure;
use super::scenes::Scenes;
use super::table::count;
use super::whole_file::{folder_of, write_whole};
use crate::cli::RenderArguments;

/// The most tiles of a sheet: ten by ten are seen at a glance, more are not.
const MOST_TILES: usize = 100;
/// Width of a scene's picture, and of a tile of a sheet (pixels).
const WIDTH: u32 = 1200;
const TILE_WIDTH: u32 = 480;

/// What pictures can be.
#[derive(Clone, Copy)]
enum Format {
    Png,
    Svg,
}

pub fn run(arguments: &RenderArguments, out: &mut impl Write) -> Result<bool, Failure> {
    let path = &arguments.out;
    let format = Format::of(path).ok_or_else(|| Failure::NoPictureFormat(path.clone()))?;
    let folder = folder_of(path);
    if !folder.is_dir() {
        return Err(Failure::MissingFolder(folder.to_owned()));
    }
    let scenes = Scenes::open(&arguments.inputs)?;
    if arguments.inputs.scene.len() > MOST_TILES {
        return Err(Failure::TooManyTiles { scenes: arguments.inputs.scene.len(), most: MOST_TILES });
    }
    let drawn = scenes.len().min(MOST_TILES);
    if drawn < scenes.len() {
        eprintln!("note: the sheet shows the first {drawn} of {} scenes: --scene names others", scenes.len());
    }
    let picture = draw(&scenes, drawn, arguments)?;
    match format {
        Format::Png => write_whole(path, &picture.png()?)?,
        Format::Svg => write_whole(path, picture.svg().as_bytes())?,
    }
    let (width, height) = (picture.width(), picture.height());
    writeln!(out, "{} in {} ({width} x {height} pixels)", count(drawn, "scene"), path.display())
        .map_err(Failure::Output)?;
    Ok(false)
}

/// The first scene alone, or the first `drawn` on a sheet.
fn draw(scenes: &Scenes, drawn: usize, arguments: &RenderArguments) -> Result<Picture, Failure> {
    let usual_width = if drawn == 1 { WIDTH } else { TILE_WIDTH };
    let look = Look {
        width: arguments.width.unwrap_or(usual_width),
        extent: if arguments.whole { Extent::Whole } else { Extent::Radius(arguments.radius) },
        av_up: arguments.av_up,
        trail: arguments.trail,
    };
    let mut sheet = Sheet::new(arguments.columns.unwrap_or(Sheet::usual_columns(drawn)), look);
    for (index, _) in scenes.iter().take(drawn) {
        let (scene, _) = scenes.set.load(index)?;
        let moment = moment(&scene, arguments.step)?;
        if drawn == 1 {
            return Ok(Picture::of(moment, &look));
        }
        sheet.add(moment);
    }
    Ok(sheet.finish())
}

fn moment(scene: &Scene, step: Option<usize>) -> Result<Moment<'_>, Failure> {
    match step {
        Some(step) => Ok(Moment::new(scene, step)?),
        None => Ok(Moment::usual(scene)),
    }
}

impl Format {
    fn of(path: &Path) -> Option<Self> {
        let extension = path.extension()?.to_str()?.to_ascii_lowercase();
        match extension.as_str() {
            "png" => Some(Self::Png),
            "svg" => Some(Self::Svg),
            _ => None,
        }
    }
}
