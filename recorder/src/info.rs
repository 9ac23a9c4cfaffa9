//! What a recording holds, as text for a terminal.

use std::fmt::{self, Display};

use wire::keys::Channel;
use wire::proto;

use crate::mcap::{Break, Contents};
use crate::message::{Body, Message};
use crate::strokes;

/// Shows [`Contents`].
pub struct Info<'a> {
    /// The file's name.
    pub name: &'a str,
    /// Its size (bytes).
    pub size: u64,
    /// What it holds.
    pub contents: &'a Contents,
    /// Whether to show the run's settings whole.
    pub settings: bool,
}

impl Info<'_> {
    fn find<'a, T>(&'a self, pick: impl Fn(&'a Body) -> Option<T>) -> Option<T> {
        self.contents.messages.iter().find_map(|message| pick(&message.body))
    }

    fn count(&self, channel: Channel) -> usize {
        self.contents.messages.iter().filter(|message: &&Message| message.channel() == channel).count()
    }
}

impl Display for Info<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let contents = self.contents;
        writeln!(f, "{}  {}", self.name, bytes(self.size))?;
        let seconds = contents.last_step as f64 / 10.0;
        match &contents.broken {
            None => {}
            Some(Break::CutOff) => writeln!(f, "  cut off     after {seconds:.1} s; what is before is readable")?,
            Some(Break::Damaged(why)) => {
                writeln!(f, "  damaged     after {seconds:.1} s: {why}; what is before is readable")?;
            }
        }
        let scene = self.find(|body| if let Body::Scene(scene) = body { Some(scene) } else { None });
        scene.map_or(Ok(()), |scene| show_scene(f, scene))?;
        let most = scene.map_or_else(String::new, |scene| format!(" of at most {}", scene.horizon));
        writeln!(f, "  steps       {}{most}", self.count(Channel::Record))?;
        match self.find(|body| if let Body::End(end) = body { Some(end) } else { None }) {
            Some(end) => {
                writeln!(f, "  end         {}", strokes::end_sentence(end))?;
                show_metrics(f, end)?;
            }
            None => writeln!(f, "  end         not recorded")?,
        }
        show_events(f, contents)?;
        show_channels(f, contents)?;
        if self.settings {
            writeln!(f, "\n  settings")?;
            contents.settings.lines().try_for_each(|line| writeln!(f, "    {line}"))?;
        }
        Ok(())
    }
}

fn show_scene(f: &mut fmt::Formatter<'_>, scene: &proto::Scene) -> fmt::Result {
    let length = scene.reference_line.as_ref().map_or(0.0, |line| 0.1 * line.x.len().saturating_sub(1) as f64);
    writeln!(f, "  scene       {}", scene.scene)?;
    writeln!(f, "  protocol    {}", scene.protocol)?;
    if let Some(map) = &scene.map {
        let (lanes, crosswalks, signs) = (map.lanes.len(), map.crosswalks.len(), map.stop_signs.len());
        writeln!(f, "  map         lanes {lanes}, crosswalks {crosswalks}, stop signs {signs}")?;
    }
    writeln!(f, "  route       {length:.0} m, lanes {}", scene.route.len())
}

fn show_metrics(f: &mut fmt::Formatter<'_>, end: &proto::EpisodeEnd) -> fmt::Result {
    let width = end.metrics.iter().map(|metric| metric.name.len()).max().unwrap_or(0);
    if width > 0 {
        writeln!(f, "\n  metrics")?;
    }
    for metric in &end.metrics {
        let value = metric.value.map_or_else(|| "-".to_owned(), |value| format!("{value:.3}"));
        writeln!(f, "    {:<width$}  {value:>10}", metric.name)?;
    }
    Ok(())
}

fn show_events(f: &mut fmt::Formatter<'_>, contents: &Contents) -> fmt::Result {
    let mut events = contents.messages.iter().filter_map(|message| match &message.body {
        Body::Event(event) => Some(event),
        _ => None,
    });
    let Some(first) = events.next() else { return Ok(()) };
    writeln!(f, "\n  events")?;
    std::iter::once(first).chain(events).try_for_each(|event| {
        writeln!(f, "    {:>5.1} s  {:<22} {}", 0.1 * f64::from(event.step), event.kind().as_str_name(), event.text)
    })
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
