//! Compiles `proto/reloop.proto` without `protoc`: to Rust by prost, and to the descriptor set that recordings carry.

use std::error::Error;
use std::{env, fs, path::PathBuf};

use prost::Message;

fn main() -> Result<(), Box<dyn Error>> {
    println!("cargo:rerun-if-changed=proto/reloop.proto");
    let mut descriptors = protox::compile(["reloop.proto"], ["proto"])?;
    let out = PathBuf::from(env::var("OUT_DIR")?);
    prost_build::Config::new().compile_fds(descriptors.clone())?;
    // Comments and line numbers are of no use to a reader of a recording.
    descriptors.file.iter_mut().for_each(|file| file.source_code_info = None);
    fs::write(out.join("descriptors.bin"), descriptors.encode_to_vec())?;
    Ok(())
}
