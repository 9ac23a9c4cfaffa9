//! The rows of each file. A column's name carries its unit; what each means is in `docs/running.md` and `docs/metrics.md`.

use std::sync::Arc;

use arrow_array::builder::StringBuilder;
use arrow_array::{Array as _, ArrayRef, BooleanArray, Float64Array, RecordBatch, UInt32Array};
use arrow_schema::{ArrowError, DataType, Field, Schema};
use episode::guidance::STEP_US;
use episode::metrics::METRICS;
use wire::proto::{AgentState, StepRecord};

use super::moves;
use super::part::{Part, Timing, reason_name};
use crate::settings::{SceneLine, Settings};

/// What all rows of a run share.
#[derive(Clone, Copy, Debug)]
pub struct Common<'a> {
    /// What tables call the driver.
    pub driver: &'a str,
    /// The protocol's name.
    pub protocol: &'a str,
    /// How the AV follows its plan.
    pub motion: &'a str,
    /// Whether plans take effect later than at once: only then is there anything to tell of that.
    pub latency: bool,
    /// Who drives the agents that react, if any do: only then is there anything to tell of them.
    pub traffic: Option<&'a str>,
}

impl<'a> Common<'a> {
    /// What all rows of the run with these settings share.
    #[must_use]
    pub fn of(settings: &'a Settings) -> Self {
        Self {
            driver: &settings.driver,
            protocol: settings.protocol.name(),
            motion: settings.protocol.motion_name(),
            latency: settings.latency.is_some(),
            traffic: settings.traffic.as_ref().map(|traffic| traffic.node.name.as_str()),
        }
    }
}

/// A table under construction, column by column.
#[derive(Default)]
pub struct Columns {
    fields: Vec<Field>,
    arrays: Vec<ArrayRef>,
}

impl Columns {
    fn add(&mut self, name: &str, kind: DataType, nullable: bool, array: ArrayRef) {
        self.fields.push(Field::new(name, kind, nullable));
        self.arrays.push(array);
    }

    /// A column of text.
    pub fn text<T: AsRef<str>>(&mut self, name: &str, values: impl IntoIterator<Item = T>) {
        // However many they are: the array's own way asks for their number beforehand.
        let mut column = StringBuilder::new();
        values.into_iter().for_each(|value| column.append_value(value));
        self.add(name, DataType::Utf8, false, Arc::new(column.finish()));
    }

    /// A column of counts.
    pub fn count(&mut self, name: &str, values: impl IntoIterator<Item = u32>) {
        self.add(name, DataType::UInt32, false, Arc::new(UInt32Array::from_iter_values(values)));
    }

    /// A column of flags.
    pub fn flag(&mut self, name: &str, values: impl IntoIterator<Item = bool>) {
        let values: Vec<bool> = values.into_iter().collect();
        self.add(name, DataType::Boolean, false, Arc::new(BooleanArray::from(values)));
    }

    /// A column of numbers; null where one is none.
    pub fn number(&mut self, name: &str, values: impl IntoIterator<Item = f64>) {
        self.maybe(name, values.into_iter().map(Some));
    }

    /// A column of numbers: null where there is none, and where it is not a number: readers' filters cannot find a NaN, for statistics leave it out.
    pub fn maybe(&mut self, name: &str, values: impl IntoIterator<Item = Option<f64>>) {
        let values = values.into_iter().map(|value| value.filter(|value| !value.is_nan()));
        self.add(name, DataType::Float64, true, Arc::new(Float64Array::from_iter(values)));
    }

    /// The rows.
    ///
    /// # Errors
    /// [`ArrowError`] where columns do not fit together: a bug.
    pub fn batch(self) -> Result<RecordBatch, ArrowError> {
        RecordBatch::try_new(Arc::new(Schema::new(self.fields)), self.arrays)
    }
}

/// An episode, and its scene.
pub type Episode<'a> = (&'a SceneLine, &'a Part);

