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

/// Numbers by course and step.
type Numbers = BTreeMap<String, BTreeMap<usize, Vec<f64>>>;

/// The answers of a node.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Golden {
    role: String,
    /// As [`Answer::numbers`] has them.
    answers: Numbers,
    /// As [`Answer::controls_in_futures`] has them. A file of before they were told has none, and holds no node to any.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    controls_in_futures: Numbers,
}

impl Golden {
    /// What is kept of these answers.
    pub fn of<'a>(role: Role, driven: impl Iterator<Item = (&'a str, &'a [Answer])>) -> Self {
        let (mut kept, mut controls_in_futures) = (Numbers::new(), Numbers::new());
        for (name, answers) in driven {
            let answers = answers.iter().enumerate().step_by(EVERY);
            kept.insert(name.to_owned(), answers.clone().map(|(step, answer)| (step, answer.numbers())).collect());
            let controls = answers.map(|(step, answer)| (step, answer.controls_in_futures()));
            let controls: BTreeMap<_, _> = controls.filter(|(_, numbers)| !numbers.is_empty()).collect();
            if !controls.is_empty() {
                controls_in_futures.insert(name.to_owned(), controls);
            }
        }
        Self { role: role.to_string(), answers: kept, controls_in_futures }
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
            held(course, answers, new)?;
        }
        for (course, controls) in &self.controls_in_futures {
            held(course, controls, now.controls_in_futures.get(course).unwrap_or(&BTreeMap::new()))?;
        }
        Ok(format!("{} answers as before", self.len()))
    }
}

/// The numbers of a course held to those of before.
fn held(course: &str, before: &BTreeMap<usize, Vec<f64>>, now: &BTreeMap<usize, Vec<f64>>) -> Result<(), String> {
    for (step, numbers) in before {
        let apart = now.get(step).and_then(|now| apart(numbers, now));
        let most = apart.ok_or_else(|| format!("{course}, step {step}: it says another number of things"))?;
        if most > TOLERANCE {
            return Err(format!("{course}, step {step}: off by up to {most:.3e}"));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use world::plan::{Control, Future, PLAN_STEPS, UncheckedPrediction};

    use super::super::course::Course;
    use super::*;

    fn told(controls: Vec<Control>) -> Golden {
        let future = Future { probability: 1.0, trajectories: vec![], controls };
        let prediction = UncheckedPrediction { futures: vec![future], ..Default::default() };
        let answers = [Answer::Prediction(prediction.check(0).unwrap())];
        Golden::of(Role::Predictor, [("bend", &answers[..])].into_iter())
    }

    #[test]
    fn a_file_of_before_futures_had_controls_holds_a_predictor_to_the_rest_alone() {
        let of = |steering: f64| told(vec![Control { acceleration: 1.0, steering }; PLAN_STEPS]);
        let (before, now) = (told(vec![]), of(0.1));
        assert_eq!(serde_json::to_string(&before).unwrap(), r#"{"role":"predictor","answers":{"bend":{"0":[1.0]}}}"#);
        assert_eq!(before.compare(&now), Ok("1 answers as before".to_owned()));
        assert_eq!(now.compare(&now), Ok("1 answers as before".to_owned()));
        assert_eq!(now.compare(&of(0.2)), Err("bend, step 0: off by up to 1.000e-1".to_owned()));
        assert_eq!(now.compare(&before), Err("bend, step 0: it says another number of things".to_owned()));
    }

    #[test]
    fn answers_come_back_from_the_file_and_changes_are_named() {
        let course = &Course::built_in(Role::Planner).unwrap()[0];
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
