//! Scores against latency: what runs of the same drivers are worth when their plans take effect later, drawn. SVG, whole by itself.

use episode::latency::Latency;
use plotters::prelude::*;
use results::summary::Summary;
use thiserror::Error;

/// A plot that cannot be drawn.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum LatencyPlotError {
    #[error(
        "score against latency needs a driver with runs at two latencies at least\nhint: sim matrix --latency 0,50ms,100ms,200ms,500ms makes them"
    )]
    TooFew,
    #[error(
        "these runs are under different protocols, over different scenes or by different settings: one plot would mix what cannot be compared"
    )]
    Different,
    #[error("the plot cannot be drawn: {0}")]
    Drawing(String),
}

/// What is drawn: the metric, its name, what it is multiplied by.
const PANELS: [(&str, &str, f64); 4] = [
    ("nuplan_score", "nuPlan score", 1.0),
    ("at_fault_collision", "at-fault collisions (%)", 100.0),
    ("progress_m", "progress (m)", 1.0),
    ("mean_abs_jerk_mps3", "jerk (m/s³)", 1.0),
];

/// Pixels.
const PANEL: (u32, u32) = (420, 300);
const LEGEND: u32 = 26;

/// Told apart by whoever does not tell red from green (Okabe and Ito).
const COLOURS: [RGBColor; 7] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(90, 90, 90),
];

/// A driver's runs among the same traffic by how late its plans are (ms), ascending.
struct Line<'r> {
    name: String,
    runs: Vec<(f64, &'r Summary)>,
}

impl Line<'_> {
    /// Whether there are two latencies, and not the same one under two protocols.
    fn is_a_sweep(&self) -> bool {
        self.runs.windows(2).any(|pair| pair[0].1.latency != pair[1].1.latency)
    }
}

/// Whether `runs` can tell score against latency: one driver at least has runs at two latencies.
#[must_use]
pub fn is_a_sweep(runs: &[Summary]) -> bool {
    lines(runs).iter().any(Line::is_a_sweep)
}

/// The plot of `runs`, a line a driver and traffic.
///
/// # Errors
/// [`LatencyPlotError`].
pub fn plot(runs: &[Summary]) -> Result<String, LatencyPlotError> {
    let [first, rest @ ..] = runs else { return Err(LatencyPlotError::TooFew) };
    let rules = |run: &Summary| (run.protocol.clone(), run.changes.clone(), run.scenes.clone());
    if rest.iter().any(|run| rules(run) != rules(first)) {
        return Err(LatencyPlotError::Different);
    }
    let lines = lines(runs);
    if !lines.iter().any(Line::is_a_sweep) {
        return Err(LatencyPlotError::TooFew);
    }
    let mut svg = String::new();
    draw(&mut svg, &lines, first.scenes.len()).map_err(LatencyPlotError::Drawing)?;
    Ok(svg)
}

/// The runs by driver and traffic, in their order.
fn lines(runs: &[Summary]) -> Vec<Line<'_>> {
    let mut lines: Vec<Line<'_>> = Vec::new();
    for run in runs {
        let place = (delay_ms(run), run);
        let name = match &run.traffic {
            None => run.driver.clone(),
            Some(traffic) => format!("{}, traffic {traffic}", run.driver),
        };
        match lines.iter_mut().find(|line| line.name == name) {
            Some(line) => line.runs.push(place),
            None => lines.push(Line { name, runs: vec![place] }),
        }
    }
    lines.iter_mut().for_each(|line| line.runs.sort_by(|one, other| one.0.total_cmp(&other.0)));
    lines
}

/// How late plans are (ms): as it was fixed, or as old as they were in the mean.
fn delay_ms(run: &Summary) -> f64 {
    match &run.latency {
        None => 0.0,
        Some(Latency::Fixed(delay_us)) => f64::from(*delay_us) / 1e3,
        Some(_) => run.mean("mean_plan_age_s").map_or(0.0, |(age, _)| 1e3 * age),
    }
}

