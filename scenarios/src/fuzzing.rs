//! What every input must keep, in functions that a fuzzer calls; `fuzz/` does so by the million, a test here by the thousand.

use std::io::{Cursor, Read};
use std::path::Path;

use parquet::file::properties::WriterProperties;

use crate::argoverse;
use crate::scenarionet::{self, database};
use crate::set::index;
use crate::tfrecord::{Decoder, Frames, Packing, Records, Restart, Unpack};
use crate::womd::{Skim, Skimmed, WomdError};
use crate::{SetFile, lint, womd};

pub mod exampled;
pub mod pickled;
pub mod tabled;

/// Any bytes as a TFRecord file: no panic, and the same records however the bytes arrive.
///
/// # Panics
/// If that does not hold.
pub fn tfrecord(bytes: &[u8]) {
    let all = |chunk: usize| {
        let mut records = Records::new(Chunks { bytes, chunk });
        let mut found = Vec::new();
        loop {
            match records.next_record() {
                Ok(Some(record)) => found.push((record.offset, record.payload.to_vec())),
                Ok(None) => return (found, None),
                Err(error) => return (found, Some(error.to_string())),
            }
        }
    };
    let whole = all(usize::MAX);
    assert_eq!(whole, all(1 + bytes.len() % 7), "the records depend on how the bytes arrive");
    // A decoder that is told of more bytes than there was space for must not believe it.
    let mut decoder = Decoder::default();
    let _ = decoder.space();
    let _ = decoder.advance(usize::MAX / 2);
    let _ = (decoder.record(), decoder.end());
}

/// Any bytes as a TFRecord file that is skimmed: no panic; the frames that reading finds, up to where a payload is damaged, and of each
/// record the id that reading finds, or none.
///
/// # Panics
/// If that does not hold.
pub fn skim(bytes: &[u8]) {
    let mut records = Records::new(bytes);
    let mut frames = Frames::new(Cursor::new(bytes), bytes.len() as u64);
    loop {
        let (read, skimmed) = (records.next_record(), frames.next_frame());
        let record = match (read, &skimmed) {
            (Ok(Some(record)), Ok(Some(_))) => record,
            (Ok(None), Ok(None)) => return,
            (Err(read), Err(skimmed)) => return assert_eq!(read.to_string(), skimmed.to_string()),
            // Skimming goes on past it: its length is sound.
            (Err(read), Ok(Some(_))) if read.to_string().contains("the checksum of the payload") => {
                while let Ok(Some(_)) = frames.next_frame() {}
                return;
            }
            (read, skimmed) => panic!("reading finds {read:?}, skimming {skimmed:?}"),
        };
        let Ok(Some(frame)) = skimmed else { return };
        let length = record.payload.len() as u64;
        assert_eq!(
            (frame.index, frame.offset, frame.bytes, frame.checksum),
            (record.index, record.offset, length, record.checksum)
        );
        let mut skim = Skim::new(frame.bytes);
        let found = loop {
            // A file in memory can be read.
            let Ok(stretch) = frames.at(frame.payload() + skim.offset()) else { return };
            match skim.take(stretch) {
                Skimmed::More => {}
                Skimmed::Id(id) => break Some(id),
                Skimmed::Untold => break None,
            }
        };
        match (found, womd::scene_id(record.payload)) {
            (Some(found), Ok(id)) => assert_eq!(found, id, "skimming finds another id than reading"),
            (Some(found), Err(WomdError::TwoIds { first, .. })) => assert_eq!(found.as_str(), first),
            // What is wrong behind the id is found when the scene is loaded.
            (Some(_), Err(_)) | (None, _) => {}
        }
    }
}

/// Any bytes as an index, and as the message in a sound one: no panic; what is read is written and read again the same.
///
/// # Panics
/// If that does not hold.
pub fn scene_index(bytes: &[u8]) {
    let folder = Path::new("/data");
    for bytes in [bytes.to_vec(), index::sealed(bytes)] {
        let Ok((_, entries)) = index::read(&bytes, folder) else { continue };
        let again = index::read(&index::write(&entries, folder), folder);
        assert_eq!(again.map(|(_, again)| again).ok(), Some(entries), "writing and reading changes the index");
    }
}

