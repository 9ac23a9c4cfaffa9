//! Boxplots, a metric each, as in the paper's figures: a box from the first to the third quartile with a line at the median, whiskers to
//! the last values within one and a half times its length, and dots beyond. SVG whose colours are the page's.

use plotters::prelude::*;
use thiserror::Error;

/// A plot that could not be drawn.
#[derive(Debug, Error)]
#[error("the plot of {metric} cannot be drawn: {why}")]
pub struct PlotError {
    /// What it would show.
    pub metric: String,
    /// Why not.
    pub why: String,
}

/// Stand for the page's colours in what the library writes.
const INK: RGBColor = RGBColor(1, 1, 1);
const MUTED: RGBColor = RGBColor(2, 2, 2);
const LINE: RGBColor = RGBColor(3, 3, 3);
const BOX: RGBColor = RGBColor(4, 4, 4);
const TINT: RGBColor = RGBColor(5, 5, 5);
const PAGE_COLOURS: [(&str, &str); 5] = [
    ("#010101", "currentColor"),
    ("#020202", "var(--muted)"),
    ("#030303", "var(--line)"),
    ("#040404", "var(--accent)"),
    ("#050505", "var(--tint)"),
];

/// Units of the drawing, two a pixel of the page: across, down a run, and of the axis.
const WIDTH: u32 = 640;
const ROW: u32 = 92;
const AXIS: u32 = 56;
const FONT: u32 = 30;
/// Dots that are drawn beyond the whiskers of a run; more would be a smear, and megabytes.
const MOST_DOTS: usize = 300;
/// With more digits than these a number is written with its power of ten.
const MOST_DIGITS: usize = 4;

/// A run's values.
#[derive(Clone, Debug)]
pub struct Sample {
    /// What the run is called.
    pub label: String,
    /// Its values, ascending.
    values: Vec<f64>,
}

/// Where a box and its whiskers are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Box5 {
    /// The end of the lower whisker.
    pub low: f64,
    /// A quarter lies below.
    pub first: f64,
    /// Half lies below.
    pub median: f64,
    /// Three quarters lie below.
    pub third: f64,
    /// The end of the upper whisker.
    pub high: f64,
}

impl Sample {
    /// A run's values; those that are none are left out.
    #[must_use]
    pub fn new(label: String, values: impl Iterator<Item = f64>) -> Self {
        let mut values: Vec<f64> = values.filter(|value| value.is_finite()).collect();
        values.sort_by(f64::total_cmp);
        Self { label, values }
    }

    /// How many values it has.
    #[must_use]
    pub fn count(&self) -> usize {
        self.values.len()
    }

    /// Its box; none where there is no value.
    #[must_use]
    pub fn boxed(&self) -> Option<Box5> {
        let [first, median, third] = [0.25, 0.5, 0.75].map(|share| quantile(&self.values, share));
        let (first, median, third) = (first?, median?, third?);
        let reach = 1.5 * (third - first);
        let low = self.values.iter().copied().find(|value| *value >= first - reach)?;
        let high = self.values.iter().copied().rev().find(|value| *value <= third + reach)?;
        Some(Box5 { low, first, median, third, high })
    }
}

/// Between the two values on either side, as NumPy has it.
fn quantile(ascending: &[f64], share: f64) -> Option<f64> {
    let place = share * ascending.len().checked_sub(1)? as f64;
    let (below, above) = (ascending.get(place.floor() as usize)?, ascending.get(place.ceil() as usize)?);
    Some(below + (above - below) * place.fract())
}

/// The samples below each other, as SVG; none where nobody has a value.
///
/// # Errors
/// [`PlotError`] where the library gives up.
pub fn boxplots(metric: &str, samples: &[Sample]) -> Result<Option<String>, PlotError> {
    let ends = samples.iter().filter_map(|sample| Some((*sample.values.first()?, *sample.values.last()?)));
    let Some((low, high)) = ends.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1))) else { return Ok(None) };
    let margin = if high > low { 0.03 * (high - low) } else { 0.5 };
    let mut svg = String::new();
    draw(&mut svg, (low - margin)..(high + margin), samples)
        .map_err(|why| PlotError { metric: metric.to_owned(), why })?;
    for (stand_in, colour) in PAGE_COLOURS {
        svg = svg.replace(stand_in, colour);
    }
    Ok(Some(svg))
}

