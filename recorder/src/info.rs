//! What a recording holds, as text for a terminal.

use std::fmt::{self, Display};

use wire::digest::Digest;
use wire::proto;

use crate::mcap::{Contents, ReadError, read};
use crate::message::{Body, Message};
use crate::sequence::Counts;
use crate::strokes;

/// Events that are shown; an honest drive has a few.
const EVENTS: usize = 1000;

/// What is shown of a recording.
pub struct Info {
    name: String,
    /// The file's (bytes).
    size: u64,
    /// Whether to show the run's settings whole.
    settings: bool,
    contents: Contents,
    scene: Option<Scene>,
    counts: Counts,
    /// Of all messages before the end.
    digest: Digest,
    end: Option<proto::EpisodeEnd>,
    events: Vec<proto::Event>,
    more_events: usize,
}

/// What is shown of the scene.
struct Scene {
    name: String,
    protocol: String,
    horizon: u32,
    lanes: usize,
    crosswalks: usize,
    stop_signs: usize,
    /// Length of the reference line (m).
    length: f64,
    route_lanes: usize,
}

impl Info {
    /// Reads the bytes of a recording: `name` is the file's, and its run's settings are shown whole, or not.
    ///
    /// # Errors
    /// [`ReadError`].
    pub fn read(name: String, bytes: &[u8], settings: bool) -> Result<Self, ReadError> {
        let mut info = Self {
            name,
            size: bytes.len() as u64,
            settings,
            contents: Contents::default(),
            scene: None,
            counts: Counts::default(),
            digest: Digest::default(),
            end: None,
            events: Vec::new(),
            more_events: 0,
        };
        info.contents = read(bytes, |message| info.hear(message))?;
        Ok(info)
    }

    fn hear(&mut self, message: Message) {
        if !matches!(message.body, Body::End(_)) {
            self.digest.add(message.channel(), &message.payload);
        }
        self.counts.add(message.channel());
        match message.body {
            Body::Scene(scene) => self.scene = self.scene.take().or_else(|| Some(Scene::of(*scene))),
            Body::Event(event) if self.events.len() < EVENTS => self.events.push(event),
            Body::Event(_) => self.more_events += 1,
            Body::End(end) => self.end = self.end.take().or(Some(end)),
            _ => {}
        }
    }

    fn show_trouble(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let contents = &self.contents;
        let seconds = |step: u64| step as f64 / 10.0;
        for (step, damage) in &contents.damage {
            writeln!(f, "  damaged     after {:.1} s, {damage}; the rest is read", seconds(*step))?;
        }
        if contents.more_damage > 0 {
            writeln!(f, "  damaged     in {} places more", contents.more_damage)?;
        }
        if contents.is_cut_off {
            let seconds = seconds(contents.last_step);
            writeln!(f, "  cut off     after {seconds:.1} s; what is before is readable")?;
        }
        let Some(end) = &self.end else { return Ok(()) };
        if let Some((what, there, told)) = self.counts.first_difference(&Counts::of_end(end)) {
            writeln!(f, "  not whole   {what} {there} of {told}")
        } else if !end.digest.is_empty() && end.digest != self.digest.to_bytes() {
            writeln!(f, "  changed     it does not hold what was told: its digest is another")
        } else {
            Ok(())
        }
    }

    fn show_events(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.events.is_empty() {
            return Ok(());
        }
        writeln!(f, "\n  events")?;
        for event in &self.events {
            let seconds = 0.1 * f64::from(event.step);
            writeln!(f, "    {seconds:>5.1} s  {:<22} {}", event.kind().as_str_name(), event.text)?;
        }
        if self.more_events > 0 { writeln!(f, "    and {} more", self.more_events) } else { Ok(()) }
    }
}

impl Scene {
    fn of(scene: proto::Scene) -> Self {
        let map = scene.map.unwrap_or_default();
        Self {
            name: scene.scene,
            protocol: scene.protocol,
            horizon: scene.horizon,
            lanes: map.lanes.len(),
            crosswalks: map.crosswalks.len(),
            stop_signs: map.stop_signs.len(),
            length: scene.reference_line.map_or(0.0, |line| 0.1 * line.x.len().saturating_sub(1) as f64),
            route_lanes: scene.route.len(),
        }
    }
}

impl Display for Info {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}  {}", self.name, bytes(self.size))?;
        self.show_trouble(f)?;
        let scene = self.scene.as_ref();
        scene.map_or(Ok(()), |scene| write!(f, "{scene}"))?;
        let most = scene.map_or_else(String::new, |scene| format!(" of at most {}", scene.horizon));
        writeln!(f, "  steps       {}{most}", self.counts.records)?;
        match &self.end {
            Some(end) => {
                writeln!(f, "  end         {}", strokes::end_sentence(end))?;
                show_metrics(f, end)?;
            }
            None => writeln!(f, "  end         not recorded")?,
        }
        self.show_events(f)?;
        show_channels(f, &self.contents)?;
        if self.settings {
            writeln!(f, "\n  settings")?;
            self.contents.settings.lines().try_for_each(|line| writeln!(f, "    {line}"))?;
        }
        Ok(())
    }
}

impl Display for Scene {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "  scene       {}", self.name)?;
        writeln!(f, "  protocol    {}", self.protocol)?;
        let Self { lanes, crosswalks, stop_signs, .. } = self;
        writeln!(f, "  map         lanes {lanes}, crosswalks {crosswalks}, stop signs {stop_signs}")?;
        writeln!(f, "  route       {:.0} m, lanes {}", self.length, self.route_lanes)
    }
}

fn show_metrics(f: &mut fmt::Formatter<'_>, end: &proto::EpisodeEnd) -> fmt::Result {
    let width = end.metrics.iter().map(|metric| metric.name.len()).max().unwrap_or(0).min(60);
    if width > 0 {
        writeln!(f, "\n  metrics")?;
    }
    for metric in &end.metrics {
        let value = metric.value.map_or_else(|| "-".to_owned(), |value| format!("{value:.3}"));
        writeln!(f, "    {:<width$}  {value:>10}", metric.name)?;
    }
    Ok(())
}

fn show_channels(f: &mut fmt::Formatter<'_>, contents: &Contents) -> fmt::Result {
    let width = contents.channels.keys().map(String::len).max().unwrap_or(0);
    let schema = contents.channels.values().map(|channel| channel.schema.len()).max().unwrap_or(0);
    writeln!(f, "\n  channels{:w$}  messages        size", "", w = (width + schema + 2).saturating_sub(6))?;
    contents.channels.iter().try_for_each(|(topic, channel)| {
        let (messages, size) = (channel.messages, bytes(channel.bytes));
        writeln!(f, "    {topic:<width$}  {:<schema$}  {messages:>8}  {size:>10}", channel.schema)
    })
}

/// A size for people.
fn bytes(size: u64) -> String {
    match size {
        0..1_000 => format!("{size} B"),
        1_000..1_000_000 => format!("{:.1} kB", size as f64 / 1e3),
        1_000_000..1_000_000_000 => format!("{:.1} MB", size as f64 / 1e6),
        _ => format!("{:.1} GB", size as f64 / 1e9),
    }
}
