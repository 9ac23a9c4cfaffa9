//! A file of answers: what a node said once is what it should say again.

use std::collections::BTreeMap;
use std::fs;
use std::io::Write as _;
use std::path::Path;

use results::files::{FileError, at, write_whole};
use serde::{Deserialize, Serialize};
use thiserror::Error;
use wire::keys::Role;

use super::answers::{Answer, apart};

/// Steps of a course whose answers are kept.
const EVERY: usize = 10;

/// How far a number may be off (m, rad, m/s): what another compiler may make of the same source.
const TOLERANCE: f64 = 1e-6;

/// A file that holds no answers.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum GoldenError {
    #[error(transparent)]
    File(#[from] FileError),
    #[error("{path} holds no answers of a node: {source}\nhint: write it anew with --bless")]
    Format { path: String, source: serde_json::Error },
    #[error("{path} holds answers of a {theirs}, and this is a {ours}")]
    Role { path: String, theirs: String, ours: String },
}

/// The answers of a node: by course and step, as [`Answer::numbers`] has them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Golden {
    role: String,
    answers: BTreeMap<String, BTreeMap<usize, Vec<f64>>>,
}

impl Golden {
    /// What is kept of these answers.
    pub fn of<'a>(role: Role, driven: impl Iterator<Item = (&'a str, &'a [Answer])>) -> Self {
        let kept = |answers: &[Answer]| {
            answers.iter().enumerate().step_by(EVERY).map(|(step, answer)| (step, answer.numbers())).collect()
        };
        Self {
            role: role.to_string(),
            answers: driven.map(|(name, answers)| (name.to_owned(), kept(answers))).collect(),
        }
    }

    /// Reads them.
    ///
    /// # Errors
    /// [`GoldenError`].
    pub fn read(path: &Path, role: Role) -> Result<Self, GoldenError> {
        Self::parse(&fs::read_to_string(path).map_err(at("read", path))?, path, role)
    }

    /// Reads them out of `text`, which lies under `path`.
    ///
    /// # Errors
    /// [`GoldenError`].
    pub fn parse(text: &str, path: &Path, role: Role) -> Result<Self, GoldenError> {
        let path = path.display().to_string();
        let read = serde_json::from_str(text);
        let golden: Self = read.map_err(|source| GoldenError::Format { path: path.clone(), source })?;
        if golden.role != role.to_string() {
            return Err(GoldenError::Role { path, theirs: golden.role, ours: role.to_string() });
        }
        Ok(golden)
    }

    /// Writes them.
    ///
    /// # Errors
    /// [`GoldenError`].
    pub fn write(&self, path: &Path) -> Result<(), GoldenError> {
        let text = serde_json::to_string(self)
            .map_err(|source| GoldenError::Format { path: path.display().to_string(), source })?;
        Ok(write_whole(path, |file| file.write_all(text.as_bytes()).and_then(|()| file.write_all(b"\n")))?)
    }

    /// How many answers there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.answers.values().map(BTreeMap::len).sum()
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// What `now` says otherwise.
    ///
    /// # Errors
    /// The first difference, as a sentence.
    pub fn compare(&self, now: &Self) -> Result<String, String> {
        for (course, answers) in &self.answers {
            let new = now.answers.get(course).ok_or_else(|| format!("{course} was not driven"))?;
            for (step, numbers) in answers {
                let apart = new.get(step).and_then(|now| apart(numbers, now));
                let most = apart.ok_or_else(|| format!("{course}, step {step}: it says another number of things"))?;
                if most > TOLERANCE {
                    return Err(format!("{course}, step {step}: off by up to {most:.3e}"));
                }
            }
        }
        Ok(format!("{} answers as before", self.len()))
    }
}

#[cfg(test)]
mod tests {
    use super::super::course::Course;
    use super::*;

    #[test]
    fn answers_come_back_from_the_file_and_changes_are_named() {
        let course = &Course::built_in().unwrap()[0];
        let answers: Vec<Answer> = course.steps.iter().map(|(_, plan)| Answer::Plan(plan.clone())).collect();
        let golden = Golden::of(Role::Planner, [(course.name.as_str(), &answers[..])].into_iter());
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("golden.json");
        golden.write(&path).unwrap();
        let read = Golden::read(&path, Role::Planner).unwrap();
        assert_eq!(read.compare(&golden), Ok("5 answers as before".to_owned()));
        assert!(matches!(Golden::read(&path, Role::Predictor), Err(GoldenError::Role { .. })));

        let mut other = golden.clone();
        other.answers.values_mut().for_each(|steps| steps.values_mut().for_each(|numbers| numbers[0] += 1.0));
        assert_eq!(golden.compare(&other), Err(format!("{}, step 0: off by up to 1.000e0", course.name)));
        let none = Golden { answers: BTreeMap::new(), ..golden.clone() };
        assert!(golden.compare(&none).is_err());
        fs::write(&path, "{}").unwrap();
        assert!(matches!(Golden::read(&path, Role::Planner), Err(GoldenError::Format { .. })));
    }
}