fn draw(svg: &mut String, range: std::ops::Range<f64>, samples: &[Sample]) -> Result<(), String> {
    let told = |error: &dyn std::fmt::Display| error.to_string();
    let rows = samples.len() as u32;
    let root = SVGBackend::with_string(svg, (WIDTH, rows * ROW + AXIS)).into_drawing_area();
    let start = range.start;
    let mut chart = ChartBuilder::on(&root)
        .margin_left(8)
        .margin_right(12)
        .x_label_area_size(AXIS)
        .build_cartesian_2d(range.clone(), 0.0..f64::from(rows))
        .map_err(|error| told(&error))?;
    let digits = tick_digits(range.end - range.start);
    chart
        .configure_mesh()
        .disable_y_mesh()
        .disable_y_axis()
        .x_labels(5)
        .x_label_formatter(&|value| {
            if digits > MOST_DIGITS { format!("{value:.1e}") } else { format!("{value:.digits$}") }
        })
        .light_line_style(TRANSPARENT)
        .bold_line_style(LINE.stroke_width(1))
        .axis_style(LINE.stroke_width(2))
        .label_style(("sans-serif", FONT).into_font().color(&MUTED))
        .draw()
        .map_err(|error| told(&error))?;
    for (index, sample) in samples.iter().enumerate() {
        let middle = f64::from(rows) - index as f64 - 0.68;
        let label = format!("{}  n = {}", sample.label, sample.count());
        let style = ("sans-serif", FONT).into_font().color(&INK);
        chart.plotting_area().draw(&Text::new(label, (start, middle + 0.6), style)).map_err(|error| told(&error))?;
        let Some(Box5 { low, first, median, third, high }) = sample.boxed() else { continue };
        let (top, bottom) = (middle + 0.17, middle - 0.17);
        let line = |points: Vec<(f64, f64)>, width: u32| PathElement::new(points, BOX.stroke_width(width));
        let area = |style: ShapeStyle| Rectangle::new([(first, top), (third, bottom)], style);
        let mut shapes = vec![
            line(vec![(low, middle), (first, middle)], 2),
            line(vec![(third, middle), (high, middle)], 2),
            line(vec![(median, top), (median, bottom)], 6),
        ];
        shapes.extend([low, high].map(|end| line(vec![(end, middle + 0.09), (end, middle - 0.09)], 2)));
        chart.draw_series([area(TINT.filled()), area(BOX.stroke_width(2))]).map_err(|error| told(&error))?;
        chart.draw_series(shapes).map_err(|error| told(&error))?;
        let beyond: Vec<f64> = sample.values.iter().copied().filter(|value| *value < low || *value > high).collect();
        let every = beyond.len().div_ceil(MOST_DOTS).max(1);
        let dots = beyond.iter().step_by(every).map(|value| Circle::new((*value, middle), 4, BOX.stroke_width(2)));
        chart.draw_series(dots).map_err(|error| told(&error))?;
    }
    root.present().map_err(|error| told(&error))
}

/// As many digits as tell five ticks apart.
fn tick_digits(span: f64) -> usize {
    const SPANS: [f64; 6] = [10.0, 1.0, 0.1, 0.01, 0.001, 0.0001];
    SPANS.iter().position(|least| span > *least).unwrap_or(SPANS.len())
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    fn sample(values: &[f64]) -> Sample {
        Sample::new("idm".to_owned(), values.iter().copied())
    }

    #[test]
    fn whiskers_end_at_the_last_value_within_reach_and_quartiles_are_numpys() {
        // numpy.percentile([1, 2, 3, 4, 5, 100], [25, 50, 75]) is 2.25, 3.5, 4.75.
        let boxed = sample(&[100.0, 3.0, 1.0, 2.0, 5.0, 4.0, f64::NAN]).boxed().unwrap();
        assert_eq!(boxed, Box5 { low: 1.0, first: 2.25, median: 3.5, third: 4.75, high: 5.0 });
        assert_eq!(sample(&[]).boxed(), None);
        let one = sample(&[7.0]).boxed().unwrap();
        assert_eq!((one.low, one.median, one.high), (7.0, 7.0, 7.0));
    }

    #[test]
    fn a_plot_has_the_pages_colours_and_escapes_labels() {
        let evil = Sample::new("<script>".to_owned(), [1.0, 2.0, 3.0, 50.0].into_iter());
        let svg = boxplots("progress", &[evil, sample(&[2.0, 2.0])]).unwrap().unwrap();
        assert!(svg.contains("currentColor") && svg.contains("var(--accent)") && !svg.contains("<script"), "{svg}");
        assert!(!svg.contains("#0"), "{svg}");
        assert_eq!(boxplots("progress", &[sample(&[])]).unwrap(), None);
    }
}
