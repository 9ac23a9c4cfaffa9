//! Features beside the authors' own; skipped where they are not there.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test may panic, and prints its table")]

use std::f64::consts::TAU;

use network::features::{Features, Moment, Other, Style};
use network::frame::{Frame, HISTORY, Tensors};
use scenarios::SceneSet;
use vectors::Npz;
use world::scene::{AgentState, Scene};

fn array(npz: &Npz, name: &str, shape: &[usize]) -> Vec<f64> {
    npz.array(name, &shape.iter().copied().map(Some).collect::<Vec<_>>()).unwrap().to_vec()
}

/// Everybody but the AV at log index `now`; and which track each is.
fn others(scene: &Scene, now: usize) -> (Vec<Other>, Vec<usize>) {
    let others = scene.tracks().iter().enumerate().filter(|(index, _)| *index != scene.av_index());
    let at = |states: &[Option<AgentState>]| {
        std::array::from_fn(|row| (now + row).checked_sub(HISTORY - 1).and_then(|at| states[at]))
    };
    others.map(|(index, track)| (Other { kind: track.kind, history: at(&track.states) }, index)).unzip()
}

/// The greatest difference of columns, and modulo a turn.
fn worst(got: &[f32], wanted: &[f64], width: usize, columns: &[usize], turn: bool) -> f64 {
    let rows = got.chunks_exact(width).zip(wanted.chunks_exact(width));
    let differences = rows.flat_map(|(got, wanted)| {
        columns.iter().map(|column| {
            let difference = (f64::from(got[*column]) - wanted[*column]).abs();
            if turn { difference.min((difference - TAU).abs()) } else { difference }
        })
    });
    differences.fold(0.0, f64::max)
}

#[test]
fn features_are_the_authors() {
    let (Some(folder), Some(data)) =
        (vectors::shared("dipp/feature-vectors"), vectors::shared("data/womd-derived/20s"))
    else {
        return;
    };
    let set = SceneSet::open(&[data.display().to_string()]).unwrap();
    for path in vectors::npz_files(&folder).unwrap() {
        let name = path.file_stem().unwrap().to_string_lossy().into_owned();
        if name.starts_with("synthetic") {
            continue;
        }
        let npz = Npz::read(&path).unwrap();
        let index = set.entries().iter().position(|entry| name.starts_with(entry.id.as_str())).unwrap();
        let (scene, _) = set.load(index).unwrap();
        let now = npz.number("timestep").unwrap() as usize;
        let rows = array(&npz, "sdc_hist_states", &[HISTORY, 8]);
        let av = std::array::from_fn(|row| {
            let [x, y, heading, velocity_x, velocity_y, length, width, height] = rows.as_chunks::<8>().0[row];
            AgentState { x, y, z: 0.0, heading, velocity_x, velocity_y, length, width, height }
        });
        let (others, tracks) = others(&scene, now);
        let av_is_logged = npz.number("override").unwrap() == 0.0;
        let moment = Moment { av, av_is_logged, others: &others, signals: scene.signals(now) };
        let mut features = Features::new(scene.map(), Style::Authors);
        let mut frame = Frame::default();
        let sources = features.frame(&moment, &mut frame);
        let begin = std::time::Instant::now();
        features.frame(&moment, &mut frame);
        let took = begin.elapsed();

        let wanted: Vec<usize> =
            npz.array("neighbors_to_predict", &[None]).unwrap().iter().map(|track| *track as usize).collect();
        let got: Vec<usize> = sources.neighbors.iter().map(|other| tracks[*other]).collect();
        assert_eq!(got, wanted, "{name}: neighbors");
        let ids = array(&npz, "lane_ids", &[11, 6, 12]);
        let starts = array(&npz, "lane_start", &[11, 6, 12]);
        let candidates = array(&npz, "lane_candidates", &[11]);
        for (agent, wanted) in candidates.iter().enumerate() {
            let told = sources.candidates[agent].map_or(-1.0, |count| count as f64);
            assert_eq!(told, *wanted, "{name}: candidates of agent {agent}");
            for slot in 0..6 {
                for lane in 0..12 {
                    let at = (agent * 6 + slot) * 12 + lane;
                    let entry = sources.lanes[agent].get(slot).and_then(|sequence| sequence.get(lane));
                    assert_eq!(entry.map_or(-1.0, |(id, _)| id.0 as f64), ids[at], "{name}: agent {agent} slot {slot}");
                    if let Some((_, start)) = entry {
                        assert_eq!(*start as f64, starts[at], "{name}: agent {agent} slot {slot} lane {lane}");
                    }
                }
            }
        }
        let Tensors { ego, neighbors, map_lanes, map_crosswalks } = Tensors::from(&frame);
        let shape = |name: &str, shape: &[usize]| array(&npz, name, shape);
        let (want_ego, want_neighbors) = (shape("ego", &[20, 8]), shape("neighbors", &[10, 20, 9]));
        let want_lanes = shape("map_lanes", &[11, 6, 100, 17]);
        let want_crosswalks = shape("map_crosswalks", &[11, 4, 100, 3]);
        let codes = worst(&map_lanes, &want_lanes, 17, &[10, 11, 12, 13, 14, 15, 16], false);
        let limit = worst(&map_lanes, &want_lanes, 17, &[9], false);
        let places = worst(&ego, &want_ego, 8, &[0, 1], false)
            .max(worst(&neighbors, &want_neighbors, 9, &[0, 1], false))
            .max(worst(&map_lanes, &want_lanes, 17, &[0, 1, 3, 4, 6, 7], false));
        let outlines = worst(&map_crosswalks, &want_crosswalks, 3, &[0, 1], false);
        let headings = worst(&ego, &want_ego, 8, &[2], true)
            .max(worst(&neighbors, &want_neighbors, 9, &[2], true))
            .max(worst(&map_lanes, &want_lanes, 17, &[2, 5, 8], true))
            .max(worst(&map_crosswalks, &want_crosswalks, 3, &[2], true));
        let velocities =
            worst(&ego, &want_ego, 8, &[3, 4], false).max(worst(&neighbors, &want_neighbors, 9, &[3, 4], false));
        let sizes =
            worst(&ego, &want_ego, 8, &[5, 6, 7], false).max(worst(&neighbors, &want_neighbors, 9, &[5, 6, 7], false));
        println!(
            "{name}: codes {codes}, limit {limit:.1e}, places {places:.1e}, outlines {outlines:.1e}, headings {headings:.1e}, \
             velocities {velocities:.1e}, sizes {sizes:.1e}; {took:?}"
        );
        assert!(codes == 0.0 && limit <= 1e-5 && places <= 5e-5 && outlines <= 5e-5, "{name}");
        assert!(headings <= 1e-5 && velocities <= 1e-5 && sizes <= 1e-6, "{name}");
    }
}
