//! What was found, for people and for programs.

use std::fmt::Write as _;

use serde::Serialize;

use super::rule::{Finding, Rule, Verdict};

/// What came of checking a node.
#[derive(Clone, Debug)]
pub struct Report {
    /// Its command.
    pub command: String,
    /// What it is, as `planner, with predictor ctrv`.
    pub role: String,
    /// A finding a rule, in the order of the rules.
    pub findings: Vec<Finding>,
}

#[derive(Serialize)]
struct Json<'a> {
    command: &'a str,
    role: &'a str,
    holds: bool,
    rules: Vec<JsonRule<'a>>,
}

#[derive(Serialize)]
struct JsonRule<'a> {
    rule: &'static str,
    verdict: &'static str,
    seen: &'a str,
    #[serde(skip_serializing_if = "Option::is_none")]
    advice: Option<&'static str>,
}

impl Report {
    /// Whether no rule is broken.
    #[must_use]
    pub fn holds(&self) -> bool {
        self.count(&Verdict::Broken) == 0
    }

    fn count(&self, verdict: &Verdict) -> usize {
        self.findings.iter().filter(|finding| finding.verdict == *verdict).count()
    }

    /// A line a rule, with advice below those that do not hold, within `width` columns where that is possible.
    #[must_use]
    pub fn text(&self, width: usize) -> String {
        let mut text = format!("node  {}\nrole  {}\n\n", self.command, self.role);
        let [rules, verdicts] = [11, 8];
        let indent = rules + verdicts + 4;
        for Finding { rule, verdict, seen } in &self.findings {
            let lines = wrapped(seen, width.saturating_sub(indent));
            let head = format!("{:<rules$}  {:<verdicts$}  ", rule.name(), verdict.name());
            put(&mut text, &head, &lines);
            if let Some(advice) = advice(*rule, verdict) {
                put(&mut text, &" ".repeat(indent), &wrapped(&format!("hint: {advice}"), width.saturating_sub(indent)));
            }
        }
        let sum = [Verdict::Holds, Verdict::Doubtful, Verdict::Broken, Verdict::Skipped].map(|v| self.count(&v));
        let [holds, doubtful, broken, skipped] = sum;
        let _ = writeln!(text, "\n{holds} hold, {doubtful} in doubt, {broken} broken, {skipped} skipped");
        text
    }

    /// The same for programs.
    ///
    /// # Errors
    /// None that is known: all of it are texts.
    pub fn json(&self) -> serde_json::Result<String> {
        let rules = self.findings.iter();
        let rules = rules.map(|Finding { rule, verdict, seen }| JsonRule {
            rule: rule.name(),
            verdict: verdict.name(),
            seen,
            advice: advice(*rule, verdict),
        });
        let json = Json { command: &self.command, role: &self.role, holds: self.holds(), rules: rules.collect() };
        serde_json::to_string_pretty(&json).map(|text| text + "\n")
    }
}

fn advice(rule: Rule, verdict: &Verdict) -> Option<&'static str> {
    matches!(verdict, Verdict::Broken | Verdict::Doubtful).then(|| rule.advice())
}

fn put(text: &mut String, head: &str, lines: &[String]) {
    for (at, line) in lines.iter().enumerate() {
        let head = if at == 0 { head.to_owned() } else { " ".repeat(head.len()) };
        let _ = writeln!(text, "{}", format!("{head}{line}").trim_end());
    }
}

/// `text` in lines of so many columns; a longer word has a line of its own.
fn wrapped(text: &str, width: usize) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in text.split_whitespace() {
        let mut line = lines.pop().unwrap_or_default();
        if !line.is_empty() && line.chars().count() + 1 + word.chars().count() > width.max(20) {
            lines.push(std::mem::take(&mut line));
        }
        if !line.is_empty() {
            line.push(' ');
        }
        lines.push(line + word);
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    fn report(findings: Vec<Finding>) -> Report {
        Report { command: "python planner.py".to_owned(), role: "planner".to_owned(), findings }
    }

    #[test]
    fn a_report_says_what_to_do_where_something_is_wrong() {
        let report = report(vec![
            Finding::holds(Rule::Joins, "on the bus after 0.1 s"),
            Finding::broken(Rule::Noise, "an empty message ends it"),
            Finding::doubtful(Rule::InTime, "the 99th percentile is 0.3 s"),
            Finding::skipped(Rule::Golden, "no --golden"),
        ]);
        assert!(!report.holds());
        insta::assert_snapshot!(report.text(80));
        let json: serde_json::Value = serde_json::from_str(&report.json().unwrap()).unwrap();
        assert_eq!(json["holds"], false);
        assert_eq!(json["rules"][1]["rule"], "noise");
        assert!(json["rules"][0].get("advice").is_none() && json["rules"][1]["advice"].is_string());
    }

    #[test]
    fn doubts_alone_break_nothing() {
        assert!(report(vec![Finding::doubtful(Rule::InTime, "slow")]).holds());
    }

    #[test]
    fn lines_are_broken_between_words() {
        assert_eq!(wrapped("one two three", 20), ["one two three"]);
        assert_eq!(wrapped("one two three four five six", 20), ["one two three four", "five six"]);
        assert_eq!(wrapped("", 20), [""]);
    }
}
