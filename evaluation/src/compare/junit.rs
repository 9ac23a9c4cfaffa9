//! A comparison as JUnit XML, for whatever shows tests: a test case a scene, and one a gate.

use std::collections::BTreeMap;

use quick_junit::{NonSuccessKind, Report, SerializeError, TestCase, TestCaseStatus, TestSuite};

use super::comparison::{Comparison, Flip, Scene};
use super::gate::Gate;
use super::sentences;

/// The report: new failures fail, what fails in both runs or is not paired is skipped, with the reason; a gate that is hit fails.
///
/// # Errors
/// [`SerializeError`], of which none is known.
pub fn render(comparison: &Comparison, gates: &[Gate]) -> Result<String, SerializeError> {
    let mut scenes = TestSuite::new("scenes");
    let flips: BTreeMap<&str, &Flip> = comparison.new_failures.iter().map(|flip| (&*flip.scene, flip)).collect();
    let driver = &*comparison.b.driver;
    scenes.add_test_cases(comparison.scenes.iter().map(|scene| case(driver, scene, flips.get(&*scene.scene).copied())));
    let left = &comparison.left_out;
    for (names, why) in [
        (&left.only_a, "in A alone"),
        (&left.only_b, "in B alone"),
        (&left.other_content, "other content in B than in A"),
        (&left.undrivable, "not drivable"),
    ] {
        scenes.add_test_cases(names.iter().map(|name| named(driver, name, skipped(why.to_owned()))));
    }
    let mut report = Report::new("sim compare");
    report.add_test_suite(scenes);
    if !gates.is_empty() {
        let mut rules = TestSuite::new("gates");
        rules.add_test_cases(gates.iter().map(|gate| {
            let status = if gate.hit { failure("gate", gate.finding.clone()) } else { TestCaseStatus::success() };
            named("gates", &gate.rule, status)
        }));
        report.add_test_suite(rules);
    }
    report.to_string()
}

fn named(class: &str, name: &str, status: TestCaseStatus) -> TestCase {
    let mut case = TestCase::new(name, status);
    case.set_classname(class);
    case
}

fn skipped(why: String) -> TestCaseStatus {
    let mut status = TestCaseStatus::skipped();
    status.set_message(why);
    status
}

fn failure(kind: &str, message: String) -> TestCaseStatus {
    let mut status = TestCaseStatus::non_success(NonSuccessKind::Failure);
    status.set_type(kind).set_message(message);
    status
}

fn case(driver: &str, scene: &Scene, flip: Option<&Flip>) -> TestCase {
    let status = match (scene.a.is_empty(), scene.b.is_empty()) {
        (_, true) => TestCaseStatus::success(),
        (true, false) => {
            let mut status = failure("new-failure", flip.map(sentences::why).unwrap_or_default());
            if let Some(step) = flip.and_then(|flip| flip.part_at_step) {
                status.set_description(format!("the drives part at step {step}"));
            }
            status
        }
        (false, false) => {
            let faults: Vec<&str> = scene.b.iter().map(|fault| fault.name()).collect();
            skipped(format!("fails in A too: {}", faults.join(", ")))
        }
    };
    named(driver, &scene.scene, status)
}
