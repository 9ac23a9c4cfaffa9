//! What text and Markdown share: numbers as people read them, and sentences.

use super::comparison::{Comparison, Flip, Side};
use super::figures::{Figure, Verdict};
use super::gate::Gate;
use super::statistics::{Interval, LEVEL};

/// Names that are listed before the rest is counted.
const NAMED: usize = 10;

/// With fewer pairs intervals by resampling are too narrow.
const SMALL: usize = 20;

/// `1 scene`, `2 scenes`.
pub(crate) fn counted(count: usize, what: &str) -> String {
    if count == 1 { format!("1 {what}") } else { format!("{count} {what}s") }
}

/// The flips in a few words.
pub(crate) fn headline(comparison: &Comparison) -> String {
    let (new, mended) = (comparison.new_failures.len(), comparison.mended.len());
    let scenes = counted(comparison.pairs, "scene");
    if comparison.alike == comparison.pairs {
        return format!("no difference: B drives exactly as A in {scenes}");
    }
    format!("{}, {mended} mended in {scenes}", counted(new, "new failure"))
}

/// What McNemar's test says of the flips.
pub(crate) fn test(comparison: &Comparison) -> String {
    let (new, mended) = (comparison.new_failures.len(), comparison.mended.len());
    let p = format!("McNemar's exact test: {}", chance(comparison.mcnemar_p));
    if comparison.mcnemar_p < LEVEL {
        return format!("{p}: B passes {} scenes than A", if new > mended { "fewer" } else { "more" });
    }
    let (needed, n) = (comparison.flips_needed, comparison.pairs);
    let others = new.min(mended);
    format!("{p}: not distinguishable at n = {n} (p < {LEVEL} takes {needed} flips one way beside {others} the other)")
}

/// A chance.
fn chance(p: f64) -> String {
    if p < 0.001 { "p < 0.001".to_owned() } else { format!("p = {p:.3}") }
}

/// How many scenes of the pairs a run passes, with Wilson's interval.
pub(crate) fn passed(side: &Side, pairs: usize) -> [String; 3] {
    let interval = side.pass_interval.map(|at| format!("{:.1} to {:.1} %", 100.0 * at.low, 100.0 * at.high));
    let rate = format!("{:.1} %", 100.0 * side.pass_rate);
    [format!("{} of {pairs}", side.passed), rate, interval.unwrap_or_default()]
}

/// What went wrong in a flipped scene.
pub(crate) fn why(flip: &Flip) -> String {
    let fault = |happened: &super::comparison::Happened| match &*happened.detail {
        "" => happened.fault.name().to_owned(),
        detail => format!("{}: {detail}", happened.fault.name()),
    };
    flip.faults.iter().map(fault).collect::<Vec<_>>().join("; ")
}

/// Where the drives of a flipped scene part.
pub(crate) fn parting(flip: &Flip) -> String {
    flip.part_at_step.map_or_else(|| "-".to_owned(), |step| format!("step {step}"))
}

/// The figures of these verdicts, but for the pass rate, which stands above.
pub(crate) fn figures<'a>(comparison: &'a Comparison, verdicts: &[Verdict]) -> Vec<&'a Figure> {
    let wanted = |figure: &&Figure| figure.name != super::figures::PASSED && verdicts.contains(&figure.verdict);
    comparison.figures.iter().filter(wanted).collect()
}

/// The cells of a figure: its name, A, B, B - A, the interval, the detectable difference, p, n.
pub(crate) fn cells(figure: &Figure) -> [String; 8] {
    let share = figure.is_share();
    let scale = if share { 100.0 } else { 1.0 };
    let size = figure.a.into_iter().chain(figure.b).map(|value| (scale * value).abs()).fold(0.0, f64::max);
    // Three figures that count or more; of what is next to nothing two, and its size.
    let digits = match size {
        _ if share => 1,
        size if size >= 100.0 => 1,
        size if size >= 10.0 => 2,
        size if size >= 0.1 || size == 0.0 => 3,
        _ => 4,
    };
    let tiny = !share && size > 0.0 && size < 0.01;
    let plain = |value: Option<f64>, unit: &str| match value {
        None => "-".to_owned(),
        Some(value) if tiny => format!("{value:.1e}"),
        Some(value) => format!("{:.digits$}{unit}", scale * value),
    };
    let signed = |value: f64| {
        if tiny { format!("{value:+.1e}") } else { format!("{:+.digits$}", scale * value) }
    };
    let between = |at: Interval| format!("{} to {}", signed(at.low), signed(at.high));
    let percent = if share { "%" } else { "" };
    [
        figure.name.to_owned(),
        plain(figure.a, percent),
        plain(figure.b, percent),
        figure.difference.map_or_else(|| "-".to_owned(), signed),
        figure.interval.map_or_else(|| "-".to_owned(), between),
        plain(figure.detectable, ""),
        figure.p.map_or_else(|| "-".to_owned(), |p| if p < 0.001 { "<0.001".to_owned() } else { format!("{p:.3}") }),
        figure.pairs.to_string(),
    ]
}

