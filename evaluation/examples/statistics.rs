//! The statistics of `sim compare`, for programs in other languages: a question in JSON on a line of standard input, its answer on a
//! line of standard output.
//!
//! | question | answer |
//! | --- | --- |
//! | `{"op": "wilson", "hits": N, "trials": N}` | `low`, `high` |
//! | `{"op": "mcnemar", "one_way": N, "other_way": N}` | `p`, and how many flips one way it `needs` beside the fewer |
//! | `{"op": "mean", "values": [...], "seed": N, "resamples": N}` | `low`, `high` (BCa), `p` (sign flips), `detectable` |
//!
//! `evaluation/checks/statistics.py` asks.

#![allow(clippy::print_stdout, reason = "it answers there")]

use std::io::BufRead;

use evaluation::compare::statistics::{bootstrap, power, proportion, signs};
use serde::Deserialize;
use serde_json::json;

#[derive(Deserialize)]
#[serde(tag = "op", rename_all = "lowercase")]
enum Question {
    Wilson { hits: usize, trials: usize },
    Mcnemar { one_way: usize, other_way: usize },
    Mean { values: Vec<f64>, seed: u64, resamples: usize },
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    for line in std::io::stdin().lock().lines() {
        let answer = match serde_json::from_str(&line?)? {
            Question::Wilson { hits, trials } => json!(proportion::wilson(hits, trials)),
            Question::Mcnemar { one_way, other_way } => {
                let needs = proportion::flips_needed(one_way.min(other_way));
                json!({ "p": proportion::mcnemar(one_way, other_way), "needs": needs })
            }
            Question::Mean { values, seed, resamples } => {
                let interval = bootstrap::mean_interval(&values, seed, resamples);
                json!({
                    "low": interval.map(|interval| interval.low),
                    "high": interval.map(|interval| interval.high),
                    "p": signs::mean_chance(&values, seed, resamples),
                    "detectable": power::detectable_mean(&values),
                })
            }
        };
        println!("{answer}");
    }
    Ok(())
}
