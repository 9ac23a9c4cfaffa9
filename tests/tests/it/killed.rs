//! A run that is killed and continued by the same command comes out as if it had not been.

use std::fs;
use std::thread::sleep;
use std::time::{Duration, Instant};

use crate::stage::{Stage, assert_same};

/// Numbers between 0 and 1 without rhyme, the same every time (splitmix64).
pub struct Moments(pub u64);

impl Iterator for Moments {
    type Item = f64;

    fn next(&mut self) -> Option<f64> {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        Some(((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64)
    }
}

/// Kills runs of `arguments` at so many moments, `at_once` of them in the life of one run.
fn killed(arguments: &str, seed: u64, kills: usize, at_once: usize) {
    let stage = Stage::new();
    let begin = Instant::now();
    stage.good_sim(&format!("run --driver idm {arguments} --out whole"));
    let whole = begin.elapsed();
    let expected = stage.files("whole");
    let settings = fs::read(stage.path("whole/run.toml")).unwrap();
    let mut moments = Moments(seed);
    let mut done = 0;
    while done < kills {
        let run = format!("run{done}");
        let command = format!("run --driver idm {arguments} --out {run}");
        let mut stored = 0;
        for _ in 0..at_once.min(kills - done) {
            let mut sim = stage.start(&command);
            let share = 1.1 * moments.next().unwrap();
            sleep(whole.mul_f64(share));
            sim.kill().unwrap();
            sim.wait().unwrap();
            stage.wait_until_alone();
            done += 1;
            assert!(stage.parts(&run) >= stored || stage.path(&run).join("results.parquet").exists());
            stored = stage.parts(&run);
        }
        let ended = stage.good_sim(&command);
        if stored > 0 && !ended.err.contains("is finished already") {
            assert!(ended.err.contains(&format!("{stored} of ")), "{stored} were stored: {}", ended.err);
        }
        assert_same(&expected, &stage.files(&run));
        assert_eq!(fs::read(stage.path(&run).join("run.toml")).unwrap(), settings);
        fs::remove_dir_all(stage.path(&run)).unwrap();
    }
}

#[test]
fn a_run_killed_at_random_moments_ends_with_the_same_files() {
    killed("--scenarios small.toml --parallel 2", 1, 4, 2);
}

#[test]
#[ignore = "takes minutes"]
fn a_run_killed_at_50_random_moments_ends_with_the_same_files() {
    killed("--parallel 2", 2, 50, 3);
}

#[test]
fn two_sims_do_not_work_in_one_folder() {
    let stage = Stage::new();
    let mut first = stage.start("run --driver idm --scenarios small.toml --record none --out run");
    crate::stage::wait_until("the first has its folder", || stage.path("run/run.toml").exists());
    let second = stage.command("run --driver idm --scenarios small.toml --record none --out run").output().unwrap();
    let said = String::from_utf8_lossy(&second.stderr).into_owned();
    // A slow machine may have let the first one finish.
    assert!(said.contains("another sim works in run") || said.contains("is finished already"), "{said}");
    assert_eq!(first.wait().unwrap().code(), Some(0));
    sleep(Duration::from_millis(10));
}
