//! Where agents come from, and where the logged AV goes.

use world::geometry::Point;
use world::scene::{AgentKind, Track};

use super::Moment;
use super::canvas::{Canvas, Path, Stroke};
use super::colours;
use super::course::runs;
use super::frame::Frame;

/// Who went less than this has no trail (m).
const SHORTEST: f64 = 0.5;

/// The past `seconds` of all that moved, and the AV's way to the log's end.
pub fn draw(canvas: &mut Canvas, frame: &Frame, moment: Moment<'_>, seconds: f64) {
    if seconds <= 0.0 {
        return;
    }
    let scene = moment.scene();
    for (index, track) in scene.tracks().iter().enumerate() {
        let colour = if index == scene.av_index() { colours::AV } else { colours::agent(track.kind) };
        fading(canvas, frame, &past(track, moment, seconds), colour, breadth(track.kind));
    }
    ahead(canvas, frame, moment);
}

fn breadth(kind: AgentKind) -> f64 {
    match kind {
        AgentKind::Vehicle | AgentKind::Other => 0.7,
        AgentKind::Pedestrian | AgentKind::Cyclist => 0.35,
    }
}

/// Places from `seconds` ago until now, without a gap; newest first.
fn past(track: &Track, moment: Moment<'_>, seconds: f64) -> Vec<Point> {
    let times = moment.scene().timestamps();
    let recent = |step: &usize| moment.time() - times[*step] <= seconds + 1e-6;
    let steps = (0..=moment.step()).rev().take_while(recent);
    steps.map_while(|step| Some(track.states.get(step)?.as_ref()?.position())).collect()
}

fn fading(canvas: &mut Canvas, frame: &Frame, places: &[Point], colour: &'static str, breadth: f64) {
    let way: f64 = places.windows(2).map(|pair| pair[0].distance(pair[1])).sum();
    if way < SHORTEST {
        return;
    }
    let (Some(newest), Some(oldest)) = (places.first(), places.last()) else { return };
    let width = frame.at_least(breadth, 1.6);
    let mut path = Path::default();
    runs(frame, places.iter().copied(), width).iter().for_each(|run| path.line(run));
    canvas.fade(&path, colour, width, [frame.pixel(*oldest), frame.pixel(*newest)]);
}

/// The logged AV's way from now on, dashed, with a dot where it ends.
fn ahead(canvas: &mut Canvas, frame: &Frame, moment: Moment<'_>) {
    let places: Vec<Point> =
        moment.scene().av().states.iter().skip(moment.step()).flatten().map(|state| state.position()).collect();
    let way: f64 = places.windows(2).map(|pair| pair[0].distance(pair[1])).sum();
    let (Some(end), true) = (places.last(), way >= SHORTEST) else { return };
    let width = frame.at_least(0.3, 1.8);
    let mut path = Path::default();
    runs(frame, places.iter().copied(), width).iter().for_each(|run| path.line(run));
    canvas.stroke(&path, Stroke::new(colours::PAPER, 2.0 * width).opacity(0.55).round());
    canvas.stroke(&path, Stroke::new(colours::AV, width).dashed([4.0 * width, 2.5 * width]));
    canvas.fill(&Path::of_disc(frame.pixel(*end), 1.6 * width), colours::AV);
}
