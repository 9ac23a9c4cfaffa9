//! What draws finished runs.

use std::path::PathBuf;
use std::str::FromStr;

use clap::Args;

/// `sim render`.
#[derive(Debug, Args)]
#[command(group = clap::ArgGroup::new("what").required(true))]
pub struct RenderArgs {
    /// Folder of a finished run
    #[arg(value_name = "RUN")]
    pub run: PathBuf,
    /// The scene whose drive is drawn; `sim table --scenes` lists them
    #[arg(long, value_name = "ID")]
    pub episode: String,
    /// A picture after this step, as tables number them; `last` is where the drive ended, `start` before its first step
    #[arg(long, value_name = "STEP", group = "what")]
    pub png: Option<PictureStep>,
    /// A clip of the whole drive that plays in any page
    #[arg(long, group = "what")]
    pub gif: bool,
    /// A clip of the whole drive as video
    #[arg(long, group = "what")]
    pub mp4: bool,
    /// The file [default: ID-STEP.png, ID.gif or ID.mp4]
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Pixels [default: 960x540, of a GIF 640x360]
    #[arg(long, value_name = "WxH")]
    pub size: Option<Size>,
    /// Metres that are seen across
    #[arg(long, value_name = "METRES", default_value_t = 100.0)]
    pub across: f64,
    /// Where the scenes are [default: where the run has them from]
    #[arg(long, value_name = "PATH", num_args = 1..)]
    pub scenarios: Vec<String>,
    /// Say on standard error how many frames a second were drawn
    #[arg(long)]
    pub timing: bool,
}

/// Which step a picture shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PictureStep {
    /// Before the first step.
    Start,
    /// After the step of this number.
    Step(usize),
    /// Where the drive ended.
    Last,
}

impl FromStr for PictureStep {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.parse() {
            Ok(step) => Ok(Self::Step(step)),
            Err(_) if text == "start" => Ok(Self::Start),
            Err(_) if text == "last" => Ok(Self::Last),
            Err(_) => Err("a step is a number, or one of the words start and last".to_owned()),
        }
    }
}

/// Pixels across and down: `960x540`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Size(pub [u32; 2]);

impl FromStr for Size {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let sides = text.split_once('x').and_then(|(across, down)| Some([across.parse().ok()?, down.parse().ok()?]));
        sides.map(Self).ok_or_else(|| "write it as 960x540".to_owned())
    }
}
