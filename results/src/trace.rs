//! A trace of latency: how long each plan takes, by scene and step. What a run under a latency leaves as `latency.csv`, or somebody's own
//! file of that kind. CSV, so that anybody can write one, and that no damage of it does more than make it no trace:
//!
//! ```text
//! scene,step,delay_us
//! 637f20cafde22ff8,0,81250
//! 637f20cafde22ff8,1,
//! ```
//!
//! Each scene's steps come from 0 on, in their order. Where the delay is left out the plan never arrives.

use std::collections::BTreeMap;
use std::io::{BufWriter, Write as _};
use std::path::{Path, PathBuf};

use sha2::{Digest as _, Sha256};
use thiserror::Error;

use crate::files::{self, FileError, WholeFile, at, hexadecimal};
use crate::folder::Folder;
use crate::part::Part;

/// The trace of a run, in its folder.
pub const TRACE: &str = "latency.csv";

const HEAD: &str = "scene,step,delay_us";

/// Delays (us) by scene; none for a plan that never arrives.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Trace(BTreeMap<String, Vec<Option<u32>>>);

/// A file that is no trace, or not that of the run.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum TraceError {
    #[error(transparent)]
    File(#[from] FileError),
    #[error("{} is not there\nhint: a run under a latency leaves one in its folder", .0.display())]
    Missing(PathBuf),
    #[error("{}, line {line}: {what}\nhint: docs/latency.md tells what a trace of latencies holds", path.display())]
    Line { path: PathBuf, line: usize, what: String },
    #[error("{} says nothing of the scene {scene}, which is to be driven\nhint: a trace repeats runs over the scenes that it was taken from", path.display())]
    Scene { path: PathBuf, scene: String },
    #[error("{} is another trace than that of the run: its SHA-256 is not {sha256}\nhint: give the run's own, or drive into another folder with --out", path.display())]
    Other { path: PathBuf, sha256: String },
}

impl Trace {
    /// Reads the trace in the file `path`; with its SHA-256, in hexadecimal digits.
    ///
    /// # Errors
    /// [`TraceError`] names the first line that is wrong.
    pub fn read(path: &Path) -> Result<(Self, String), TraceError> {
        let bytes = files::read(path)?.ok_or_else(|| TraceError::Missing(path.to_owned()))?;
        let text = String::from_utf8_lossy(&bytes);
        let wrong = |(line, what)| TraceError::Line { path: path.to_owned(), line, what };
        Ok((Self::parse(&text).map_err(wrong)?, hexadecimal(&Sha256::digest(&bytes))))
    }

    /// Reads the trace that has this SHA-256.
    ///
    /// # Errors
    /// [`TraceError`].
    pub fn read_held(path: &Path, sha256: &str) -> Result<Self, TraceError> {
        let (trace, found) = Self::read(path)?;
        if found == sha256 {
            Ok(trace)
        } else {
            Err(TraceError::Other { path: path.to_owned(), sha256: sha256.to_owned() })
        }
    }

    /// Reads the text of a file.
    ///
    /// # Errors
    /// The number of the first line that is wrong, from 1, and why.
    pub fn parse(text: &str) -> Result<Self, (usize, String)> {
        let mut lines = text.lines().enumerate();
        if lines.next().map(|(_, line)| line.trim_end()) != Some(HEAD) {
            return Err((1, format!("it is no trace of latencies: the first line is not {HEAD}")));
        }
        let mut trace = Self::default();
        for (index, line) in lines.filter(|(_, line)| !line.trim().is_empty()) {
            trace.add(line.trim_end()).map_err(|what| (index + 1, what))?;
        }
        Ok(trace)
    }

    fn add(&mut self, line: &str) -> Result<(), String> {
        let [scene, step, delay] = line.split(',').collect::<Vec<_>>()[..] else {
            return Err("it has not the three fields scene, step and delay_us".to_owned());
        };
        let delay_us = match delay {
            "" => None,
            _ => Some(delay.parse().map_err(|_| format!("the delay {delay:?} is no whole number of microseconds"))?),
        };
        let delays = match self.0.get_mut(scene) {
            Some(delays) => delays,
            None => self.0.entry(scene.to_owned()).or_default(),
        };
        if step.parse() != Ok(delays.len()) {
            return Err(format!("step {step:?} of the scene {scene}, where step {} follows", delays.len()));
        }
        delays.push(delay_us);
        Ok(())
    }

    /// That it says something of each of these scenes.
    ///
    /// # Errors
    /// [`TraceError::Scene`] names the first of which it does not.
    pub fn covers<'s>(&self, path: &Path, scenes: impl IntoIterator<Item = &'s str>) -> Result<(), TraceError> {
        match scenes.into_iter().find(|scene| !self.0.contains_key(*scene)) {
            Some(scene) => Err(TraceError::Scene { path: path.to_owned(), scene: scene.to_owned() }),
            None => Ok(()),
        }
    }

    /// The delays (us) of a scene's plans, step after step; none where the plan never arrives.
    #[must_use]
    pub fn delays_us(&self, scene: &str) -> &[Option<u32>] {
        self.0.get(scene).map_or(&[], |delays| delays)
    }
}

/// The trace of a run on its way.
pub(crate) struct TraceWriter {
    file: BufWriter<WholeFile>,
    path: PathBuf,
    /// What was there: it stands for episodes that are not driven again.
    earlier: Trace,
}

