//! What a run's settings say of its planner.

use clap::ValueEnum;

use super::ExplainError;
use crate::{Contingency, PlannerKind, ProposalsOptions};

/// The planner of a recording's run, as far as its settings name it: a member of `planner-node`, or a command that has one.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct PlannerOfRun {
    /// Its name.
    pub name: Option<String>,
    /// What its command gives as `--weights`.
    pub weights: Option<String>,
    /// ... as `--contingency`.
    contingency: Option<String>,
    /// ... as `--refine`.
    refine: Option<String>,
    /// The step from which on it drives, where it took over another run's drive.
    pub from: Option<u32>,
}

impl PlannerOfRun {
    /// As `run.toml` has it; nothing is known where that cannot be read.
    #[must_use]
    pub fn of(settings: &str) -> Self {
        let Some(toml::Value::Table(settings)) =
            settings.parse().ok().and_then(|mut run: toml::Table| run.remove("settings"))
        else {
            return Self::default();
        };
        let Some(planner) = settings.get("planner") else { return Self::default() };
        let text = |key: &str| planner.get(key).and_then(toml::Value::as_str);
        let options = planner.get("options").and_then(toml::Value::as_array);
        let words: Vec<&str> = match text("command") {
            Some(command) => command.split_whitespace().collect(),
            None => options.into_iter().flatten().filter_map(toml::Value::as_str).collect(),
        };
        let argument = |name: &str| argument(&words, name);
        let from = settings.get("fork").and_then(|fork| fork.get("step")?.as_integer());
        Self {
            name: text("name").map(str::to_owned).or_else(|| argument("--planner")),
            // What a member's weights are the plan tells; a command's may be any file.
            weights: text("command").and_then(|_| argument("--weights")),
            contingency: argument("--contingency"),
            refine: argument("--refine"),
            from: from.and_then(|step| u32::try_from(step).ok()),
        }
    }

    /// The options of the planner `proposals`; none where the settings do not name it.
    ///
    /// # Errors
    /// [`ExplainError::Options`] where the command has something else there, a variable of the shell for one.
    pub fn proposals(&self, step: u32) -> Result<Option<ProposalsOptions>, ExplainError> {
        let proposals = PlannerKind::Proposals.to_possible_value();
        if self.name.as_deref() != proposals.as_ref().map(clap::builder::PossibleValue::get_name) {
            return Ok(None);
        }
        let mut options = ProposalsOptions::default();
        let wrong =
            |option, value: &str, allowed| ExplainError::Options { step, option, value: value.to_owned(), allowed };
        if let Some(value) = &self.contingency {
            options.contingency = Contingency::from_str(value, false)
                .map_err(|_| wrong("--contingency", value, "off, expected, branches"))?;
        }
        if let Some(value) = &self.refine {
            let count = value.parse().ok().filter(|count| ProposalsOptions::REFINE.contains(count));
            options.refine = count.ok_or_else(|| wrong("--refine", value, "0 to 8"))?;
        }
        Ok(Some(options))
    }
}

/// What follows an option among the words of a command.
fn argument(words: &[&str], name: &str) -> Option<String> {
    let mut words = words.iter().map(|word| word.trim_matches(['\'', '"']));
    loop {
        let word = words.next()?;
        let value = match word.strip_prefix(name) {
            Some("") => words.next()?,
            Some(rest) if rest.starts_with('=') => &rest[1..],
            _ => continue,
        };
        return Some(value.trim_matches(['\'', '"']).to_owned());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(planner: &str) -> PlannerOfRun {
        PlannerOfRun::of(&format!("[settings]\ndriver = \"x\"\n{planner}"))
    }

    fn options(planner: &str) -> Result<Option<(Contingency, u8)>, String> {
        let options = of(planner).proposals(3).map_err(|e| e.to_string())?;
        Ok(options.map(|options| (options.contingency, options.refine)))
    }

    fn command(command: &str) -> String {
        format!("[settings.planner]\nfrom = \"command\"\ncommand = {command:?}\n")
    }

    #[test]
    fn the_options_of_proposals_are_those_of_its_command_or_the_usual_ones() {
        let member = "[settings.planner]\nfrom = \"node\"\nname = \"proposals\"\nreads-log = false\n";
        let usual = Ok(Some((Contingency::Branches, 2)));
        assert_eq!(options(member), usual);
        assert_eq!(options(&command("exec planner-node --planner proposals \"$@\"")), usual);
        let said = "planner-node --planner=proposals --contingency 'off' --refine=0 $@";
        assert_eq!(options(&command(said)), Ok(Some((Contingency::Off, 0))));
        let typed = format!("{member}options = [\"--refine\", \"5\", \"--contingency=expected\"]\n");
        assert_eq!(options(&typed), Ok(Some((Contingency::Expected, 5))));
    }

    #[test]
    fn of_other_planners_it_knows_no_options() {
        assert_eq!(options(&command("planner-node --planner gauss-newton --refine 3")), Ok(None));
        assert_eq!(options("[settings.planner]\nfrom = \"external\"\n"), Ok(None));
        assert_eq!(PlannerOfRun::of("no settings"), PlannerOfRun::default());
    }

    #[test]
    fn what_the_shell_would_fill_in_is_named() {
        let error = options(&command("planner-node --planner proposals --contingency $HOW")).unwrap_err();
        insta::assert_snapshot!(error, @"step 3: its run has --contingency $HOW, and that is none of off, expected, branches");
        let error = options(&command("planner-node --planner proposals --refine 9")).unwrap_err();
        insta::assert_snapshot!(error, @"step 3: its run has --refine 9, and that is none of 0 to 8");
    }

    #[test]
    fn a_fork_says_from_which_step_on_it_drives() {
        assert_eq!(of("[settings.fork]\nstep = 7\n[settings.planner]\nname = \"proposals\"\n").from, Some(7));
    }
}
