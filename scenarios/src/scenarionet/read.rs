//! From a file's bytes to a checked scene.

use world::scene::{Finding, Scene, SceneId, SceneParts, TrackId, TrackToPredict};

use super::dataset::Dataset;
use super::layout::{Layout, Wrong};
use super::pickle::{Pickle, Value, first_id};
use super::{MAX_FILE_BYTES, ScenarioNetError, features, signals, tracks};
use crate::numbering::Numbering;

/// The scene in a file's `bytes`, and what was found odd in it and mended.
///
/// # Errors
/// [`ScenarioNetError`]: where in the file, or where in the scene, and what is wrong there.
pub fn read(bytes: &[u8]) -> Result<(Scene, Vec<Finding>), ScenarioNetError> {
    if bytes.len() as u64 > MAX_FILE_BYTES {
        return Err(ScenarioNetError::TooLong(bytes.len() as u64));
    }
    let pickle = Pickle::read(bytes)?;
    let (parts, mut findings) = parts(&Layout::new(&pickle))?;
    let (scene, found) = parts.check()?;
    findings.extend(found);
    Ok((scene, findings))
}

/// The id of the scene in a file, by its first bytes where they tell, else by all that `whole` gives.
///
/// # Errors
/// [`ScenarioNetError`] as of [`read`], and what `whole` fails with.
pub fn scene_id<E: From<ScenarioNetError>>(
    start: &[u8],
    whole: impl FnOnce() -> Result<Vec<u8>, E>,
) -> Result<SceneId, E> {
    let id = match first_id(start) {
        Some(id) => id,
        None => {
            let bytes = whole()?;
            let pickle = Pickle::read(&bytes).map_err(ScenarioNetError::from)?;
            let layout = Layout::new(&pickle);
            let scene = outermost(&layout)?;
            id(&layout, scene, metadata(&layout, scene))
        }
    };
    Ok(SceneId::new(id).map_err(ScenarioNetError::from)?)
}

/// The dict that all of a scene is in.
fn outermost<'p>(layout: &Layout<'p>) -> Result<Value<'p>, ScenarioNetError> {
    let root = layout.pickle.root();
    let Some(pairs) = layout.pickle.dict(root) else {
        return Err(ScenarioNetError::NoScene("it holds no dict"));
    };
    let has = |key: &str| layout.pickle.get(root, key).is_some();
    let names_files = || pairs.iter().all(|(key, _)| layout.pickle.text(*key).is_some_and(|key| key.ends_with(".pkl")));
    match () {
        () if has("tracks") => Ok(root),
        () if has("all_agent") => Err(ScenarioNetError::NoScene("it is a training sample of TrafficGen's")),
        () if !pairs.is_empty() && names_files() => Err(ScenarioNetError::NoScene(
            "it is the summary or the mapping of a database, whose folder is to be given",
        )),
        () => Err(ScenarioNetError::NoScene("it has no tracks")),
    }
}

fn metadata<'p>(layout: &Layout<'p>, scene: Value<'p>) -> Option<Value<'p>> {
    layout.find(scene, &["metadata"]).filter(|value| layout.pickle.dict(*value).is_some())
}

fn id<'p>(layout: &Layout<'p>, scene: Value<'p>, metadata: Option<Value<'p>>) -> String {
    let id = layout.find(scene, &["id"]).or_else(|| layout.find(metadata?, &["scenario_id", "id"]));
    id.and_then(|id| layout.pickle.name(id)).unwrap_or_default().into_owned()
}

fn parts(layout: &Layout<'_>) -> Result<(SceneParts, Vec<Finding>), ScenarioNetError> {
    let scene = outermost(layout)?;
    let metadata = metadata(layout, scene);
    let dataset = Dataset::of(layout, metadata);
    // Newer scenes have it in their metadata, older ones at the top.
    let find =
        |keys: &[&str]| metadata.and_then(|metadata| layout.find(metadata, keys)).or_else(|| layout.find(scene, keys));
    let pairs = |keys: &[&str], name: &'static str| match layout.find(scene, keys) {
        Some(value) => layout.pickle.dict(value).ok_or_else(|| layout.kind(name, "a dict", value)),
        None => Err(Layout::wrong(name, Wrong::Missing)),
    };
    let listed = pairs(&["tracks"], "tracks")?;
    let mut track_numbers = tracks::numbering(layout, listed);
    let each = listed.iter().map(|pair| tracks::track(layout, *pair, &mut track_numbers, dataset));
    let mut tracks = each.collect::<Result<Vec<_>, _>>()?;
    let av_index = av_index(layout, find(&["sdc_id"]), find(&["sdc_track_index", "sdc_index"]), listed)?;
    if dataset.has_av_by_its_rear_axle() {
        tracks::put_av_right(&mut tracks[av_index]);
    }
    let steps = tracks[av_index].states.len();
    let (map, mut map_numbers) = features::map(layout, pairs(&["map_features", "map"], "map_features")?, dataset)?;
    let states = layout.find(scene, &["dynamic_map_states"]);
    let signals = signals::signals(layout, states, &map, &mut map_numbers, steps, dataset)?;
    let mut findings = Vec::new();
    let parts = SceneParts {
        id: id(layout, scene, metadata),
        timestamps: timestamps(layout, find(&["ts"]), find(&["sample_rate"]), steps)?,
        tracks,
        av_index,
        signals,
        map,
        current_time_index: current_time_index(layout, find(&["current_time_index"]), &mut findings),
        objects_of_interest: objects_of_interest(layout, find(&["objects_of_interest"]), &mut track_numbers)?,
        tracks_to_predict: tracks_to_predict(layout, find(&["tracks_to_predict"]), &mut findings)?,
    };
    Ok((parts, findings))
}