impl TraceWriter {
    /// Begins the trace of the run in `folder`, or takes up the one that is there.
    pub(crate) fn create(folder: &Folder, is_there: bool) -> Result<Self, TraceError> {
        let path = folder.file(TRACE);
        let earlier = if is_there { Trace::read(&path)?.0 } else { Trace::default() };
        let mut file = BufWriter::new(WholeFile::create(&path)?);
        writeln!(file, "{HEAD}").map_err(at("write", &path))?;
        Ok(Self { file, path, earlier })
    }

    /// The lines of an episode: of its part, or those of before.
    pub(crate) fn write(&mut self, scene: &str, part: Option<&Part>) -> Result<(), FileError> {
        let mut line = |step: usize, delay_us: Option<u32>| {
            let delay = delay_us.map_or_else(String::new, |delay| delay.to_string());
            writeln!(self.file, "{scene},{step},{delay}").map_err(at("write", &self.path))
        };
        match part {
            None => self.earlier.delays_us(scene).iter().enumerate().try_for_each(|(step, delay)| line(step, *delay)),
            Some(part) => {
                let delays = part.plans.as_ref().map_or(&[][..], |plans| &plans.delays_us);
                delays.iter().enumerate().try_for_each(|(step, delay)| line(step, u32::try_from(*delay).ok()))
            }
        }
    }

    pub(crate) fn commit(self) -> Result<(), FileError> {
        let file = self.file.into_inner().map_err(|error| at("write", &self.path)(error.into_error()))?;
        file.commit()
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use crate::folder::Opened;
    use crate::part::Plans;
    use crate::settings::tests::run_file;

    fn refusal(text: &str) -> String {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("t.csv");
        fs::write(&path, text).unwrap();
        Trace::read(&path).unwrap_err().to_string().replace(&*path.to_string_lossy(), "t.csv")
    }

    #[test]
    fn what_a_run_leaves_is_read_back_and_kept_where_nothing_is_driven_again() {
        let root = tempfile::tempdir().unwrap();
        let Ok(Opened::New(folder)) = Folder::open(root.path(), &run_file()) else { panic!("it is new") };
        let part = |delays_us: &[i32]| Part {
            plans: Some(Plans { delays_us: delays_us.to_vec(), ..Plans::default() }),
            ..Part::default()
        };
        let mut writer = TraceWriter::create(&folder, false).unwrap();
        writer.write("a", Some(&part(&[0, 81_250, -1, i32::MAX]))).unwrap();
        writer.write("b", Some(&part(&[7]))).unwrap();
        writer.write("undrivable", Some(&Part::default())).unwrap();
        writer.commit().unwrap();
        let path = folder.file(TRACE);
        let (trace, sha256) = Trace::read(&path).unwrap();
        assert_eq!(trace.delays_us("a"), [Some(0), Some(81_250), None, Some(i32::MAX as u32)]);
        assert_eq!((trace.delays_us("b"), trace.delays_us("undrivable")), (&[Some(7)][..], &[][..]));
        assert_eq!(Trace::read_held(&path, &sha256).unwrap(), trace);
        assert_eq!(sha256, files::sha256([&*path]).unwrap());
        assert!(matches!(Trace::read_held(&path, "00"), Err(TraceError::Other { .. })));

        let before = fs::read_to_string(&path).unwrap();
        let mut writer = TraceWriter::create(&folder, true).unwrap();
        writer.write("a", None).unwrap();
        writer.write("b", Some(&part(&[8]))).unwrap();
        writer.commit().unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), before.replace("b,0,7", "b,0,8"));
    }

    #[test]
    fn a_line_that_is_wrong_is_named() {
        insta::assert_snapshot!(refusal("scene,step,delay_us\na,0,\nb,0,5\na,2,\n"), @r#"
        t.csv, line 4: step "2" of the scene a, where step 1 follows
        hint: docs/latency.md tells what a trace of latencies holds
        "#);
        insta::assert_snapshot!(refusal("scene,step\n"), @"
        t.csv, line 1: it is no trace of latencies: the first line is not scene,step,delay_us
        hint: docs/latency.md tells what a trace of latencies holds
        ");
        let wrong = |line: &str| refusal(&format!("scene,step,delay_us\r\n{line}\r\n"));
        assert!(wrong("a,0,-5").contains("line 2: the delay \"-5\" is no whole number of microseconds"));
        assert!(wrong("a,0,0.5").contains("is no whole number"));
        assert!(wrong("a,0,99999999999").contains("is no whole number"));
        assert!(wrong("a,0").contains("three fields"));
        assert!(Trace::parse("scene,step,delay_us\r\na,0,5\r\n\r\n").unwrap().delays_us("a") == [Some(5)]);
        let missing = Trace::read(Path::new("nowhere.csv")).unwrap_err().to_string();
        assert!(missing.starts_with("nowhere.csv is not there"), "{missing}");
        insta::assert_snapshot!(Trace::default().covers(Path::new("t.csv"), ["b"]).unwrap_err(), @"
        t.csv says nothing of the scene b, which is to be driven
        hint: a trace repeats runs over the scenes that it was taken from
        ");
    }

    #[test]
    fn a_damaged_file_is_no_trace_or_another_one_and_no_panic() {
        let lines: String = (0..60).map(|step| format!("a,{step},{}\n", step * 1_007)).collect();
        let bytes = format!("{HEAD}\n{lines}").into_bytes();
        for at in 0..bytes.len() {
            for bit in 0..8 {
                let mut damaged = bytes.clone();
                damaged[at] ^= 1 << bit;
                let _ = Trace::parse(&String::from_utf8_lossy(&damaged));
            }
            let _ = Trace::parse(&String::from_utf8_lossy(&bytes[..at]));
        }
    }
}
