//! Compiles the messages without `protoc`: to Rust by prost, and to the descriptor sets that recordings and other languages have.

use std::error::Error;
use std::{env, fs, path::PathBuf};

use prost::Message;

fn main() -> Result<(), Box<dyn Error>> {
    println!("cargo:rerun-if-changed=proto");
    let out = PathBuf::from(env::var("OUT_DIR")?);
    let mut bus = protox::compile(["reloop.proto"], ["proto"])?;
    prost_build::Config::new().compile_fds(bus.clone())?;

    // In a folder of its own: what it uses of the bus is made above.
    let mut service = protox::compile(["service.proto"], ["proto"])?;
    let folder = out.join("service");
    fs::create_dir_all(&folder)?;
    let mut config = prost_build::Config::new();
    config.boxed(".reloop.service.v1.Reply.what.session");
    config.extern_path(".reloop.v1", "crate::proto").out_dir(folder).compile_fds(service.clone())?;
    service.file.retain(|file| file.name() == "service.proto");

    for (descriptors, name) in [(&mut bus, "descriptors.bin"), (&mut service, "service.bin")] {
        // Comments and line numbers are of no use to a reader of a recording.
        descriptors.file.iter_mut().for_each(|file| file.source_code_info = None);
        fs::write(out.join(name), descriptors.encode_to_vec())?;
    }
    Ok(())
}
