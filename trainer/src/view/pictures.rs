//! Windows drawn from above: what is there, what happened, and what the network makes of it after each epoch.

use network::constants::{HISTORY, NEIGHBORS, POINTS, STEPS};
use re_chunk::{Chunk, EntityPath, TimeColumn};
use re_sdk_types::AsComponents;
use re_sdk_types::archetypes::{Boxes3D, LineStrips3D};
use re_sdk_types::components::{FillMode, LineStrip3D, Radius};
use re_sdk_types::datatypes::Quaternion;
use rrd::{RrdError, Store, color};

use super::{EPOCH, STEP};
use crate::step::Look;
use crate::windows::Window;

/// Where all of them are.
const ROOT: &str = "windows";
/// Every how many samples of 0.1 m the reference line is drawn.
const LINE_STRIDE: usize = 10;

// The colours of the recorder's pictures.
const LANE: [u8; 4] = [54, 62, 77, 255];
const CROSSWALK: [u8; 4] = [104, 124, 152, 255];
const ROUTE: [u8; 4] = [16, 78, 96, 255];
const AV: [u8; 4] = [0, 205, 240, 255];
const PLAN: [u8; 4] = [120, 232, 255, 255];
const TRUTH: [u8; 4] = [64, 220, 120, 255];
const NEIGHBOR: [u8; 4] = [118, 140, 186, 255];
const PREDICTION: [u8; 4] = [242, 196, 104, 255];

/// The entity of the window `number`, from 0.
pub fn path(number: usize) -> String {
    format!("{ROOT}/{}", number + 1)
}

/// Whether an entity belongs to windows.
pub fn are_of(path: &EntityPath) -> bool {
    path.starts_with(&EntityPath::from(ROOT))
}

/// What a window is called.
pub fn name(window: &Window) -> String {
    format!("{}@{}", window.scene, window.step)
}

/// Points on the ground, drawn a little above what has a smaller `layer`.
fn line<'a>(points: impl Iterator<Item = &'a [f32]>, layer: f32) -> Vec<[f32; 3]> {
    points.map(|point| [point[0], point[1], 0.05 * layer]).collect()
}

/// The slots' different lines.
fn map<const N: usize>(points: &[[f32; N]], slots: &[Option<[u16; POINTS]>]) -> Vec<Vec<[f32; 3]>> {
    let mut slots: Vec<_> = slots.iter().flatten().collect();
    slots.sort_unstable();
    slots.dedup();
    // Rows of zeros fill a line that is too short.
    let there = |number: &u16| points.get(usize::from(*number)).filter(|point| point.iter().any(|value| *value != 0.0));
    slots.into_iter().map(|slot| line(slot.iter().filter_map(there).map(|point| &point[..]), 0.0)).collect()
}

/// Where a neighbour is there.
fn present(window: &Window) -> impl Iterator<Item = usize> {
    (0..NEIGHBORS).filter(|neighbor| window.sketch.presence.agents[neighbor + 1])
}

/// Where an agent, the AV first, went as far as it was seen.
fn truth(window: &Window, agent: usize) -> Vec<[f32; 3]> {
    let seen = window.future[agent].iter().zip(&window.seen[agent]).filter(|(_, seen)| **seen);
    line(seen.map(|(state, _)| &state[..]), 3.0)
}

/// Rows in which somebody has a size.
fn history<const N: usize>(rows: &[[f32; N]; HISTORY]) -> Vec<[f32; 3]> {
    line(rows.iter().filter(|row| row[5] > 0.0).map(|row| &row[..]), 2.0)
}

