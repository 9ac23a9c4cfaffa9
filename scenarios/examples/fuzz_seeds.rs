//! Writes small whole scenes into the folder given, for the fuzzer to start from: WOMD's messages of both formats, behind `pickles` ScenarioNet's, behind `tables` Argoverse's.

#![allow(clippy::expect_used, reason = "wrong usage may end it by panic")]

use std::path::PathBuf;

fn main() -> std::io::Result<()> {
    let folder = PathBuf::from(std::env::args_os().nth(1).expect("give a folder"));
    let seeds = match std::env::args().nth(2).as_deref() {
        Some("pickles") => scenarios::fuzzing::scenarionet_seeds(),
        Some("tables") => scenarios::fuzzing::argoverse_seeds(),
        _ => [scenarios::fuzzing::womd_seeds(), scenarios::fuzzing::example_seeds()].concat(),
    };
    std::fs::create_dir_all(&folder)?;
    for (index, seed) in seeds.iter().enumerate() {
        std::fs::write(folder.join(index.to_string()), seed)?;
    }
    Ok(())
}
