//! Messages in canonical order to the bytes of an episode's Rerun file.

use std::collections::BTreeSet;

use re_chunk::EntityPath;
use re_sdk_types::archetypes::{LineStrips3D, Points3D, RecordingInfo, SeriesLines, TextDocument, ViewCoordinates};
use re_sdk_types::blueprint::components::PlayState;
use re_sdk_types::components::{LineStrip3D, Radius};
use rrd::{RrdError, Store, color};
use wire::proto::{self, AgentKind};
use world::plan::STEP_SECONDS;

use super::blueprint;
use super::columns::{Boxes, Frame, Lines, Points, Series, Texts};
use crate::contacts::Contacts;
use crate::layers::{layers, stop_signs};
use crate::message::{Body, Message};
use crate::origin::Origin;
use crate::palette::{self, Rgba};
use crate::strokes;

/// Kinds of agents, each an entity of its own, so that it can be hidden.
const KINDS: [(AgentKind, &str); 4] = [
    (AgentKind::Vehicle, "world/agents/vehicles"),
    (AgentKind::Pedestrian, "world/agents/pedestrians"),
    (AgentKind::Cyclist, "world/agents/cyclists"),
    (AgentKind::Other, "world/agents/others"),
];

/// Drawn above the ground, so that the paint below does not shine through (m).
const LIFT: f64 = 0.3;

/// The most that is drawn, in points of lines; a box counts as eight. A drive of 20 s among a thousand agents with six futures each
/// has half of it: more has only what was made to harm.
const MOST_POINTS: usize = 1 << 25;

/// What is plotted.
#[derive(Default)]
struct Plots {
    speed: Series,
    limit: Series,
    acceleration: Series,
    steering: Series,
    time_to_collision: Series,
    /// Under a latency.
    plan_age: Series,
}

impl Plots {
    /// The plots' names, paths and ranges: a car that goes straight is not to show the noise of its steering.
    fn views(&self) -> Vec<(&'static str, &'static str, [f64; 2])> {
        let [speed, limit] = [&self.speed, &self.limit].map(|series| series.range([0.0, 5.0]));
        let mut views = vec![
            ("Speed (m/s)", "/plots/speed", [speed[0], if limit[1] > speed[1] { limit[1] } else { speed[1] }]),
            ("Acceleration (m/s²)", "/plots/acceleration", self.acceleration.range([-1.0, 1.0])),
            ("Steering (rad)", "/plots/steering", self.steering.range([-0.05, 0.05])),
            ("Time to collision (s)", "/plots/time_to_collision", self.time_to_collision.range([0.0, 3.0])),
        ];
        if !self.plan_age.is_blank() {
            views.push(("Age of the plan (s)", "/plots/plan_age", self.plan_age.range([0.0, 0.5])));
        }
        views
    }
}

/// A drawing of one episode that grows with its messages; columns of small numbers, a few megabytes at most.
#[derive(Default)]
pub struct Drawing {
    scene: Option<Box<proto::Scene>>,
    origin: Origin,
    /// Ground below the AV (m, the log's frame): plans and predictions have no height of their own.
    ground: f64,
    agents: [Boxes; KINDS.len()],
    /// Those that are not seen now, but supposed to be there.
    supposed: Boxes,
    contacts: Contacts,
    /// Who was moved in the last step.
    reacting: BTreeSet<i32>,
    struck: Boxes,
    touched: Boxes,
    av: Boxes,
    /// Where the log has the AV.
    ghost: Boxes,
    /// Rides with the AV, on the ground: what the viewer's camera is fixed to.
    ride: Frame,
    plan: Lines,
    predictions: Lines,
    signals: Points,
    plots: Plots,
    events: Texts,
    /// The AV after the last step: no observation follows that would show it.
    last: Option<Last>,
    end: Option<proto::EpisodeEnd>,
    /// What is drawn so far, see [`MOST_POINTS`].
    points: usize,
}

/// The AV and where the log has it, after a step.
#[derive(Clone, Copy)]
struct Last {
    step: u32,
    av: proto::AgentState,
    logged: Option<proto::AgentState>,
}

