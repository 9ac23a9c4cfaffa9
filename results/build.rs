//! Tells the crate which git revision it is built from; builds as well where there is no git or no checkout.

use std::process::Command;

fn git(arguments: &[&str]) -> Option<String> {
    let output = Command::new("git").args(arguments).output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    (output.status.success() && !text.trim().is_empty()).then(|| text.trim().to_owned())
}

fn main() {
    // A source archive inside somebody else's checkout must not take that one's revision.
    let inside = git(&["ls-files", "--error-unmatch", "build.rs"]).is_some();
    let revision = inside.then(|| git(&["describe", "--always", "--dirty", "--abbrev=12", "--exclude=*"])).flatten();
    println!("cargo:rustc-env=RELOOP_GIT_REVISION={}", revision.as_deref().unwrap_or("unknown"));
    for name in ["HEAD", "logs/HEAD"] {
        if let Some(path) = git(&["rev-parse", "--git-path", name]) {
            println!("cargo:rerun-if-changed={path}");
        }
    }
    for sources in ["build.rs", "src", "../wire/src", "../wire/proto", "../world/src", "../scenarios/src"] {
        println!("cargo:rerun-if-changed={sources}");
    }
}