fn draw(svg: &mut String, lines: &[Line<'_>], scenes: usize) -> Result<(), String> {
    let told = |error: &dyn std::fmt::Display| error.to_string();
    let legend = LEGEND * (lines.len() as u32 + 1);
    let size = (2 * PANEL.0, 2 * PANEL.1 + legend);
    let root = SVGBackend::with_string(svg, size).into_drawing_area();
    root.fill(&WHITE).map_err(|error| told(&error))?;
    let (head, body) = root.split_vertically(legend);
    let text = |area: &DrawingArea<_, _>, words: String, place: (i32, i32), colour: &RGBColor| {
        area.draw(&Text::new(words, place, ("sans-serif", 21).into_font().color(colour))).map_err(|error| told(&error))
    };
    text(&head, format!("Score against latency, mean over {scenes} scenes"), (16, 8), &BLACK)?;
    for (index, line) in lines.iter().enumerate() {
        let (y, colour) = (LEGEND as i32 * (index as i32 + 1) + 8, COLOURS[index % COLOURS.len()]);
        let stroke = PathElement::new(vec![(16, y + 8), (44, y + 8)], colour.stroke_width(3));
        head.draw(&stroke).map_err(|error| told(&error))?;
        text(&head, line.name.clone(), (54, y), &BLACK)?;
    }
    for (area, panel) in body.split_evenly((2, 2)).iter().zip(PANELS) {
        panel_of(area, panel, lines).map_err(|error| told(&error))?;
    }
    root.present().map_err(|error| told(&error))
}

/// One metric.
fn panel_of<B: DrawingBackend>(
    area: &DrawingArea<B, plotters::coord::Shift>,
    (metric, name, scale): (&str, &str, f64),
    lines: &[Line<'_>],
) -> Result<(), DrawingAreaErrorKind<B::ErrorType>> {
    let points = |line: &Line<'_>| -> Vec<(f64, f64)> {
        let point = |(delay, run): &(f64, &Summary)| Some((*delay, scale * run.mean(metric)?.0));
        line.runs.iter().filter_map(point).collect()
    };
    let all: Vec<(f64, f64)> = lines.iter().flat_map(points).collect();
    let most =
        |values: &dyn Fn(&(f64, f64)) -> f64| all.iter().map(values).fold(0.0, |a: f64, b| if b > a { b } else { a });
    let (right, top) = (most(&|point| point.0), most(&|point| point.1));
    let (right, top) = (if right > 0.0 { 1.04 * right } else { 1.0 }, if top > 0.0 { 1.06 * top } else { 1.0 });
    let mut chart = ChartBuilder::on(area)
        .margin(14)
        .caption(name, ("sans-serif", 21))
        .x_label_area_size(38)
        .y_label_area_size(46)
        .build_cartesian_2d(0.0..right, 0.0..top)?;
    let digits = usize::from(top < 20.0) + usize::from(top < 2.0);
    chart
        .configure_mesh()
        .x_desc("latency (ms)")
        .x_labels(6)
        .y_labels(5)
        .x_label_formatter(&|value| format!("{value:.0}"))
        .y_label_formatter(&|value| format!("{value:.digits$}"))
        .light_line_style(TRANSPARENT)
        .label_style(("sans-serif", 17))
        .draw()?;
    for (index, line) in lines.iter().enumerate() {
        let colour = COLOURS[index % COLOURS.len()];
        chart.draw_series([PathElement::new(points(line), colour.stroke_width(2))])?;
        chart.draw_series(points(line).into_iter().map(|point| Circle::new(point, 4, colour.filled())))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table::tests::run;

    fn late(driver: &str, latency: &str) -> Summary {
        let mut run = run(driver, "bicycle", "runs/x");
        run.latency = Some(latency.parse().unwrap());
        run
    }

    #[test]
    fn a_driver_is_a_line_and_names_are_escaped() {
        let mut measured = late("<idm>", "measured");
        measured.means.insert("mean_plan_age_s".to_owned(), Some((0.25, 8)));
        let runs = [late("<idm>", "500ms"), run("<idm>", "bicycle", "runs/x"), measured, late("dipp", "500ms")];
        let lines = lines(&runs);
        assert_eq!(lines[0].runs.iter().map(|run| run.0).collect::<Vec<_>>(), [0.0, 250.0, 500.0]);
        let svg = plot(&runs).unwrap();
        assert!(svg.starts_with("<svg") && svg.contains("&lt;idm&gt;") && !svg.contains("<idm>"), "{svg}");
        // Each of the four panels has the line and its three points, and the point of who has but one run.
        assert_eq!(svg.matches("<circle").count(), 4 * 4, "{svg}");
    }

    #[test]
    fn other_traffic_is_another_line() {
        let among = |traffic: Option<&str>, mut run: Summary| {
            run.traffic = traffic.map(str::to_owned);
            run
        };
        let (now, then) = (run("idm", "bicycle", "runs/x"), late("idm", "80ms"));
        let reactive = [among(Some("mixed, seed 7"), now.clone()), among(Some("mixed, seed 7"), then.clone())];
        let runs = [&[now, then][..], &reactive].concat();
        let lines = lines(&runs);
        let told: Vec<_> = lines.iter().map(|line| (&*line.name, line.runs.len())).collect();
        assert_eq!(told, [("idm", 2), ("idm, traffic mixed, seed 7", 2)]);
    }

    #[test]
    fn what_cannot_be_compared_is_not_drawn() {
        let usual = run("idm", "bicycle", "runs/x");
        assert!(matches!(plot(&[usual.clone(), late("dipp", "80ms")]), Err(LatencyPlotError::TooFew)));
        assert!(!is_a_sweep(std::slice::from_ref(&usual)) && is_a_sweep(&[usual.clone(), late("idm", "80ms")]));
        // The same driver twice, as under two protocols.
        assert!(!is_a_sweep(&[usual.clone(), usual.clone()]));
        let mut other = late("idm", "80ms");
        other.changes.push("horizon = 80".to_owned());
        assert!(matches!(plot(&[usual, other]), Err(LatencyPlotError::Different)));
    }
}