impl Drawing {
    /// Draws the next message.
    pub fn push(&mut self, message: &Message) {
        let step = message.step();
        let fits = self.points <= MOST_POINTS;
        self.points = self.points.saturating_add(points(&message.body));
        if self.points > MOST_POINTS {
            if fits {
                self.events.push(step, "too much to draw: the drawing ends here".to_owned(), "ERROR", palette::STRUCK);
            }
            return;
        }
        match &message.body {
            Body::Scene(scene) => {
                self.origin = Origin::of_scene(scene);
                // The history is long and not drawn.
                self.scene = Some(Box::new(proto::Scene { history: Vec::new(), ..(**scene).clone() }));
            }
            Body::Observation(observation) => self.observe(observation),
            Body::Prediction(prediction) => {
                let futures = prediction.futures.iter().flat_map(|future| {
                    let rgba = palette::prediction(future.probability);
                    let width = 1.0 + 1.5 * future.probability.clamp(0.0, 1.0) as f32;
                    let lines = strokes::future(future, self.ground + LIFT, &self.origin);
                    lines.into_iter().map(move |points| (points, rgba, width))
                });
                self.predictions.push(step, futures);
            }
            Body::Plan(plan) => {
                let points = strokes::plan(plan, self.ground + LIFT, &self.origin);
                self.plan.push(step, std::iter::once((points, palette::PLAN, 4.0)));
            }
            // The observation after it shows where they are.
            Body::Moves(moves) => self.reacting = moves.agents.iter().map(|agent| agent.track).collect(),
            Body::Record(record) => self.record(record),
            Body::Event(event) => {
                let (level, rgba) = if strokes::is_grave(event) {
                    ("ERROR", palette::signal(proto::SignalState::Stop))
                } else {
                    ("WARN", palette::signal(proto::SignalState::Caution))
                };
                self.events.push(step, event.text.clone(), level, rgba);
                self.contacts.happen(event);
            }
            Body::End(end) => {
                self.events.push(step, strokes::end_sentence(end), "INFO", palette::PLAN);
                self.end = Some(end.clone());
            }
        }
    }

    fn observe(&mut self, observation: &proto::Observation) {
        let step = observation.step;
        if let Some(av) = &observation.av {
            self.place_av(step, av);
            // The first step begins where the log has the AV; the record before tells the others.
            let logged = self.last.filter(|last| last.step == step).and_then(|last| last.logged);
            self.place_ghost(step, if step == 0 { Some(*av) } else { logged });
        }
        self.contacts.observe(observation);
        self.place_agents(step, &observation.agents);
        let lights = observation.signals.iter().map(|signal| {
            let position = self.origin.place(signal.stop_x, signal.stop_y, signal.stop_z + LIFT);
            (position, palette::signal(signal.state()), format!("lane {}", signal.lane))
        });
        self.signals.push(step, lights);
    }

    fn place_agents(&mut self, step: u32, agents: &[proto::Agent]) {
        for ((kind, _), boxes) in KINDS.iter().zip(&mut self.agents) {
            let of_kind = agents.iter().filter(|agent| agent.kind() == *kind);
            let untouched = of_kind.filter(|agent| agent.unseen == 0 && self.contacts.mark(agent.track).is_none());
            let labelled = untouched.filter_map(|agent| {
                let reacts = if self.reacting.contains(&agent.track) { ", reacts" } else { "" };
                Some((agent.state.as_ref()?, format!("{} {}{reacts}", strokes::kind_name(*kind), agent.track)))
            });
            boxes.push(step, labelled, &self.origin);
        }
        let supposed = agents.iter().filter(|agent| agent.unseen > 0 && self.contacts.mark(agent.track).is_none());
        let labelled = supposed.filter_map(|agent| {
            let (kind, seconds) = (strokes::kind_name(agent.kind()), 0.1 * f64::from(agent.unseen));
            Some((agent.state.as_ref()?, format!("{kind} {}, not seen for {seconds:.1} s", agent.track)))
        });
        self.supposed.push(step, labelled, &self.origin);
        for (boxes, color) in [(&mut self.struck, palette::STRUCK), (&mut self.touched, palette::TOUCHED)] {
            let marked = agents.iter().filter_map(|agent| {
                let (rgba, label) = self.contacts.mark(agent.track)?;
                (*rgba == color).then_some((agent.state.as_ref()?, label.clone()))
            });
            boxes.push(step, marked, &self.origin);
        }
    }

    fn place_ghost(&mut self, step: u32, logged: Option<proto::AgentState>) {
        self.ghost.push(step, logged.iter().map(|state| (state, "the logged AV".to_owned())), &self.origin);
    }

    fn place_av(&mut self, step: u32, av: &proto::AgentState) {
        self.ground = av.z - 0.5 * av.height;
        self.av.push(step, std::iter::once((av, "AV".to_owned())), &self.origin);
        self.ride.push(step, self.origin.place(av.x, av.y, self.ground), av.heading);
    }

