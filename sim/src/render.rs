//! `sim render`: a picture or a clip of a drive.

use std::collections::BTreeSet;
use std::fs;
use std::io::{self, BufWriter, Read as _, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use evaluation::drives::{DrivesError, Run};
use evaluation::footage::{COLUMNS, Footage};
use evaluation::picture::{Look, Painter, PictureError, clip};
use results::files::{FileError, at, write_whole};
use results::parquet::ParquetError;
use thiserror::Error;

use crate::cli::{PictureStep, RenderArgs};
use crate::run::clock::Clock;

/// Pixels of a picture or a video, and of a GIF, which is large.
const SIZE: [u32; 2] = [960, 540];
const GIF_SIZE: [u32; 2] = [640, 360];

/// What makes videos.
const FFMPEG: &str = "ffmpeg";

/// A drive that is not drawn.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum RenderError {
    #[error(transparent)]
    Drives(#[from] DrivesError),
    #[error(transparent)]
    Parquet(#[from] ParquetError),
    #[error("{episode}: {source}")]
    Picture { episode: String, source: PictureError },
    #[error(transparent)]
    File(#[from] FileError),
    #[error("{} has no episode {id}\nhint: `sim table --scenes` lists them", run.display())]
    NoEpisode { run: PathBuf, id: String },
    #[error("a video's sides are even numbers of pixels, not {0} x {1}\nhint: --size 960x540")]
    OddSize(u32, u32),
    #[error(
        "there is no ffmpeg on this machine, which makes videos\nhint: install it (`apt-get install ffmpeg`), or ask for --gif"
    )]
    NoFfmpeg,
    #[error("ffmpeg gave up: {0}\nhint: --gif needs no ffmpeg")]
    Ffmpeg(String),
}

/// What was drawn.
#[derive(Debug)]
pub struct Drawn {
    path: PathBuf,
    size: [u32; 2],
    frames: usize,
    seconds: f64,
}

impl Drawn {
    /// A line on it.
    #[must_use]
    pub fn text(&self) -> String {
        let (path, [across, down]) = (self.path.display(), self.size);
        match self.frames {
            1 => format!("{path}: {across} x {down} pixels\n"),
            frames => format!("{path}: {frames} frames of {across} x {down} pixels\n"),
        }
    }

    /// How long it took.
    #[must_use]
    pub fn timing(&self) -> String {
        let Self { frames, seconds, .. } = self;
        format!("{frames} frames in {seconds:.2} s: {:.0} a second", *frames as f64 / seconds)
    }
}

/// Draws what is asked for.
///
/// # Errors
/// [`RenderError`].
pub fn draw(arguments: &RenderArgs, clock: &impl Clock) -> Result<Drawn, RenderError> {
    let episode = &arguments.episode;
    let run = Run::open(&arguments.run, &arguments.scenarios)?;
    let place = run.file.scenes.iter().position(|line| line.id == *episode);
    let place = place.ok_or_else(|| RenderError::NoEpisode { run: arguments.run.clone(), id: episode.clone() })?;
    let read = run.picked(&COLUMNS, &BTreeSet::from([place]), |driven| Footage::of(&run, driven))?;
    let Some(footage) = read.into_iter().next().transpose()? else {
        return Err(RenderError::NoEpisode { run: arguments.run.clone(), id: episode.clone() });
    };
    let picture = |source| RenderError::Picture { episode: episode.clone(), source };
    let end = footage.frames.len() - 1;
    let (first, last) = match arguments.png {
        Some(PictureStep::Start) => (0, 0),
        Some(PictureStep::Step(step)) => (step.saturating_add(1), step.saturating_add(1)),
        Some(PictureStep::Last) => (end, end),
        None => (0, end),
    };
    let size = arguments.size.map_or(if arguments.gif { GIF_SIZE } else { SIZE }, |size| size.0);
    let among = run.file.settings.traffic.as_ref().map_or_else(String::new, |traffic| format!(" · traffic {traffic}"));
    let title = format!("{episode} · {}{among}", run.file.settings.driver);
    let look = Look { size, across: arguments.across };
    let mut painter = Painter::new(&footage, &title, look, last).map_err(picture)?;
    let path = arguments.out.clone().unwrap_or_else(|| match arguments.png {
        Some(PictureStep::Start) => PathBuf::from(format!("{episode}-start.png")),
        Some(_) => PathBuf::from(format!("{episode}-{}.png", first.saturating_sub(1))),
        None => PathBuf::from(format!("{episode}.{}", if arguments.gif { "gif" } else { "mp4" })),
    });
    let begun = clock.now();
    if arguments.png.is_some() {
        painter.frame(first).map_err(picture)?;
        let bytes = painter.png().map_err(picture)?;
        write_whole(&path, |file| file.write_all(&bytes))?;
    } else if arguments.gif {
        gif(&mut painter, last, &path, picture)?;
    } else {
        mp4(&mut painter, size, last, &path, picture)?;
    }
    let seconds = (clock.now() - begun).as_secs_f64();
    Ok(Drawn { path, size, frames: last - first + 1, seconds })
}

fn gif(
    painter: &mut Painter<'_>,
    last: usize,
    path: &Path,
    picture: impl Fn(PictureError) -> RenderError,
) -> Result<(), RenderError> {
    let mut failed = None;
    let written = write_whole(path, |file| {
        let mut out = BufWriter::new(file);
        let drawn = clip::gif(painter, last, &mut out);
        drawn.map_err(|error| {
            failed = Some(error);
            io::Error::other("the clip cannot be drawn")
        })?;
        out.flush()
    });
    match failed {
        Some(error) => Err(picture(error)),
        None => Ok(written?),
    }
}

/// Frames go to `ffmpeg` as they are drawn; the file has its name when it is whole.
fn mp4(
    painter: &mut Painter<'_>,
    [across, down]: [u32; 2],
    last: usize,
    path: &Path,
    picture: impl Fn(PictureError) -> RenderError,
) -> Result<(), RenderError> {
    if across % 2 + down % 2 > 0 {
        return Err(RenderError::OddSize(across, down));
    }
    let partial = {
        let mut name = path.as_os_str().to_owned();
        name.push(".partial");
        PathBuf::from(name)
    };
    let mut process = ffmpeg(across, down, &partial)?;
    let sent = send(painter, last, &mut process, picture);
    // Its input is closed: it writes the end.
    let ended = process.wait().map_err(|error| RenderError::Ffmpeg(error.to_string()))?;
    let mut said = String::new();
    if let Some(mut stderr) = process.stderr.take() {
        // What it said is for the message alone.
        let _ = stderr.read_to_string(&mut said);
    }
    let whole = match sent {
        Ok(()) if ended.success() => Ok(fs::rename(&partial, path).map_err(at("rename", &partial))?),
        // Where it stopped to read it said why.
        Ok(()) | Err(RenderError::Ffmpeg(_)) if !said.trim().is_empty() => {
            Err(RenderError::Ffmpeg(said.trim().to_owned()))
        }
        Ok(()) => Err(RenderError::Ffmpeg(ended.to_string())),
        Err(error) => Err(error),
    };
    if whole.is_err() {
        // There may be none.
        let _ = fs::remove_file(&partial);
    }
    whole
}

fn ffmpeg(across: u32, down: u32, out: &Path) -> Result<Child, RenderError> {
    let size = format!("{across}x{down}");
    let mut command = Command::new(FFMPEG);
    command.args(["-loglevel", "error", "-y", "-f", "rawvideo", "-pix_fmt", "rgba", "-framerate", "10"]);
    command.args(["-video_size", &size, "-i", "-", "-pix_fmt", "yuv420p", "-movflags", "+faststart", "-f", "mp4"]);
    // A file is named as one, whatever its name begins with.
    command.arg(if out.is_absolute() { out.to_owned() } else { Path::new(".").join(out) });
    command.stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::piped());
    command.spawn().map_err(|error| match error.kind() {
        io::ErrorKind::NotFound => RenderError::NoFfmpeg,
        _ => RenderError::Ffmpeg(error.to_string()),
    })
}

fn send(
    painter: &mut Painter<'_>,
    last: usize,
    process: &mut Child,
    picture: impl Fn(PictureError) -> RenderError,
) -> Result<(), RenderError> {
    let Some(mut input) = process.stdin.take() else {
        return Err(RenderError::Ffmpeg("it takes no frames".to_owned()));
    };
    for frame in 0..=last {
        let pixels = painter.frame(frame).map_err(&picture)?;
        input.write_all(pixels).map_err(|error| RenderError::Ffmpeg(error.to_string()))?;
    }
    Ok(())
}
