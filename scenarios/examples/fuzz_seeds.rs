//! Writes small whole scenes into the folder given, for the fuzzer to start from.

#![allow(clippy::expect_used, reason = "wrong usage may end it by panic")]

use std::path::PathBuf;

fn main() -> std::io::Result<()> {
    let folder = PathBuf::from(std::env::args_os().nth(1).expect("give a folder"));
    std::fs::create_dir_all(&folder)?;
    for (index, seed) in scenarios::fuzzing::womd_seeds().iter().enumerate() {
        std::fs::write(folder.join(index.to_string()), seed)?;
    }
    Ok(())
}
