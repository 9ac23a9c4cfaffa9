//! Who drives with what was trained: a file for `sim matrix --entrants`, an entry a training.

use std::fmt::Write as _;

use super::Outcome;
use crate::settings::{InitialControls, Mode, Predictor, Settings};

/// The names of the planner's weights, as its TOML file has them, in the order of `w1` to `w9`.
const TERMS: [&str; 9] = [
    "speed",
    "acceleration",
    "jerk",
    "steering",
    "steering_change",
    "lane_position",
    "lane_heading",
    "red_light",
    "safety",
];

/// The cost that was learned, as `planner-node --weights FILE` takes it; none where no epoch was done.
pub(super) fn cost(outcome: &Outcome) -> Option<String> {
    let mut text = String::new();
    for (index, term) in TERMS.iter().enumerate() {
        let weight: f64 = outcome.field(&format!("w{}", index + 1)).parse().ok()?;
        // Writing into memory does not fail.
        let _ = writeln!(text, "{term} = {weight:?}");
    }
    Some(text)
}

/// An entry for each training that came to its end, in their order.
pub(super) fn of(outcomes: &[Outcome]) -> String {
    let mut text = String::from("# For `sim matrix --entrants`: who drives with what was trained here.\n");
    for outcome in outcomes.iter().filter(|outcome| outcome.failure.is_none()) {
        let (folder, settings) = (&outcome.run.folder, &outcome.run.settings);
        let _ = writeln!(text, "\n[[entrant]]\nlabel = {folder:?}\n{}", who(folder, settings));
    }
    text
}

/// Who drives as these settings train: a driver of that name, or the planner started otherwise.
fn who(folder: &str, settings: &Settings) -> String {
    let weights = format!("weights = \"{folder}/weights.safetensors\"");
    let planner = |options: &str| format!("planner-command = \"planner-node --planner gauss-newton {options}\"");
    let cost = match settings.mode {
        Mode::Dipp => format!("--weights '{{here}}/{folder}/cost.toml'"),
        Mode::Sep | Mode::IlPred | Mode::Il => "--weights hand-tuned".to_owned(),
    };
    match (settings.mode, settings.predictor, settings.initial_controls) {
        (Mode::Il, ..) => format!("driver = \"il\"\n{weights}"),
        (Mode::IlPred, ..) => format!("driver = \"il-pred\"\n{weights}"),
        (Mode::Sep, Predictor::Network, InitialControls::Network) => format!("driver = \"sep\"\n{weights}"),
        (Mode::Dipp, Predictor::Network, InitialControls::Network) => format!("driver = \"dipp\"\n{weights}"),
        (Mode::Dipp, Predictor::Network, InitialControls::Zero) => {
            format!("{}\npredictor = \"network\"\n{weights}", planner("--init zero --weights learned"))
        }
        (_, Predictor::Network, InitialControls::Zero) => {
            format!("{}\npredictor = \"network\"\n{weights}", planner("--init zero --weights hand-tuned"))
        }
        // No other predictor says where plans begin, or what they cost.
        (_, Predictor::Ctrv, _) => format!("{}\npredictor = \"ctrv\"", planner(&format!("--init zero {cost}"))),
        (_, Predictor::Oracle, _) => format!("{}\npredictor = \"oracle\"", planner(&format!("--init zero {cost}"))),
    }
}

#[cfg(test)]
mod tests {
    use super::super::read;
    use super::*;

    fn outcomes() -> Vec<Outcome> {
        let list = r#"
            [[run]]
            name = "dipp"
            [[run]]
            name = "zero"
            settings = { initial_controls = "zero" }
            [[run]]
            name = "ctrv"
            settings = { predictor = "ctrv" }
            [[run]]
            name = "broken"
        "#;
        let last = (1..=9).map(|index| (format!("w{index}"), format!("0.{index}"))).collect::<Vec<_>>();
        let failure = |name: &str| (name == "broken").then(|| "nothing".to_owned());
        let outcome = |run: super::super::Run| Outcome { failure: failure(&run.name), last: last.clone(), run };
        read(list).unwrap().into_iter().map(outcome).collect()
    }

    #[test]
    fn each_training_that_ended_has_an_entry_that_can_drive() {
        let text = of(&outcomes());
        let table: toml::Table = toml::from_str(&text).unwrap();
        let entrants = table["entrant"].as_array().unwrap();
        let field = |index: usize, name: &str| entrants[index].get(name).and_then(|value| value.as_str());
        assert_eq!(entrants.len(), 3, "{text}");
        assert_eq!((field(0, "driver"), field(0, "weights")), (Some("dipp"), Some("dipp/weights.safetensors")));
        assert_eq!(field(1, "predictor"), Some("network"));
        assert!(field(1, "planner-command").unwrap().ends_with("--init zero --weights learned"), "{text}");
        assert!(field(2, "planner-command").unwrap().contains("'{here}/ctrv/cost.toml'"), "{text}");
        assert_eq!((field(2, "predictor"), field(2, "weights")), (Some("ctrv"), None));
    }

    #[test]
    fn the_cost_is_a_number_a_term() {
        let cost: toml::Table = toml::from_str(&cost(&outcomes()[0]).unwrap()).unwrap();
        assert_eq!((cost.len(), cost["speed"].as_float(), cost["safety"].as_float()), (9, Some(0.1), Some(0.9)));
    }
}