    fn record(&mut self, record: &proto::StepRecord) {
        let (step, plots) = (record.step, &mut self.plots);
        let speed = record.av.as_ref().map(|av| libm::hypot(av.velocity_x, av.velocity_y));
        plots.speed.push(step, speed);
        plots.limit.push(step, Some(record.speed_limit).filter(|limit| *limit > 0.0));
        plots.acceleration.push(step, record.control.as_ref().map(|control| control.acceleration));
        plots.steering.push(step, record.control.as_ref().map(|control| control.steering));
        plots.time_to_collision.push(step, record.time_to_collision);
        let age = record.plan_age.filter(|age| *age >= 0);
        plots.plan_age.push(step, age.map(|age| f64::from(age) * STEP_SECONDS));
        self.last = record.av.map(|av| Last { step: step.saturating_add(1), av, logged: record.logged_av });
    }

    /// The file: `run`, the scene and `settings` (TOML) name the recording, so that those of runs that differ stand side by side in
    /// a viewer. The settings are shown beside it.
    ///
    /// # Errors
    /// [`RrdError`].
    pub fn finish(mut self, run: &str, settings: &str) -> Result<Vec<u8>, RrdError> {
        self.show_the_end();
        let scene = self.scene_name();
        let id = recording_name(run, &scene, settings);
        let mut encoder = rrd::encoder()?;
        let blueprint = Store::blueprint(&mut encoder, "recorder", &id)?;
        blueprint::write(blueprint, self.ride.places(), &self.plots.views(), PlayState::Playing)?;
        let mut store = Store::recording(&mut encoder, "recorder", &id)?;
        write_frame(&mut store, &format!("{run}, {scene}"), settings)?;
        self.write(&mut store)?;
        encoder.finish()?;
        Ok(encoder.into_inner()?)
    }

    /// The scene that is drawn; empty without one.
    #[must_use]
    pub fn scene_name(&self) -> String {
        self.scene.as_ref().map(|scene| scene.scene.clone()).unwrap_or_default()
    }

    /// Draws where everybody is after the last step.
    pub(super) fn show_the_end(&mut self) {
        if let Some(Last { step, av, logged }) = self.last.take() {
            self.place_av(step, &av);
            self.place_ghost(step, logged);
            if let Some(agents) = self.contacts.last_seen() {
                self.place_agents(step, &agents);
            }
        }
    }

    /// Steps that are drawn.
    pub(super) fn steps(&self) -> u32 {
        self.ride.last_step()
    }

    /// The range of speeds (m/s) that its plot shows.
    pub(super) fn speeds(&self) -> [f64; 2] {
        self.plots.views()[0].2
    }

    /// Writes all that is drawn.
    pub(super) fn write(mut self, store: &mut Store<'_>) -> Result<(), RrdError> {
        let scene = self.scene.take().unwrap_or_default();
        self.write_map(store, &scene)?;
        self.write_steps(store)
    }

    /// Takes out what was drawn since the last time; its map is drawn by [`Drawing::write_map`] alone.
    pub(super) fn take_steps(&mut self) -> Self {
        self.points = 0;
        Self {
            agents: self.agents.each_mut().map(Boxes::take),
            supposed: self.supposed.take(),
            struck: self.struck.take(),
            touched: self.touched.take(),
            av: self.av.take(),
            ghost: self.ghost.take(),
            ride: std::mem::take(&mut self.ride),
            plan: self.plan.take(),
            predictions: self.predictions.take(),
            signals: self.signals.take(),
            plots: std::mem::take(&mut self.plots),
            events: std::mem::take(&mut self.events),
            end: self.end.take(),
            ..Self::default()
        }
    }

    /// Takes out the scene.
    pub(super) fn take_scene(&mut self) -> Option<Box<proto::Scene>> {
        self.scene.take()
    }

    pub(super) fn write_map(&self, store: &mut Store<'_>, scene: &proto::Scene) -> Result<(), RrdError> {
        for layer in layers(scene, &self.origin) {
            let colors = layer.lines.iter().map(|(_, rgba)| color(*rgba)).collect::<Vec<_>>();
            let strips = layer.lines.into_iter().map(|(points, _)| LineStrip3D::from_iter(points));
            let lines =
                LineStrips3D::new(strips).with_colors(colors).with_radii([Radius::new_ui_points(0.5 * layer.width)]);
            store.log(format!("world/{}", layer.name), &lines)?;
        }
        let signs = stop_signs(scene, &self.origin);
        if !signs.is_empty() {
            let points = Points3D::new(signs)
                .with_colors([color(palette::STOP_SIGN)])
                .with_radii([Radius::new_scene_units(0.45)]);
            store.log("world/map/stop_signs", &points)?;
        }
        Ok(())
    }

