//! What signals show.

use std::collections::BTreeMap;

use world::geometry::Point3;
use world::map::{Map, MapId};
use world::signal::{Signal, SignalState};

use super::ScenarioNetError;
use super::dataset::Dataset;
use super::features::NOWHERE;
use super::form;
use super::layout::{Layout, Wrong};
use super::pickle::Value;
use crate::numbering::Numbering;

/// In fewer steps than this a lane of an old scene has no signal that was kept: the first converters lost all but one step.
const LEAST_STEPS: usize = 2;

/// The signals of each step.
pub(super) fn signals<'p>(
    layout: &Layout<'p>,
    states: Option<Value<'p>>,
    map: &Map,
    numbers: &mut Numbering,
    steps: usize,
    dataset: Dataset,
) -> Result<Vec<Vec<Signal>>, ScenarioNetError> {
    layout.spend(steps)?;
    let begins = map.lanes.iter().filter_map(|lane| Some((lane.id, *lane.centerline.first()?)));
    let reader = Reader { layout, begins: begins.collect(), dataset };
    let mut signals = vec![Vec::new(); steps];
    let Some(states) = states else { return Ok(signals) };
    let mut is_old = false;
    if let Some(dict) = layout.pickle.dict(states) {
        for (key, signal) in dict {
            is_old |= reader.one(*key, *signal, numbers, &mut signals)?;
        }
    } else if let Some(list) = layout.pickle.items(states) {
        is_old = true;
        for (step, lanes) in list.iter().take(steps).enumerate() {
            for (key, signal) in layout.pickle.dict(*lanes).unwrap_or_default() {
                layout.spend(1)?;
                let lane = layout.pickle.name(*key).map(|name| MapId(numbers.number(&name)));
                let state =
                    layout.find(*signal, &["state", "object_state"]).and_then(|state| form::signal(layout, state));
                let (Some(lane), Some(state)) = (lane, state) else { continue };
                let stop_point = layout.find(*signal, &["stop_point"]).and_then(|value| layout.point(value));
                signals[step].push(Signal { lane, state, stop_point: stop_point.unwrap_or(NOWHERE) });
            }
        }
    } else {
        return Err(layout.kind("dynamic_map_states", "a dict or a list", states));
    }
    if is_old && is_lost(&signals) {
        signals.iter_mut().for_each(Vec::clear);
    }
    Ok(signals)
}

/// Whether no lane has a signal for more than a single step.
fn is_lost(signals: &[Vec<Signal>]) -> bool {
    let mut seen = BTreeMap::<MapId, usize>::new();
    signals.iter().flatten().for_each(|signal| *seen.entry(signal.lane).or_default() += 1);
    seen.values().all(|steps| *steps < LEAST_STEPS)
}

struct Reader<'l, 'p> {
    layout: &'l Layout<'p>,
    /// Where each lane begins.
    begins: BTreeMap<MapId, Point3>,
    dataset: Dataset,
}

impl<'p> Reader<'_, 'p> {
    /// Appends what one lane's signal shows. Whether it is of an old form.
    fn one(
        &self,
        key: Value<'p>,
        signal: Value<'p>,
        numbers: &mut Numbering,
        signals: &mut [Vec<Signal>],
    ) -> Result<bool, ScenarioNetError> {
        let layout = self.layout;
        let name = layout.pickle.name(key).unwrap_or_default();
        let at = format_args!("signal {name}").to_string();
        let missing = || Layout::wrong(&at, Wrong::Missing);
        let state = layout.find(signal, &["state"]).ok_or_else(missing)?;
        let shown = layout.find(state, &["object_state"]).ok_or_else(missing)?;
        if let Some(lanes) = layout.find(state, &["lane"]) {
            let points = layout.find(state, &["stop_point"]).ok_or_else(missing)?;
            let [shown, lanes, points] =
                [layout.rows(&at, shown)?, layout.rows(&at, lanes)?, layout.rows(&at, points)?];
            for (step, signals) in signals.iter_mut().enumerate().take(shown.len()) {
                let lane = lanes.at(step, 0);
                let stop_point = Point3::new(points.at(step, 0), points.at(step, 1), points.at(step, 2));
                // Lane 0 at 0, 0 means that it was not seen.
                if lane == 0.0 && stop_point == Point3::default() {
                    continue;
                }
                layout.spend(1)?;
                let lane = MapId(numbers.number(&(lane as i64).to_string()));
                signals.push(Signal { lane, state: form::signal_number(shown.at(step, 0)), stop_point });
            }
            return Ok(true);
        }
        let lane = layout.find(signal, &["lane"]).and_then(|lane| layout.pickle.name(lane));
        let lane = MapId(numbers.number(&lane.unwrap_or(name)));
        let stop_point = layout.find(signal, &["stop_point"]).and_then(|value| layout.point(value));
        let begin = self.begins.get(&lane).copied();
        let stop_point = match stop_point {
            Some(point) if self.dataset.has_signals_in_the_junction() => begin.unwrap_or(point),
            Some(point) => point,
            None => begin.unwrap_or(NOWHERE),
        };
        let number = layout.pickle.numbers(shown);
        let shown_at = |step: usize| -> Option<SignalState> {
            match (&number, layout.pickle.items(shown)) {
                (Some(numbers), _) => (step < numbers.rows).then(|| form::signal_number(numbers.at(step, 0))),
                (None, Some(states)) => form::signal(layout, *states.get(step)?),
                (None, None) => None,
            }
        };
        for (step, signals) in signals.iter_mut().enumerate() {
            layout.spend(1)?;
            signals.extend(shown_at(step).map(|state| Signal { lane, state, stop_point }));
        }
        Ok(false)
    }
}