/// `results.parquet`: a row an episode.
///
/// # Errors
/// [`ArrowError`] where columns do not fit together: a bug.
pub fn results(common: Common<'_>, episodes: &[Episode<'_>]) -> Result<RecordBatch, ArrowError> {
    let scenes = || episodes.iter().map(|(scene, _)| scene);
    let parts = || episodes.iter().map(|(_, part)| *part);
    let all = |text| episodes.iter().map(move |_| text);
    let mut table = Columns::default();
    table.text("scene", scenes().map(|scene| &scene.id));
    table.text("scene_sha256", scenes().map(|scene| &scene.sha256));
    table.text("driver", all(common.driver));
    table.text("protocol", all(common.protocol));
    table.text("motion", all(common.motion));
    table.text("end_reason", parts().map(|part| reason_name(part.reason())));
    table.text("end_detail", parts().map(|part| part.end.as_ref().map_or("", |end| &end.detail)));
    table.flag("failed", parts().map(Part::failed));
    table.count("steps", parts().map(|part| part.records.len() as u32));
    table.count("start_log_index", parts().map(|part| part.start_log_index));
    let start = |value: fn(&AgentState) -> f64| parts().map(move |part| part.start.as_ref().map(value));
    table.maybe("start_x_m", start(|av| av.x));
    table.maybe("start_y_m", start(|av| av.y));
    table.maybe("start_heading_rad", start(|av| av.heading));
    table.maybe("start_velocity_x_mps", start(|av| av.velocity_x));
    table.maybe("start_velocity_y_mps", start(|av| av.velocity_y));
    for metric in METRICS {
        table.maybe(metric.name, parts().map(|part| value(part, metric.name)));
    }
    if common.latency {
        let plans = || parts().map(|part| part.plans.clone().unwrap_or_default());
        table.count("plans_late", plans().map(|plans| plans.late));
        table.count("plans_lost", plans().map(|plans| plans.lost));
        let mean_age = |part: &Part| {
            let ages: Vec<f64> = plan_ages(&part.records).flatten().collect();
            Some(ages.iter().sum::<f64>() / ages.len() as f64)
        };
        table.maybe("mean_plan_age_s", parts().map(mean_age));
    }
    if let Some(name) = common.traffic {
        table.text("traffic", all(name));
        table.count("reactive_agent_steps", parts().map(|part| part.records.iter().map(|step| step.reactive).sum()));
        table.count("agents_without_room", parts().map(|part| part.without_room));
    }
    table.text("findings", parts().map(|part| part.findings.join(", ")));
    table.text("unjudged", parts().map(|part| part.unjudged.join(", ")));
    table.flag("recorded", parts().map(|part| part.recorded));
    table.text("recording_error", parts().map(|part| &part.recording_error));
    table.text("episode_sha256", parts().map(Part::digest));
    table.batch()
}

fn value(part: &Part, name: &str) -> Option<f64> {
    part.end.as_ref()?.metrics.iter().find(|metric| metric.name == name)?.value
}