    pub(super) fn write_steps(self, store: &mut Store<'_>) -> Result<(), RrdError> {
        for ((kind, path), boxes) in KINDS.into_iter().zip(self.agents) {
            boxes.log(store, path, palette::agent(kind))?;
        }
        self.supposed.log_edges(store, "world/agents/supposed", palette::agent(AgentKind::Other))?;
        self.struck.log_labelled(store, "world/agents/struck", palette::STRUCK)?;
        self.touched.log_labelled(store, "world/agents/touched", palette::TOUCHED)?;
        self.ghost.log_edges(store, "world/logged_av", palette::GHOST)?;
        self.av.log(store, "world/av", palette::AV)?;
        self.ride.log(store, "world/ride")?;
        self.predictions.log(store, "world/predictions")?;
        self.plan.log(store, "world/plan")?;
        self.signals.log(store, "world/signals", 0.7)?;
        let plots = self.plots;
        let mut series: Vec<(&str, &str, Series, Rgba)> = vec![
            ("plots/speed/av", "speed", plots.speed, palette::AV),
            ("plots/speed/limit", "limit", plots.limit, palette::LIMIT),
            ("plots/acceleration", "acceleration", plots.acceleration, palette::agent(AgentKind::Pedestrian)),
            ("plots/steering", "steering", plots.steering, palette::agent(AgentKind::Cyclist)),
            (
                "plots/time_to_collision",
                "time to collision",
                plots.time_to_collision,
                palette::signal(proto::SignalState::Stop),
            ),
        ];
        if !plots.plan_age.is_blank() {
            series.push(("plots/plan_age", "age of the plan", plots.plan_age, palette::AV));
        }
        for (path, name, series, rgba) in series {
            let style = SeriesLines::new().with_colors([color(rgba)]).with_names([name]).with_widths([1.6]);
            store.log(path, &style)?;
            if !series.is_blank() {
                series.log(store, path)?;
            }
        }
        self.events.log(store, "events")?;
        if let Some(end) = &self.end {
            store.log("outcome", &TextDocument::from_markdown(outcome(end)))?;
        }
        Ok(())
    }
}

/// What a recording is called: `run`, the scene and `settings` (TOML) name it, so that those of runs that differ stand side by side in a viewer.
pub(super) fn recording_name(run: &str, scene: &str, settings: &str) -> String {
    format!("{run}.{scene}.{:08x}", crc32fast::hash(settings.as_bytes()))
}

/// Writes what every recording begins with: its title, its frame, the settings.
pub(super) fn write_frame(store: &mut Store<'_>, title: &str, settings: &str) -> Result<(), RrdError> {
    store.log(EntityPath::properties(), &RecordingInfo::new().with_name(title.to_owned()))?;
    store.log("world", &ViewCoordinates::RIGHT_HAND_Z_UP())?;
    store.log("settings", &TextDocument::from_markdown(format!("```toml\n{}\n```\n", settings.trim_end())))
}

/// How much is drawn of a message, about.
fn points(body: &Body) -> usize {
    match body {
        Body::Observation(observation) => 8 * (observation.agents.len() + observation.signals.len() + 1),
        Body::Prediction(prediction) => {
            let trajectories = prediction.futures.iter().flat_map(|future| &future.trajectories);
            trajectories.map(|trajectory| 1 + trajectory.x.len() / 5).sum()
        }
        Body::Plan(plan) => plan.states.len(),
        Body::Event(event) => 8 + event.text.len() / 12,
        Body::Record(_) => 8,
        Body::Scene(_) | Body::Moves(_) | Body::End(_) => 0,
    }
}

/// How it ended, as Markdown.
fn outcome(end: &proto::EpisodeEnd) -> String {
    let mut text = format!("{}\n\n| metric | value |\n| --- | ---: |\n", strokes::end_sentence(end));
    for metric in &end.metrics {
        let value = metric.value.map_or_else(|| "-".to_owned(), |value| format!("{value:.3}"));
        text.push_str(&format!("| {} | {value} |\n", metric.name));
    }
    text
}
