//! Tells which git revision is built; builds as well where there is no git or no checkout.
//!
//! Only a release build asks, and is made again with each commit. Everything hangs on this crate: a debug build that did would be
//! made anew at each commit too, and says instead that it is one.

use std::process::Command;

fn git(arguments: &[&str]) -> Option<String> {
    let output = Command::new("git").args(arguments).output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    (output.status.success() && !text.trim().is_empty()).then(|| text.trim().to_owned())
}

fn revision() -> Option<String> {
    // A source archive inside somebody else's checkout must not take that one's revision.
    git(&["ls-files", "--error-unmatch", "build.rs"])?;
    for name in ["HEAD", "logs/HEAD"] {
        if let Some(path) = git(&["rev-parse", "--git-path", name]) {
            println!("cargo:rerun-if-changed={path}");
        }
    }
    git(&["describe", "--always", "--dirty", "--abbrev=12", "--exclude=*"])
}

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    let release = std::env::var("PROFILE").is_ok_and(|profile| profile == "release");
    let revision = if release { revision() } else { Some("debug build".to_owned()) };
    println!("cargo:rustc-env=RELOOP_REVISION={}", revision.as_deref().unwrap_or("unknown revision"));
}
