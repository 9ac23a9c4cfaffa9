//! What changes from step to step, gathered as columns: a row a step, sent as one chunk an entity.

use re_chunk::{EntityPath, TimeColumn};
use re_sdk_types::archetypes::{Boxes3D, LineStrips3D, Points3D, Scalars, TextLog, Transform3D};
use re_sdk_types::components::{Color, FillMode, LineStrip3D, Radius};
use re_sdk_types::datatypes::Quaternion;
use rrd::{RrdError, Store, color};
use wire::proto;

use crate::message::STEP_NANOSECONDS;
use crate::origin::{Origin, quaternion};
use crate::palette::Rgba;

/// The two timelines of rows at `steps`.
fn times(steps: &[u32]) -> Vec<TimeColumn> {
    let nanoseconds = steps.iter().map(|step| i64::from(*step) * STEP_NANOSECONDS as i64);
    vec![
        TimeColumn::new_sequence("step", steps.iter().map(|step| i64::from(*step))),
        TimeColumn::new_duration_nanos("sim_time", nanoseconds),
    ]
}

/// The rows of one entity: at which step, and how many instances.
#[derive(Default)]
struct Rows {
    steps: Vec<u32>,
    lengths: Vec<usize>,
    /// Rows before these had instances: then one without any says that they are gone.
    follow_others: bool,
}

impl Rows {
    fn push(&mut self, step: u32, length: usize) {
        self.steps.push(step);
        self.lengths.push(length);
    }

    /// Whether there is nothing to show, and nothing to take away.
    fn is_blank(&self) -> bool {
        self.steps.is_empty() || !self.follow_others && self.lengths.iter().all(|length| *length == 0)
    }

    /// No rows yet, to follow these.
    fn next(&self) -> Self {
        let follow_others = self.follow_others || self.lengths.iter().any(|length| *length > 0);
        Self { follow_others, ..Self::default() }
    }
}

/// Boxes of one colour.
#[derive(Default)]
pub struct Boxes {
    rows: Rows,
    centers: Vec<[f32; 3]>,
    half_sizes: Vec<[f32; 3]>,
    turns: Vec<Quaternion>,
    labels: Vec<String>,
}

impl Boxes {
    /// Takes the rows out; those that come are to follow them.
    pub fn take(&mut self) -> Self {
        let next = Self { rows: self.rows.next(), ..Self::default() };
        std::mem::replace(self, next)
    }

    /// The boxes of a step, with their labels.
    pub fn push<'a>(
        &mut self,
        step: u32,
        boxes: impl Iterator<Item = (&'a proto::AgentState, String)>,
        origin: &Origin,
    ) {
        let before = self.centers.len();
        for (state, label) in boxes {
            self.centers.push(origin.place(state.x, state.y, state.z));
            self.half_sizes.push([state.length, state.width, state.height].map(|size| 0.5 * size as f32));
            self.turns.push(Quaternion::from_xyzw(quaternion(state.heading).map(|part| part as f32)));
            self.labels.push(label);
        }
        self.rows.push(step, self.centers.len() - before);
    }

    /// Writes them, filled; nothing where there was never a box.
    pub fn log(self, store: &mut Store<'_>, path: impl Into<EntityPath>, rgba: Rgba) -> Result<(), RrdError> {
        let style = Boxes3D::update_fields().with_fill_mode(FillMode::Solid).with_show_labels(false);
        self.log_in(store, path.into(), style.with_colors([color(rgba)]))
    }

    /// Writes them, filled, with their labels shown.
    pub fn log_labelled(self, store: &mut Store<'_>, path: impl Into<EntityPath>, rgba: Rgba) -> Result<(), RrdError> {
        let style = Boxes3D::update_fields().with_fill_mode(FillMode::Solid).with_show_labels(true);
        self.log_in(store, path.into(), style.with_colors([color(rgba)]))
    }

    /// Writes their edges alone.
    pub fn log_edges(self, store: &mut Store<'_>, path: impl Into<EntityPath>, rgba: Rgba) -> Result<(), RrdError> {
        let style = Boxes3D::update_fields().with_fill_mode(FillMode::MajorWireframe).with_show_labels(false);
        self.log_in(store, path.into(), style.with_colors([color(rgba)]).with_radii([Radius::new_ui_points(1.25)]))
    }

    fn log_in(self, store: &mut Store<'_>, path: EntityPath, style: Boxes3D) -> Result<(), RrdError> {
        if self.rows.is_blank() {
            return Ok(());
        }
        store.log(path.clone(), &style)?;
        let boxes = Boxes3D::update_fields()
            .with_centers(self.centers)
            .with_half_sizes(self.half_sizes)
            .with_quaternions(self.turns)
            .with_labels(self.labels);
        store.log_columns(path, times(&self.rows.steps), boxes.columns(self.rows.lengths)?)
    }
}

/// A frame that moves.
#[derive(Default)]
pub struct Frame {
    steps: Vec<u32>,
    places: Vec<[f32; 3]>,
    turns: Vec<Quaternion>,
}

impl Frame {
    /// Where it lies at a step.
    pub fn push(&mut self, step: u32, place: [f32; 3], heading: f64) {
        self.steps.push(step);
        self.places.push(place);
        self.turns.push(Quaternion::from_xyzw(quaternion(heading).map(|part| part as f32)));
    }

    /// Where it was.
    pub fn places(&self) -> &[[f32; 3]] {
        &self.places
    }