/// The figures of all, counted by verdict.
pub(crate) fn tally(comparison: &Comparison) -> String {
    let count = |verdict| figures(comparison, &[verdict]).len();
    let open = count(Verdict::NotDistinguishable);
    let told = count(Verdict::Better) + count(Verdict::Worse);
    let (better, worse) = (count(Verdict::Better), count(Verdict::Worse));
    let figures = counted(told + open, "figure");
    format!(
        "{figures} differ: {better} better, {worse} worse, {open} not distinguishable; chance alone makes up to 1 in 20 look better or worse"
    )
}

/// Names, the first ten of them.
fn names<'a>(names: impl ExactSizeIterator<Item = &'a String>) -> String {
    let rest = names.len().saturating_sub(NAMED);
    let named: Vec<&str> = names.take(NAMED).map(String::as_str).collect();
    let rest = if rest > 0 { format!(" and {rest} more (all: --format json)") } else { String::new() };
    named.join(", ") + &rest
}

/// How the figures were made, and what else is to be known of the runs: a sentence each.
pub(crate) fn notes(comparison: &Comparison) -> Vec<String> {
    let (a, b) = (&comparison.a, &comparison.b);
    let mut notes = Vec::new();
    let shown = figures(comparison, &[Verdict::Better, Verdict::Worse, Verdict::NotDistinguishable]);
    if !shown.is_empty() {
        let resamples = shown.iter().map(|figure| figure.resamples);
        let (least, most) = (resamples.clone().min().unwrap_or(0), resamples.max().unwrap_or(0));
        let seed = comparison.seed;
        let [few, many] = [least, most].map(thousands);
        let resamples = if least == most { many } else { format!("{few} to {many} (the larger n, the fewer)") };
        notes.push(format!("95 % interval of B - A: BCa bootstrap over the pairs, {resamples} resamples, seed {seed}"));
        notes.push("detectable: the difference that n pairs with this spread show four times out of five".to_owned());
        let told = format!("told apart: p < {LEVEL}, and the interval leaves out 0");
        notes.push(format!("p: how often chance alone makes at least such a difference (exact test); {told}"));
    }
    if shown.iter().any(|figure| figure.is_share()) {
        notes.push("shares of scenes (%) differ in percentage points".to_owned());
    }
    if comparison.pairs < SMALL && !shown.is_empty() {
        let n = comparison.pairs;
        notes.push(format!("n = {n} is small: below {SMALL} pairs the intervals are too narrow; p holds at any n"));
    }
    if a.traffic != b.traffic {
        notes.push(
            "another traffic in A than in B: figures among one are not to be held against those among the other"
                .to_owned(),
        );
    }
    let left = &comparison.left_out;
    for (scenes, what) in [
        (&left.only_a, "in A alone"),
        (&left.only_b, "in B alone"),
        (&left.other_content, "with other content in B than in A, left out"),
        (&left.undrivable, "not drivable, left out"),
    ] {
        if !scenes.is_empty() {
            notes.push(format!("{} {what}: {}", counted(scenes.len(), "scene"), names(scenes.iter())));
        }
    }
    for (side, name) in [(a, "A"), (b, "B")] {
        let failed = &side.driver_failed;
        if !failed.is_empty() {
            let scenes = counted(failed.len(), "scene");
            notes.push(format!(
                "the driver failed in {scenes} of {name} (failures, without other figures): {}",
                names(failed.keys())
            ));
        }
    }
    for (what, there, here) in [
        ("motion", a.motion.to_owned(), b.motion.to_owned()),
        ("latency", a.latency.clone(), b.latency.clone()),
        ("deadline", format!("{} s", a.deadline_s), format!("{} s", b.deadline_s)),
        ("build", a.build.clone(), b.build.clone()),
    ] {
        if there != here {
            notes.push(format!("another {what}: {there} in A, {here} in B"));
        }
    }
    notes
}

/// A count, with a comma after the thousands.
fn thousands(count: usize) -> String {
    if count < 1_000 { count.to_string() } else { format!("{},{:03}", count / 1_000, count % 1_000) }
}

/// A gate in a line.
pub(crate) fn gate(gate: &Gate) -> String {
    let sign = if gate.hit { "FAIL" } else { "ok" };
    format!("{sign}: {}: {}", gate.rule, gate.finding)
}

/// Among whom both drove, where anybody reacted.
fn traffic(Comparison { a, b, .. }: &Comparison) -> Option<String> {
    let name = |side: &Side| side.traffic.clone().unwrap_or_else(|| "replayed".to_owned());
    (a.traffic.is_some() || b.traffic.is_some()).then(|| match (name(a), name(b)) {
        (there, here) if there == here => format!("traffic {here}"),
        (there, here) => format!("another traffic (A: {there}; B: {here})"),
    })
}

/// What was compared, in a line.
pub(crate) fn rules(comparison: &Comparison) -> String {
    let mut parts = vec![format!("protocol {}", comparison.protocol)];
    parts.extend(comparison.settings.iter().cloned());
    parts.extend(traffic(comparison));
    parts.push(counted(comparison.pairs, "paired scene"));
    parts.push(format!("{} driven alike", comparison.alike));
    parts.join(", ")
}
