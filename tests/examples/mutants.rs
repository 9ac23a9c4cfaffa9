//! Damages recordings a million times, and has each read in all ways that there are: `mutants COUNT FIRST-SEED x.mcap ...`
//!
//! Short recordings are made of the first steps of those given, with a piece of their map and line, so that many a second are read. Each damaged one goes through `info`, `export` and what `explain`
//! reads, in this process: a panic, or 5 s over one of them, ends it with the seed that shows it. Nothing is written to disk.

#![allow(clippy::expect_used, clippy::print_stdout, clippy::unwrap_used, reason = "a trial that is started by hand")]

use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use planner_node::explain;
use recorder::fuzzing;
use recorder::mcap::{EpisodeWriter, read};
use recorder::message::{Body, Message};
use recording::mutants::{Dice, mutant};
use wire::proto;

/// Longer than this none may take.
const LIMIT: Duration = Duration::from_secs(5);

/// Samples of the reference line that are kept.
const SAMPLES: usize = 1200;

/// Steps that are kept.
const STEPS: u32 = 2;

static SEED: AtomicU64 = AtomicU64::new(0);

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [count, first, files @ ..] = arguments.as_slice() else {
        eprintln!("usage: mutants COUNT FIRST-SEED x.mcap ...");
        std::process::exit(2);
    };
    let (count, first): (u64, u64) = (count.parse().expect("a number"), first.parse().expect("a number"));
    let seeds: Vec<Vec<u8>> = files.iter().map(|file| short(&std::fs::read(file).expect("a recording"))).collect();
    std::thread::spawn(watch);
    let begin = Instant::now();
    let mut worst = (Duration::ZERO, 0);
    let (mut told, mut explained) = (0_u64, 0_u64);
    for seed in first..first + count {
        SEED.store(seed, Ordering::Relaxed);
        let start = Instant::now();
        let mut dice = Dice(seed);
        let bytes = mutant(&seeds[dice.below(seeds.len())], &mut dice);
        fuzzing::recording(&bytes);
        let step = dice.below(STEPS as usize) as u32;
        if let Ok(recorded) = explain::step_of(&bytes, Path::new("mutant.mcap"), step) {
            told += 1;
            // All that is read is explained at the first step, some of it at the second.
            if seed % 8 == 0 {
                explained += u64::from(explain::explain_step(step, &recorded, None).is_ok());
            }
        }
        worst = worst.max((start.elapsed(), seed));
        if (seed - first + 1) % 50_000 == 0 || seed + 1 == first + count {
            let done = seed - first + 1;
            println!(
                "{done} mutants in {:.0} s: {told} tell the step, {explained} explained; worst {:.3} s (seed {}), {}",
                begin.elapsed().as_secs_f64(),
                worst.0.as_secs_f64(),
                worst.1,
                peak()
            );
        }
    }
}

/// The recording of the first steps, a chunk each.
fn short(bytes: &[u8]) -> Vec<u8> {
    let mut messages: Vec<Message> = Vec::new();
    let contents = read(bytes, |message| messages.push(message)).expect("a recording");
    let mut writer = EpisodeWriter::new(&contents.run, &contents.settings).expect("it was one");
    let mut short = Vec::new();
    messages.retain(|message| message.step() < STEPS || matches!(message.body, Body::End(_)));
    for message in messages.into_iter().map(trimmed) {
        if matches!(message.body, Body::Observation(_) | Body::End(_)) {
            writer.close_chunk().expect("it is in memory");
        }
        writer.write(&message).expect("it was written before");
    }
    short.extend(writer.take());
    short.extend(writer.finish().expect("it is in memory"));
    println!("{} bytes", short.len());
    short
}

/// The same message with less in it.
fn trimmed(message: Message) -> Message {
    let shorten = |line: Option<&mut proto::ReferenceLine>| {
        let Some(line) = line else { return };
        for column in
            [&mut line.x, &mut line.y, &mut line.z, &mut line.heading, &mut line.curvature, &mut line.speed_limit]
        {
            column.truncate(SAMPLES);
        }
        line.crosswalk.truncate(SAMPLES);
    };
    let body = match message.body {
        Body::Scene(mut scene) => {
            shorten(scene.reference_line.as_mut());
            let gone = scene.history.len().saturating_sub(2);
            scene.history.drain(..gone);
            if let Some(map) = &mut scene.map {
                map.lanes.truncate(2);
                map.road_lines.truncate(1);
                map.road_edges.truncate(1);
            }
            Body::Scene(scene)
        }
        Body::Observation(observation) => {
            let (window_first_sample, window_samples) = (0, SAMPLES as u32);
            Body::Observation(Box::new(proto::Observation { window_first_sample, window_samples, ..*observation }))
        }
        other => return Message { body: other, payload: message.payload },
    };
    Message::encode(body)
}

/// Ends the process when a mutant takes too long.
fn watch() {
    let (mut last, mut since) = (0, Instant::now());
    loop {
        std::thread::sleep(Duration::from_millis(50));
        let seed = SEED.load(Ordering::Relaxed);
        if seed != last {
            (last, since) = (seed, Instant::now());
        } else if since.elapsed() > LIMIT {
            println!("seed {seed} hangs");
            std::process::exit(1);
        }
    }
}

/// The most memory that was used.
fn peak() -> String {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find(|line| line.starts_with("VmHWM"));
    line.unwrap_or("peak memory unknown").split_whitespace().collect::<Vec<_>>().join(" ")
}