/// Logs what stays.
pub fn log_still(store: &mut Store<'_>, number: usize, window: &Window) -> Result<(), RrdError> {
    let root = path(number);
    let sketch = &window.sketch;
    let route = window.line.iter().step_by(LINE_STRIDE).map(|sample| &sample[..]);
    let parts = [
        ("map/lanes", LANE, 1.2, map(&sketch.lane_points, &sketch.lanes)),
        ("map/crosswalks", CROSSWALK, 1.6, map(&sketch.crosswalk_points, &sketch.crosswalks)),
        ("route", ROUTE, 5.0, vec![line(route, 1.0)]),
        ("neighbors/history", NEIGHBOR, 1.5, present(window).map(|of| history(&sketch.neighbors[of])).collect()),
        ("neighbors/truth", TRUTH, 1.5, present(window).map(|of| truth(window, of + 1)).collect()),
        ("av/history", AV, 2.0, vec![history(&sketch.ego)]),
        ("av/truth", TRUTH, 3.0, vec![truth(window, 0)]),
    ];
    for (part, rgba, width, lines) in parts {
        let strips: Vec<_> = lines.into_iter().filter(|line| line.len() > 1).map(LineStrip3D::from_iter).collect();
        if !strips.is_empty() {
            let lines = style(LineStrips3D::new(strips), rgba, width);
            store.log(format!("{root}/{part}"), &lines)?;
        }
    }
    let now = present(window).map(|of| sketch.neighbors[of][HISTORY - 1]);
    let now = now.map(|[x, y, heading, _, _, length, width, ..]| [x, y, heading, length, width]).collect::<Vec<_>>();
    store.log(format!("{root}/neighbors/now"), &boxes(&now, NEIGHBOR))?;
    let [x, y, heading, _, _, length, width, _] = sketch.ego[HISTORY - 1];
    store.log(format!("{root}/av/now"), &boxes(&[[x, y, heading, length, width]], AV))?;
    // The style of what moves, which is logged without it.
    store.log(format!("{root}/av/plan"), &style(LineStrips3D::update_fields(), PLAN, 3.0))?;
    store.log(format!("{root}/neighbors/predictions"), &style(LineStrips3D::update_fields(), PREDICTION, 2.0))
}

fn style(lines: LineStrips3D, rgba: [u8; 4], width: f32) -> LineStrips3D {
    lines.with_colors([color(rgba)]).with_radii([Radius::new_ui_points(0.5 * width)])
}

/// Agents as they stand: x, y, heading, length, width.
fn boxes(states: &[[f32; 5]], rgba: [u8; 4]) -> impl AsComponents {
    let half_turn = |heading: f32| 0.5 * f64::from(heading);
    let turn = |heading| [0.0, 0.0, libm::sin(half_turn(heading)) as f32, libm::cos(half_turn(heading)) as f32];
    Boxes3D::from_centers_and_half_sizes(
        states.iter().map(|[x, y, ..]| [*x, *y, 0.0]),
        states.iter().map(|[.., length, width]| [0.5 * length, 0.5 * width, 0.05]),
    )
    .with_quaternions(states.iter().map(|[_, _, heading, ..]| Quaternion::from_xyzw(turn(*heading))))
    .with_fill_mode(FillMode::Solid)
    .with_colors([color(rgba)])
}

/// What came of a window at an epoch and a step, as chunks.
pub fn moving(number: usize, window: &Window, look: &Look, [epoch, step]: [i64; 2]) -> Result<Vec<Chunk>, RrdError> {
    let from = |start: [f32; 2], places: &[[f64; 2]; STEPS]| {
        let places = places.map(|place| place.map(|value| value as f32));
        line(std::iter::once(&start[..]).chain(places.iter().map(|place| &place[..])), 4.0)
    };
    let [x, y, ..] = window.sketch.ego[HISTORY - 1];
    let predictions = look.predictions.iter().flat_map(|predictions| {
        present(window).map(|of| {
            let [x, y, ..] = window.sketch.neighbors[of][HISTORY - 1];
            from([x, y], &predictions[of])
        })
    });
    let root = path(number);
    let parts =
        [("av/plan", vec![from([x, y], &look.plan)]), ("neighbors/predictions", predictions.collect::<Vec<_>>())];
    let mut chunks = Vec::new();
    for (part, lines) in parts {
        let times = vec![TimeColumn::new_sequence(EPOCH, [epoch]), TimeColumn::new_sequence(STEP, [step])];
        let count = lines.len();
        let strips = LineStrips3D::update_fields().with_strips(lines.into_iter().map(LineStrip3D::from_iter));
        chunks.extend(rrd::columns_chunk(format!("{root}/{part}"), times, strips.columns([count])?)?);
    }
    Ok(chunks)
}