/// Any bytes as a packed TFRecord file, with gzip and with zlib: no panic, the same records however the bytes arrive (up to where
/// damage shows), and the last record again from where the file was entered for it.
///
/// # Panics
/// If that does not hold.
pub fn packed(bytes: &[u8]) {
    for packing in [Packing::Gzip, Packing::Zlib] {
        let all = |chunk: usize| {
            let source = Unpack::from(Chunks { bytes, chunk }, &Restart::beginning(packing));
            let (mut records, mut found) = (Records::new(source), Vec::new());
            loop {
                let restart = records.source().restart();
                match records.next_record() {
                    Ok(Some(record)) => found.push((record.offset, record.payload.to_vec(), restart)),
                    Ok(None) => return (found, None),
                    Err(error) => return (found, Some(error.to_string())),
                }
            }
        };
        let ((found, end), (other, other_end)) = (all(usize::MAX), all(1 + bytes.len() % 7));
        // How much comes out of a block before its damage shows is the decompressor's affair; what does is the same.
        let same = found.iter().zip(&other).all(|(one, two)| (one.0, &one.1) == (two.0, &two.1));
        let whole = found.len() == other.len() || end.is_some();
        assert!(same && whole && end.is_some() == other_end.is_some(), "the records depend on how the bytes arrive");
        if let Some((offset, payload, restart)) = found.last() {
            let rest = bytes.get(restart.byte() as usize..).unwrap_or_default();
            let source = Unpack::from(Chunks { bytes: rest, chunk: usize::MAX }, restart);
            let mut records = Records::starting_at(source, 0, *offset);
            match records.next_record() {
                Ok(Some(again)) => {
                    assert_eq!(again.payload, payload, "a record differs where the file is entered for it")
                }
                // The stream's own checksum is not looked at from the middle: what fails there failed before.
                other => panic!("a record is not found where the file is entered for it: {other:?}"),
            }
        }
    }
}

struct Chunks<'a> {
    bytes: &'a [u8],
    chunk: usize,
}

impl Read for Chunks<'_> {
    fn read(&mut self, space: &mut [u8]) -> std::io::Result<usize> {
        let count = self.bytes.len().min(self.chunk).min(space.len());
        let (taken, rest) = self.bytes.split_at(count);
        space[..count].copy_from_slice(taken);
        self.bytes = rest;
        Ok(count)
    }
}

/// Any bytes as a WOMD record's payload, of either format: no panic; what is read is written and read again the same, under the id that a set
/// finds for it.
///
/// # Panics
/// If that does not hold.
pub fn womd(payload: &[u8]) {
    let id = womd::scene_id(payload);
    let Ok((scene, _)) = womd::read(payload) else { return };
    if let Ok(id) = id {
        assert_eq!(scene.id(), &id, "a set finds another id than the reader");
    }
    let written = womd::write(&scene);
    match womd::read(&written) {
        Ok((again, _)) => assert_eq!(again, scene, "writing and reading changes the scene"),
        Err(error) => panic!("what was written cannot be read: {error}"),
    }
}

/// The same, and the lint (which builds the route) takes whatever scene comes out.
///
/// # Panics
/// If that does not hold.
pub fn womd_lint(payload: &[u8]) {
    if let Ok((scene, findings)) = womd::read(payload) {
        let _ = lint::lint(&std::sync::Arc::new(scene), &findings);
    }
}

/// Any bytes as a pickle of ScenarioNet's, and as a database's index: no panic; the id that is found by the first bytes is the scene's, unless
/// it is there twice; what is read is written as WOMD's and read again; and the lint takes it.
///
/// # Panics
/// If that does not hold.
pub fn scenarionet(bytes: &[u8]) {
    let _ = (database::mapped(bytes), database::summarised(bytes));
    let whole = || -> Result<Vec<u8>, scenarionet::ScenarioNetError> { Ok(bytes.to_vec()) };
    let id = scenarionet::scene_id(&bytes[..bytes.len().min(512)], whole);
    let Ok((scene, findings)) = scenarionet::read(bytes) else { return };
    let pickle = scenarionet::pickle::Pickle::read(bytes);
    let is_id = |pickle: &scenarionet::pickle::Pickle<'_>, key| pickle.text(key) == Some("id");
    let ids = pickle.map(|pickle| {
        pickle.dict(pickle.root()).map_or(0, |all| all.iter().filter(|(key, _)| is_id(&pickle, *key)).count())
    });
    if ids == Ok(1) {
        assert_eq!(id.as_ref().ok(), Some(scene.id()), "a set finds another id than the reader");
    }
    assert!(womd::read(&womd::write(&scene)).is_ok(), "what was written cannot be read");
    let _ = lint::lint(&std::sync::Arc::new(scene), &findings);
}

