//! What recording costs: one episode of 150 steps among 128 agents with a prediction for all of them, and one among 64 without.
//!
//! `cargo bench -p recorder --bench episode`. The floor is what it takes to compress the messages' bytes once with zstd at the file's
//! level; it is measured beside.

#![allow(clippy::unwrap_used, missing_docs, reason = "a bench")]

#[path = "../tests/it/synthetic.rs"]
#[allow(dead_code)]
mod synthetic;

use criterion::{BatchSize, Criterion, criterion_group, criterion_main};
use recorder::mcap::EpisodeWriter;
use recorder::message::Message;
use recorder::rrd::Drawing;
use recorder::sequence::{Answers, Sequence};

const SIZES: [(&str, synthetic::Size); 2] = [
    ("128 agents, predicted", synthetic::Size { agents: 128, steps: 150, futures: 1 }),
    ("64 agents", synthetic::Size { agents: 64, steps: 150, futures: 0 }),
];

fn write_mcap(messages: &[Message]) -> usize {
    let mut writer = EpisodeWriter::new("bench", synthetic::SETTINGS).unwrap();
    let mut bytes = 0;
    for message in messages {
        writer.write(message).unwrap();
        bytes += writer.take().len();
    }
    bytes + writer.finish().unwrap().len()
}

fn draw(messages: &[Message]) -> usize {
    let mut drawing = Drawing::default();
    messages.iter().for_each(|message| drawing.push(message));
    drawing.finish("bench", synthetic::SETTINGS).unwrap().len()
}

fn order(messages: Vec<Message>, predictor: bool) -> usize {
    let mut sequence = Sequence::new(Answers { predictor, traffic: false });
    let mut given = 0;
    for message in messages {
        let message = Message::decode(message.channel(), message.payload).unwrap();
        sequence.push(message).unwrap();
        while sequence.pop().is_some() {
            given += 1;
        }
    }
    given
}

fn episode(criterion: &mut Criterion) {
    for (name, size) in SIZES {
        let messages = synthetic::episode("episode", size);
        let payload: usize = messages.iter().map(|message| message.payload.len()).sum();
        eprintln!("{name}: payload {payload} B, mcap {} B, rrd {} B", write_mcap(&messages), draw(&messages));
        let mut group = criterion.benchmark_group(name);
        group.sample_size(10);
        group.bench_function("decode and order", |bencher| {
            bencher.iter_batched(
                || messages.clone(),
                |messages| order(messages, size.futures > 0),
                BatchSize::LargeInput,
            );
        });
        group.bench_function("mcap", |bencher| bencher.iter(|| write_mcap(&messages)));
        group.bench_function("rrd", |bencher| bencher.iter(|| draw(&messages)));
        let raw: Vec<u8> = messages.iter().flat_map(|message| message.payload.iter().copied()).collect();
        group.bench_function("floor: zstd of the messages alone", |bencher| {
            bencher.iter(|| {
                let mut writer = recorder::mcap::Encoder::new().unwrap();
                let channel = writer.add_channel("/raw", "raw", b"").unwrap();
                raw.chunks(60_000).for_each(|chunk| writer.write(channel, 0, chunk).unwrap());
                writer.finish().unwrap().len()
            });
        });
        group.finish();
    }
}

criterion_group!(benches, episode);
criterion_main!(benches);
