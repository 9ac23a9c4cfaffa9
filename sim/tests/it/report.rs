//! `sim report` over run folders that were written, not driven.

use std::fs;

use wire::proto::EndReason;

use crate::compare::{drive, finished, strikes, two_runs};
use crate::sim;

#[test]
fn two_runs_are_figures_a_comparison_and_a_table_without_players() {
    let folder = tempfile::tempdir().unwrap();
    two_runs(folder.path());
    // Nobody drove these scenes: they are nowhere.
    let told = sim(folder.path(), &["report", "main", "change"]);
    assert!(told.starts_with("code 0\n--- stdout\nreport.html: ") && told.contains(" 0 drives to be played"), "{told}");
    assert!(told.contains("note: main has no player: scene scene-"), "{told}");
    let page = fs::read_to_string(folder.path().join("report.html")).unwrap();
    for part in
        ["Drive report: main against change", "2 new failures, 1 mended in 23 scenes", "id=\"distributions\"", "at red"]
    {
        assert!(page.contains(part), "{part}");
    }
    // The same figures as the other commands have.
    let table = sim(folder.path(), &["table", "main", "--format", "csv"]);
    let progress: f64 = table.lines().nth(3).unwrap().split(',').nth(12).unwrap().parse().unwrap();
    assert!(page.contains(&format!("<td>{progress:.1}</td>")), "{progress}");
}

#[test]
fn names_and_sentences_with_markup_are_text() {
    let folder = tempfile::tempdir().unwrap();
    let evil = "<img src=x onerror=alert(1)>";
    let drives = [drive(evil, 8.0, |part| {
        strikes(part);
        let end = part.end.as_mut().unwrap();
        (end.reason, end.detail) =
            (EndReason::Collision.into(), "step 9: </script><script>alert(2)</script>".to_owned());
    })];
    finished(folder.path(), "run", &drives, |file| file.settings.driver = "\"><svg onload=alert(3)>".to_owned());
    assert!(sim(folder.path(), &["report", "run", "--html", "x.html"]).starts_with("code 0\n"));
    let page = fs::read_to_string(folder.path().join("x.html")).unwrap();
    for evil in ["<img", "<svg onload", "alert(2)</script>", "<script>alert"] {
        assert!(!page.contains(evil), "{evil}");
    }
    assert!(page.contains("&lt;img src=x onerror=alert(1)&gt;") && page.contains("default-src 'none'"));
}

#[test]
fn what_is_not_finished_is_passed_over_and_an_episode_that_nobody_drove_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    two_runs(folder.path());
    fs::remove_file(folder.path().join("change/digest")).unwrap();
    let told = sim(folder.path(), &["report", "main", "change"]);
    assert!(
        told.starts_with("code 0\n") && told.contains("note: passed over, because there is no finished run: change"),
        "{told}"
    );
    insta::assert_snapshot!(sim(folder.path(), &["report", "change"]), @"
    code 2
    --- stdout
    --- stderr
    error: the run in change is not finished
    hint: repeat the command it was begun with, and it is continued
    ");
    insta::assert_snapshot!(sim(folder.path(), &["report", "main", "--episodes", "nobody"]), @"
    code 2
    --- stdout
    --- stderr
    error: no run has an episode nobody
    hint: `sim table --scenes RUN` lists them
    ");
}

/// How long it takes: `cargo nextest run --run-ignored only ten_thousand`, and `RELOOP_KEEP=DIR` keeps the runs.
#[test]
#[ignore = "writes two runs of ten thousand episodes"]
fn ten_thousand_episodes_make_a_page() {
    let folder = tempfile::tempdir().unwrap();
    let kept = std::env::var_os("RELOOP_KEEP").map(std::path::PathBuf::from);
    let root = kept.as_deref().unwrap_or(folder.path());
    for (name, shift) in [("a", 0), ("b", 3)] {
        let one = |at: u32| {
            let speed = f64::from((at * 7 + shift) % 11) + 5.0;
            if (at + shift).is_multiple_of(13) {
                drive(&format!("scene-{at:05}"), speed, strikes)
            } else {
                drive(&format!("scene-{at:05}"), speed, |_| {})
            }
        };
        finished(root, name, &(0..10_000).map(one).collect::<Vec<_>>(), |_| {});
    }
    let told = sim(root, &["report", "a", "b"]);
    assert!(told.starts_with("code 0\n"), "{told}");
}