/// Any bytes as a table and a map of Argoverse 2's, the table's length before them: no panic; the id that is found by the table alone is the
/// scene's; what is read is written as WOMD's and read again; and the lint takes it.
///
/// # Panics
/// If that does not hold.
pub fn argoverse(bytes: &[u8]) {
    let (table, map) = tabled::parted(bytes);
    let id = argoverse::scene_id(table);
    let Ok((scene, findings)) = argoverse::read(table, map) else { return };
    assert_eq!(id.as_ref().ok(), Some(scene.id()), "a set finds another id than the reader");
    assert!(womd::read(&womd::write(&scene)).is_ok(), "what was written cannot be read");
    let _ = lint::lint(&std::sync::Arc::new(scene), &findings);
}

/// Any text as a scene-set TOML: no panic.
pub fn scene_set_toml(bytes: &[u8]) {
    if let Ok(text) = std::str::from_utf8(bytes) {
        let _ = SetFile::parse(text);
    }
}

/// The same scenes as [`womd_seeds`], as ScenarioNet's pickles: of today, and with lanes, signals and tracks as older and other sets have them.
#[must_use]
pub fn scenarionet_seeds() -> Vec<Vec<u8>> {
    let scenes = womd_seeds().into_iter().filter_map(|payload| Some(womd::read(&payload).ok()?.0));
    let of_today: Vec<_> = scenes.map(|scene| pickled::current(&scene)).collect();
    let flat = of_today.iter().cloned().map(|mut scene| {
        *scene.at("metadata").at("dataset") = pickled::text("nuscenes");
        scene
    });
    of_today.iter().cloned().chain(flat).map(|scene| scene.pickle()).collect()
}

/// The same scenes as [`womd_seeds`], as Argoverse 2's tables and maps, packed in three ways.
#[must_use]
pub fn argoverse_seeds() -> Vec<Vec<u8>> {
    let scenes: Vec<_> = womd_seeds().into_iter().filter_map(|payload| Some(womd::read(&payload).ok()?.0)).collect();
    let seed = |(scene, properties): (&world::scene::Scene, WriterProperties)| {
        let table = tabled::table(tabled::columns(scene, 2), properties).ok()?;
        let areas = scene.map().crosswalks.iter().map(|area| area.polygon.clone()).collect::<Vec<_>>();
        Some(tabled::joined(&table, tabled::archive(scene.map(), &areas).to_string().as_bytes()))
    };
    scenes.iter().flat_map(|scene| tabled::packings().map(|packing| (scene, packing))).filter_map(seed).collect()
}

/// The same scenes as [`womd_seeds`], in WOMD's other format, with little room.
#[must_use]
pub fn example_seeds() -> Vec<Vec<u8>> {
    let scenes = womd_seeds().into_iter().filter_map(|payload| Some(womd::read(&payload).ok()?.0));
    let room = exampled::Room { agents: 4, points: 40, signals: 2, past: 1 };
    scenes.map(|scene| exampled::payload(&scene, room)).collect()
}