    /// The last step at which it was somewhere.
    pub fn last_step(&self) -> u32 {
        self.steps.last().copied().unwrap_or_default()
    }

    /// Writes it.
    pub fn log(self, store: &mut Store<'_>, path: impl Into<EntityPath>) -> Result<(), RrdError> {
        let frame = Transform3D::update_fields().with_many_translation(self.places).with_many_quaternion(self.turns);
        store.log_columns(path, times(&self.steps), frame.columns_of_unit_batches()?)
    }
}

/// Lines, each with its colour and width (points on the screen).
#[derive(Default)]
pub struct Lines {
    rows: Rows,
    strips: Vec<LineStrip3D>,
    colors: Vec<Color>,
    radii: Vec<Radius>,
}

impl Lines {
    /// Takes the rows out; those that come are to follow them.
    pub fn take(&mut self) -> Self {
        let next = Self { rows: self.rows.next(), ..Self::default() };
        std::mem::replace(self, next)
    }

    /// The lines of a step.
    pub fn push(&mut self, step: u32, lines: impl Iterator<Item = (Vec<[f32; 3]>, Rgba, f32)>) {
        let before = self.strips.len();
        for (points, rgba, width) in lines {
            self.strips.push(LineStrip3D::from_iter(points));
            self.colors.push(color(rgba));
            self.radii.push(Radius::new_ui_points(0.5 * width));
        }
        self.rows.push(step, self.strips.len() - before);
    }

    /// Writes them; nothing where there was never a line.
    pub fn log(self, store: &mut Store<'_>, path: impl Into<EntityPath>) -> Result<(), RrdError> {
        if self.rows.is_blank() {
            return Ok(());
        }
        let lines =
            LineStrips3D::update_fields().with_strips(self.strips).with_colors(self.colors).with_radii(self.radii);
        store.log_columns(path, times(&self.rows.steps), lines.columns(self.rows.lengths)?)
    }
}

/// Points, each with its colour.
#[derive(Default)]
pub struct Points {
    rows: Rows,
    positions: Vec<[f32; 3]>,
    colors: Vec<Color>,
    labels: Vec<String>,
}

impl Points {
    /// Takes the rows out; those that come are to follow them.
    pub fn take(&mut self) -> Self {
        let next = Self { rows: self.rows.next(), ..Self::default() };
        std::mem::replace(self, next)
    }

    /// The points of a step.
    pub fn push(&mut self, step: u32, points: impl Iterator<Item = ([f32; 3], Rgba, String)>) {
        let before = self.positions.len();
        for (position, rgba, label) in points {
            self.positions.push(position);
            self.colors.push(color(rgba));
            self.labels.push(label);
        }
        self.rows.push(step, self.positions.len() - before);
    }

    /// Writes them with that radius (m); nothing where there was never a point.
    pub fn log(self, store: &mut Store<'_>, path: impl Into<EntityPath>, radius: f32) -> Result<(), RrdError> {
        if self.rows.is_blank() {
            return Ok(());
        }
        let path = path.into();
        let style = Points3D::update_fields().with_radii([Radius::new_scene_units(radius)]).with_show_labels(false);
        store.log(path.clone(), &style)?;
        let points =
            Points3D::update_fields().with_positions(self.positions).with_colors(self.colors).with_labels(self.labels);
        store.log_columns(path, times(&self.rows.steps), points.columns(self.rows.lengths)?)
    }
}

/// A number a step, for a plot.
#[derive(Default)]
pub struct Series {
    steps: Vec<u32>,
    values: Vec<f64>,
}

impl Series {
    /// The value at a step; a gap where there is none.
    pub fn push(&mut self, step: u32, value: Option<f64>) {
        self.steps.push(step);
        self.values.push(value.unwrap_or(f64::NAN));
    }

    /// The range that shows all of it, and at least `least`, with a little room.
    pub fn range(&self, least: [f64; 2]) -> [f64; 2] {
        let [low, high] = self.values.iter().filter(|value| value.is_finite()).fold(least, |[low, high], value| {
            [if *value < low { *value } else { low }, if *value > high { *value } else { high }]
        });
        let room = 0.05 * (high - low);
        [low - room, high + room]
    }

    /// Whether there is nothing to plot.
    pub fn is_blank(&self) -> bool {
        self.values.iter().all(|value| value.is_nan())
    }

    /// Writes it.
    pub fn log(self, store: &mut Store<'_>, path: impl Into<EntityPath>) -> Result<(), RrdError> {
        let columns = Scalars::update_fields().with_scalars(self.values).columns_of_unit_batches()?;
        store.log_columns(path, times(&self.steps), columns)
    }
}

/// Lines of a log.
#[derive(Default)]
pub struct Texts {
    steps: Vec<u32>,
    texts: Vec<String>,
    levels: Vec<String>,
    colors: Vec<Color>,
}

impl Texts {
    /// A line.
    pub fn push(&mut self, step: u32, text: String, level: &str, rgba: Rgba) {
        self.steps.push(step);
        self.texts.push(text);
        self.levels.push(level.to_owned());
        self.colors.push(color(rgba));
    }

    /// Writes them.
    pub fn log(self, store: &mut Store<'_>, path: impl Into<EntityPath>) -> Result<(), RrdError> {
        let texts = TextLog::update_fields()
            .with_many_text(self.texts)
            .with_many_level(self.levels)
            .with_many_color(self.colors);
        store.log_columns(path, times(&self.steps), texts.columns_of_unit_batches()?)
    }
}