/// `steps.parquet`: a row a step of these episodes, one after the other.
///
/// # Errors
/// [`ArrowError`] where columns do not fit together: a bug.
pub fn steps(common: Common<'_>, episodes: &[Episode<'_>]) -> Result<RecordBatch, ArrowError> {
    let parts = || episodes.iter().map(|(_, part)| *part);
    let records = || parts().flat_map(|part| &part.records);
    let all = |text| records().map(move |_| text);
    let number = |value: fn(&StepRecord) -> f64| records().map(value);
    let maybe = |value: fn(&StepRecord) -> Option<f64>| records().map(value);
    let flag = |value: fn(&StepRecord) -> bool| records().map(value);
    let av = |value: fn(&AgentState) -> f64| records().map(move |record| record.av.as_ref().map(value));
    let logged = |value: fn(&AgentState) -> f64| {
        parts().flat_map(|part| &part.logged).map(move |at| at.state.as_ref().map(value))
    };

    let mut table = Columns::default();
    table.text("scene", parts().flat_map(|part| std::iter::repeat_n(scene_of(part), part.records.len())));
    table.text("driver", all(common.driver));
    table.text("protocol", all(common.protocol));
    table.count("step", records().map(|record| record.step));
    table.count("log_index", records().map(|record| record.log_index));
    table.maybe("av_x_m", av(|av| av.x));
    table.maybe("av_y_m", av(|av| av.y));
    table.maybe("av_z_m", av(|av| av.z));
    table.maybe("av_heading_rad", av(|av| av.heading));
    table.maybe("av_velocity_x_mps", av(|av| av.velocity_x));
    table.maybe("av_velocity_y_mps", av(|av| av.velocity_y));
    table.maybe("av_length_m", av(|av| av.length));
    table.maybe("av_width_m", av(|av| av.width));
    table.number("acceleration_mps2", number(|record| record.control.as_ref().map_or(0.0, |c| c.acceleration)));
    table.number("steering_rad", number(|record| record.control.as_ref().map_or(0.0, |c| c.steering)));
    table.number("yaw_rate_radps", number(|record| record.yaw_rate));
    table.number("station_m", number(|record| record.station));
    table.number("lateral_offset_m", number(|record| record.lateral_offset));
    table.maybe("speed_limit_mps", maybe(|record| (record.speed_limit > 0.0).then_some(record.speed_limit)));
    table.number("route_distance_m", number(|record| record.route_distance));
    table.maybe("road_edge_distance_m", maybe(|record| record.road_edge_distance));
    table.maybe("time_to_collision_s", maybe(|record| record.time_to_collision));
    table.maybe("position_error_m", maybe(|record| record.position_error));
    table.flag("collision", flag(|record| record.collision));
    table.flag("at_fault_collision", flag(|record| record.at_fault_collision));
    table.flag("off_route", flag(|record| record.off_route));
    table.flag("off_road", flag(|record| record.off_road));
    table.flag("red_light", flag(|record| record.red_light));
    table.flag("wrong_way", flag(|record| record.wrong_way));
    table.flag("speeding", flag(|record| record.speeding));
    table.flag("outside_drivable_area", flag(|record| record.outside_drivable_area));
    table.number("backward_travel_m", number(|record| record.backward_travel));
    table.flag("in_one_lane", flag(|record| record.in_one_lane));
    table.maybe("human_x_m", logged(|human| human.x));
    table.maybe("human_y_m", logged(|human| human.y));
    table.maybe("human_heading_rad", logged(|human| human.heading));
    table.maybe("human_velocity_x_mps", logged(|human| human.velocity_x));
    table.maybe("human_velocity_y_mps", logged(|human| human.velocity_y));
    if common.latency {
        table.maybe("plan_age_s", parts().flat_map(|part| plan_ages(&part.records)));
    }
    if common.traffic.is_some() {
        table.count("reactive_agents", records().map(|record| record.reactive));
        let moved = parts().flat_map(|part| (0..part.records.len()).map(|step| part.moved.get(step)));
        let moved = moves::column(moved.map(|moves| moves.map_or(&[][..], |moves| &moves.agents)));
        table.add(moves::COLUMN, moved.data_type().clone(), false, Arc::new(moved));
    }
    let events = |part: &Part, record: &StepRecord| events_at(part, record.step);
    table.text("events", parts().flat_map(|part| part.records.iter().map(move |record| events(part, record))));
    table.batch()
}

fn scene_of(part: &Part) -> &str {
    part.end.as_ref().map_or("", |end| &end.scene)
}

/// The sentences of a step's events, one a line.
fn events_at(part: &Part, step: u32) -> String {
    let at = part.events.iter().filter(|event| event.step == step);
    at.map(|event| event.text.as_str()).collect::<Vec<_>>().join("\n")
}

/// How old the plan was that was followed in each step (s): the time between the two observations, that of the step and that which the plan
/// answers, in the mean over the step; none where there was no plan for a while.
fn plan_ages(records: &[StepRecord]) -> impl Iterator<Item = Option<f64>> {
    let steps = |record: &StepRecord| record.plan_age.filter(|age| *age >= 0).map(f64::from);
    (0..records.len()).map(move |step| {
        let now = steps(&records[step])?;
        let before = match records[step].plan_taken_up_us {
            0 => now,
            _ => 1.0 + steps(&records[step.checked_sub(1)?])?,
        };
        let share = f64::from(records[step].plan_taken_up_us) / f64::from(STEP_US);
        Some(f64::from(STEP_US) / 1e6 * (share * before + (1.0 - share) * now))
    })
}