/// Small whole inputs to start from: three steps, and one of all that a map can hold.
#[must_use]
pub fn womd_seeds() -> Vec<Vec<u8>> {
    let Some(family) = crate::generated::Family::named("red-light") else { return Vec::new() };
    let Ok(payload) = family.payload("seed", 0, 0, &Default::default()) else { return Vec::new() };
    let Ok((scene, _)) = womd::read(&payload) else { return Vec::new() };
    let mut parts = scene.into_parts();
    parts.timestamps.truncate(3);
    parts.signals.truncate(3);
    parts.signals.iter_mut().for_each(|signals| signals.truncate(2));
    parts.tracks.rotate_right(1);
    parts.tracks.truncate(3);
    parts.tracks.iter_mut().for_each(|track| track.states.truncate(3));
    parts.av_index = 0;
    parts.objects_of_interest = parts.tracks.iter().map(|track| track.id).collect();
    parts.tracks_to_predict = vec![world::scene::TrackToPredict { track_index: 1, difficulty: 2 }];
    let map = &mut parts.map;
    map.lanes.truncate(3);
    map.road_lines.truncate(1);
    map.road_edges.truncate(1);
    map.crosswalks.truncate(1);
    map.speed_bumps =
        map.crosswalks.iter().map(|area| world::map::Area { id: world::map::MapId(901), ..area.clone() }).collect();
    map.driveways =
        map.crosswalks.iter().map(|area| world::map::Area { id: world::map::MapId(902), ..area.clone() }).collect();
    map.stop_signs = vec![world::map::StopSign {
        id: world::map::MapId(903),
        lanes: map.lanes.iter().map(|lane| lane.id).collect(),
        position: world::geometry::Point3::default(),
    }];
    map.lanes.iter_mut().for_each(|lane| lane.centerline.truncate(3));
    map.road_lines.iter_mut().for_each(|line| line.polyline.truncate(2));
    map.road_edges.iter_mut().for_each(|edge| edge.polyline.truncate(2));
    let without_map = world::scene::SceneParts { map: world::map::Map::default(), ..parts.clone() };
    [parts, without_map].into_iter().filter_map(|parts| Some(womd::write(&parts.check().ok()?.0))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use world::pcg::Pcg32;

    /// A few thousand inputs, each a whole one with some bytes changed, cut out, repeated or put in.
    fn mutated(seeds: &[Vec<u8>], count: usize, mut test: impl FnMut(&[u8])) {
        let mut random = Pcg32::new(1, 1);
        let mut pick = |below: usize| random.between(0.0, below.max(1) as f64) as usize;
        for round in 0..count {
            let mut input = seeds[round % seeds.len()].clone();
            for _ in 0..=pick(3) {
                let (at, length) = (pick(input.len()), 1 + pick(8));
                let end = (at + length).min(input.len());
                match pick(12) {
                    0 => input.truncate(at),
                    1 => drop(input.drain(at..end)),
                    2 => input.extend_from_within(at..end),
                    3 => input.splice(at..at, [0xff, 0xff, 0xff, 0xff, 0x0f]).for_each(drop),
                    // Mostly flips: they leave lengths whole, so that what follows is still read.
                    _ => input[at..end].iter_mut().take(2).for_each(|byte| *byte ^= 1 << (length - 1)),
                }
            }
            test(&input);
        }
    }

    #[test]
    fn mutated_scenes_do_no_harm() {
        let seeds = womd_seeds();
        assert!(seeds.len() == 2 && seeds.iter().all(|seed| seed.len() < 2000));
        seeds.iter().for_each(|seed| assert!(womd::read(seed).is_ok()));
        let (count, mut scenes) = (20_000, 0);
        mutated(&seeds, count, |input| {
            womd(input);
            womd_lint(input);
            scenes += usize::from(womd::read(input).is_ok());
        });
        assert!(
            scenes > count / 10 && scenes < count,
            "{scenes} inputs are still scenes: the mutations miss their mark"
        );
    }

    #[test]
    fn mutated_examples_do_no_harm() {
        let seeds = example_seeds();
        assert!(seeds.len() == 2 && seeds.iter().all(|seed| seed.len() < 6000));
        seeds.iter().for_each(|seed| assert!(womd::read(seed).is_ok()));
        let (count, mut scenes) = (20_000, 0);
        mutated(&seeds, count, |input| {
            womd(input);
            womd_lint(input);
            let mut file = Vec::new();
            crate::tfrecord::append_record(&mut file, input);
            skim(&file);
            scenes += usize::from(womd::read(input).is_ok());
        });
        assert!(
            scenes > count / 20 && scenes < count,
            "{scenes} inputs are still scenes: the mutations miss their mark"
        );
    }

    #[test]
    fn mutated_pickles_do_no_harm() {
        let seeds = scenarionet_seeds();
        assert!(seeds.len() == 4 && seeds.iter().all(|seed| seed.len() < 30_000));
        seeds.iter().for_each(|seed| drop(scenarionet::read(seed).unwrap()));
        let (count, mut scenes) = (10_000, 0);
        mutated(&seeds, count, |input| {
            scenarionet(input);
            scenes += usize::from(scenarionet::read(input).is_ok());
        });
        assert!(
            scenes > count / 10 && scenes < count,
            "{scenes} inputs are still scenes: the mutations miss their mark"
        );
    }

    #[test]
    fn mutated_pickles_of_every_protocol_do_no_harm() {
        // What is before the last byte is any operations, most of them sound: numbers, containers, marks, the store.
        let soup = b"\x80\x04](K\x01K\x02e\x94}(X\x01\0\0\0aK\x03u\x94h\0\x85\x94h\x01\x86(NI1\nF2\nL3L\nVa\nS'b'\nt\x90ldp4\ng4\n20(1cnumpy\ndtype\n\x8c\x02f8\x85R(K\x03\x8c\x01<tb.";
        mutated(&[soup.to_vec()], 30_000, scenarionet);
    }

    #[test]
    fn mutated_tables_and_maps_do_no_harm() {
        let mut seeds = argoverse_seeds();
        assert!(seeds.len() == 6 && seeds.iter().all(|seed| seed.len() < 20_000));
        // One of pandas, which packs by Snappy.
        let made = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/it/argoverse/train");
        let set = crate::SceneSet::open(&[made.display().to_string()]).unwrap();
        let crate::Source::Table { table, map } = &set.entries()[0].source else { panic!("no table") };
        let [table, map] = [table, map].map(|file| std::fs::read(&file.path).unwrap());
        seeds.push(tabled::joined(&table, &map));
        for seed in &seeds {
            let (table, map) = tabled::parted(seed);
            argoverse::read(table, map).unwrap();
        }
        let (count, mut scenes) = (10_000, 0);
        mutated(&seeds, count, |input| {
            argoverse(input);
            let (table, map) = tabled::parted(input);
            scenes += usize::from(argoverse::read(table, map).is_ok());
        });
        assert!(
            scenes > count / 20 && scenes < count,
            "{scenes} inputs are still scenes: the mutations miss their mark"
        );
    }

    #[test]
    fn mutated_files_do_no_harm() {
        let mut file = Vec::new();
        for payload in [&b"one"[..], b"", b"three and a little more"] {
            crate::tfrecord::append_record(&mut file, payload);
        }
        mutated(&[file], 20_000, tfrecord);
    }

    #[test]
    fn mutated_files_are_skimmed_as_they_are_read() {
        let mut file = Vec::new();
        let scenes = womd_seeds();
        let long = [&b"\x12\x84\x07"[..], &[0; 900], b"\x2a\x04long"].concat();
        let others: [&[u8]; 5] =
            [b"\x2a\x05first\x12\x00\x2a\x04last", b"\x2a\x05laser\x62\x01\x00", b"", b"\xff", &long];
        scenes
            .iter()
            .map(Vec::as_slice)
            .chain(others)
            .for_each(|payload| crate::tfrecord::append_record(&mut file, payload));
        mutated(&[file], 5_000, skim);
        // Payloads that were changed before their checksum was taken.
        mutated(&scenes, 10_000, |payload| {
            let mut file = Vec::new();
            crate::tfrecord::append_record(&mut file, payload);
            skim(&file);
        });
    }

    #[test]
    fn mutated_indices_do_no_harm() {
        let set = crate::SceneSet::open(&["demo".to_owned()]).unwrap();
        let file = std::sync::Arc::new(crate::SceneFile {
            path: "/data/a.tfrecord".into(),
            bytes: 5000,
            modified: None,
            packed: Some(crate::tfrecord::Entrances::of(Packing::Gzip)),
        });
        let place = |record: u64| {
            crate::Source::File(crate::Place {
                file: file.clone(),
                record,
                offset: 90 * record,
                bytes: 74,
                checksum: 7,
            })
        };
        let filed = (0..3).map(|record| crate::SceneEntry {
            id: world::scene::SceneId::new(format!("s{record}")).unwrap(),
            source: place(record),
        });
        let pickle = crate::SceneFile { path: "/data/b.pkl".into(), bytes: 700, modified: None, packed: None };
        let pickled = crate::SceneEntry {
            id: world::scene::SceneId::new("pickled").unwrap(),
            source: crate::Source::Pickle(std::sync::Arc::new(pickle)),
        };
        let entries: Vec<_> = filed.chain([pickled]).chain(set.entries().iter().cloned()).collect();
        let whole = index::write(&entries, Path::new("/data"));
        assert_eq!(index::read(&whole, Path::new("/data")).unwrap().1, entries);
        let message = whole[21..whole.len() - 4].to_vec();
        mutated(&[message], 10_000, scene_index);
        mutated(&[whole], 2_000, scene_index);
    }

    #[test]
    fn mutated_packed_files_do_no_harm() {
        let mut file = Vec::new();
        for payload in [&b"one"[..], b"", &[7; 3000], b"three and a little more"] {
            crate::tfrecord::append_record(&mut file, payload);
        }
        let mut gzip = vec![0x1f, 0x8b, 8, 8, 0, 0, 0, 0, 0, 255, b'n', 0];
        gzip.extend(miniz_oxide::deflate::compress_to_vec(&file, 6));
        gzip.extend(crc32fast::hash(&file).to_le_bytes());
        gzip.extend((file.len() as u32).to_le_bytes());
        let seeds = [gzip.clone(), [&gzip[..], &gzip].concat(), miniz_oxide::deflate::compress_to_vec_zlib(&file, 6)];
        mutated(&seeds, 6_000, packed);
    }

    #[test]
    fn mutated_scene_sets_do_no_harm() {
        let text = b"files = ['a']\nglobs = ['b*']\nscenes = ['c']\n[[generate]]\nfamily = 'd'\nseed = 7\ncount = 3\nname = 'e'\nparameters = { f = 1, g = [2.0, 3] }\n";
        mutated(&[text.to_vec()], 5_000, scene_set_toml);
    }
}