/// The place of the AV's track: that of its name. What the first converters call an index is a name too, or an index where there is no
/// such name.
fn av_index<'p>(
    layout: &Layout<'p>,
    name: Option<Value<'p>>,
    index: Option<Value<'p>>,
    tracks: &[(Value<'p>, Value<'p>)],
) -> Result<usize, ScenarioNetError> {
    let named = name.or(index).ok_or_else(|| Layout::wrong("sdc_id", Wrong::Missing))?;
    let text = layout.pickle.name(named).ok_or_else(|| layout.kind("sdc_id", "a text or an int", named))?;
    let place = tracks.iter().position(|(key, _)| layout.pickle.name(*key).as_ref() == Some(&text));
    let counted = || match (name, index?) {
        (None, Value::Int(index)) => usize::try_from(index).ok().filter(|index| *index < tracks.len()),
        _ => None,
    };
    place.or_else(counted).ok_or_else(|| Layout::wrong("sdc_id", Wrong::NoTrack(text.into_owned())))
}

/// Steps that are longer or shorter than this (s) are not those of 0.1 s, with frames dropped now and then.
const STEP_LENGTHS: std::ops::RangeInclusive<f64> = 0.08..=0.12;

/// Time of each step (s). nuScenes' have one too many where rounding makes it so.
fn timestamps<'p>(
    layout: &Layout<'p>,
    times: Option<Value<'p>>,
    sample_rate: Option<Value<'p>>,
    steps: usize,
) -> Result<Vec<f64>, ScenarioNetError> {
    layout.spend(steps)?;
    let step = sample_rate.and_then(|value| layout.pickle.float(value)).unwrap_or(0.1);
    let times: Vec<f64> = match times {
        None => (0..steps).map(|index| index as f64 * step).collect(),
        Some(times) => {
            let rows = layout.rows("ts", times)?;
            if rows.len() < steps {
                let wrong = Wrong::Shape { expected: "a time a step", rows: rows.len(), columns: rows.columns() };
                return Err(Layout::wrong("ts", wrong));
            }
            (0..steps).map(|step| rows.at(step, 0)).collect()
        }
    };
    let mut lengths: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    lengths.sort_by(f64::total_cmp);
    match lengths.get(lengths.len() / 2) {
        Some(median) if median.is_finite() && !STEP_LENGTHS.contains(median) => {
            Err(ScenarioNetError::StepLength { seconds: format!("{median:.3}") })
        }
        _ => Ok(times),
    }
}

fn current_time_index<'p>(layout: &Layout<'p>, index: Option<Value<'p>>, findings: &mut Vec<Finding>) -> usize {
    let index = index.and_then(|index| layout.pickle.int(index)).unwrap_or(0);
    usize::try_from(index).unwrap_or_else(|_| {
        findings.push(Finding::CurrentTimeIndex { index });
        0
    })
}

fn objects_of_interest<'p>(
    layout: &Layout<'p>,
    objects: Option<Value<'p>>,
    numbers: &mut Numbering,
) -> Result<Vec<TrackId>, ScenarioNetError> {
    let objects = objects.and_then(|objects| layout.pickle.items(objects)).unwrap_or_default();
    layout.spend(objects.len())?;
    let names = objects.iter().filter_map(|name| layout.pickle.name(*name));
    Ok(names.map(|name| TrackId(i32::try_from(numbers.number(&name)).unwrap_or(i32::MAX))).collect())
}

fn tracks_to_predict<'p>(
    layout: &Layout<'p>,
    tasks: Option<Value<'p>>,
    findings: &mut Vec<Finding>,
) -> Result<Vec<TrackToPredict>, ScenarioNetError> {
    let tasks = tasks.and_then(|tasks| layout.pickle.dict(tasks)).unwrap_or_default();
    layout.spend(tasks.len())?;
    let mut known = Vec::with_capacity(tasks.len());
    for (_, task) in tasks {
        let index = layout.int(*task, &["track_index"]).unwrap_or(-1);
        let difficulty = layout.int(*task, &["difficulty"]).and_then(|number| i32::try_from(number).ok());
        match usize::try_from(index) {
            Ok(track_index) => known.push(TrackToPredict { track_index, difficulty: difficulty.unwrap_or(0) }),
            Err(_) => findings.push(Finding::UnknownTrackToPredict { index }),
        }
    }
    Ok(known)
}