/// `timing.parquet`: a row an episode; seconds of wall clock.
///
/// # Errors
/// [`ArrowError`] where columns do not fit together: a bug.
pub fn timing(common: Common<'_>, episodes: &[Episode<'_>]) -> Result<RecordBatch, ArrowError> {
    let timing = || episodes.iter().map(|(_, part)| part.timing.unwrap_or_default());
    let seconds = |value: fn(&Timing) -> f64| timing().map(move |timing| value(&timing));
    let mut table = Columns::default();
    table.text("scene", episodes.iter().map(|(scene, _)| &scene.id));
    table.count("worker", timing().map(|timing| timing.worker));
    table.count("steps", episodes.iter().map(|(_, part)| part.records.len() as u32));
    table.number("first_step_s", seconds(|timing| timing.first_step));
    table.number("wall_s", seconds(|timing| timing.wall));
    table.number("load_s", seconds(|timing| timing.load));
    table.number("prepare_s", seconds(|timing| timing.prepare));
    table.number("brief_s", seconds(|timing| timing.brief));
    table.number("observe_s", seconds(|timing| timing.observe));
    if common.traffic.is_some() {
        table.number("traffic_s", seconds(|timing| timing.traffic));
    }
    table.number("answer_s", seconds(|timing| timing.answer));
    table.number("advance_s", seconds(|timing| timing.advance));
    table.number("publish_s", seconds(|timing| timing.publish));
    table.number("recording_s", seconds(|timing| timing.recording));
    table.number("answer_p50_s", seconds(|timing| timing.answer_p50));
    table.number("answer_p99_s", seconds(|timing| timing.answer_p99));
    table.number("answer_max_s", seconds(|timing| timing.answer_max));
    table.batch()
}

#[cfg(test)]
mod tests {
    use arrow_array::Array as _;
    use arrow_array::cast::AsArray as _;
    use arrow_array::types::Float64Type;
    use wire::proto::{Control, EpisodeEnd, Metric};

    use super::*;
    use crate::part::LoggedState;

    const NAN: f64 = f64::NAN;

    /// An episode of one step, of which nothing is a number.
    fn part() -> Part {
        let av = AgentState {
            x: NAN,
            y: NAN,
            z: NAN,
            heading: NAN,
            velocity_x: NAN,
            velocity_y: NAN,
            length: NAN,
            width: NAN,
            height: NAN,
        };
        let record = StepRecord {
            av: Some(av),
            control: Some(Control { acceleration: NAN, steering: NAN }),
            yaw_rate: NAN,
            station: NAN,
            lateral_offset: NAN,
            speed_limit: NAN,
            route_distance: NAN,
            time_to_collision: Some(NAN),
            position_error: Some(NAN),
            road_edge_distance: Some(NAN),
            backward_travel: NAN,
            ..StepRecord::default()
        };
        let metrics = METRICS.iter().map(|metric| Metric { name: metric.name.to_owned(), value: Some(NAN) });
        Part {
            end: Some(EpisodeEnd { metrics: metrics.collect(), ..EpisodeEnd::default() }),
            records: vec![record],
            logged: vec![LoggedState { state: Some(av) }],
            start: Some(av),
            timing: Some(Timing {
                first_step: NAN,
                wall: NAN,
                load: NAN,
                prepare: NAN,
                brief: NAN,
                observe: NAN,
                traffic: NAN,
                answer: NAN,
                advance: NAN,
                publish: NAN,
                recording: NAN,
                answer_p50: NAN,
                answer_p99: NAN,
                answer_max: NAN,
                ..Timing::default()
            }),
            ..Part::default()
        }
    }

    #[test]
    fn what_is_not_a_number_is_null_in_every_column_of_every_file() {
        let part = part();
        let scene = SceneLine { id: "s".to_owned(), ..SceneLine::default() };
        let common = Common { driver: "d", protocol: "strict", motion: "m", latency: true, traffic: Some("t") };
        let episodes = [(&scene, &part)];
        let files = [results(common, &episodes), steps(common, &episodes), timing(common, &episodes)];
        let mut columns = 0;
        for file in files.map(Result::unwrap) {
            for (field, array) in file.schema().fields().iter().zip(file.columns()) {
                if *field.data_type() == DataType::Float64 {
                    assert!(array.as_primitive::<Float64Type>().is_null(0), "{}", field.name());
                    columns += 1;
                }
            }
        }
        assert!(columns > METRICS.len() + 30, "{columns}");
    }
}
