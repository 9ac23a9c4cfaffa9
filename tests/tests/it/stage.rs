//! A folder of its own for each test, the programs run in it, and what they leave.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use tempfile::TempDir;
use wire::session::RUNTIME_VARIABLE;

/// How long anything may take before a test gives up.
pub const PATIENCE: Duration = Duration::from_secs(120);

/// In the environment of everything that a stage starts, and of what that starts: whose process it is.
const MARK: &str = "RELOOP_TEST_STAGE";

/// A small scene set: three kinds of scenes, drives that end soon and late, and little traffic, for what is tested is not driving.
const SMALL_SET: &str = r#"
[[generate]]
family = "following"
seed = 3
parameters = { traffic = 0.2, parked = 0.1, people = 0.5 }

[[generate]]
family = "curve"
seed = 3
parameters = { traffic = 0.2, parked = 0.1, people = 0.5 }

[[generate]]
family = "red-light"
seed = 3
parameters = { traffic = 0.2, parked = 0.1, people = 0.5 }
"#;

/// A program of the workspace, as it was built with this test.
pub fn program(name: &str) -> PathBuf {
    let target = std::env::current_exe().unwrap().ancestors().nth(2).unwrap().to_owned();
    let path = if ["liar", "follow_the_line", "rogue_traffic"].contains(&name) {
        target.join("examples").join(name)
    } else {
        target.join(name)
    };
    assert!(path.exists(), "{} is not built: test the whole workspace", path.display());
    path
}

/// What a program said, and how it ended.
#[derive(Debug)]
pub struct Ended {
    /// The exit code; none after a signal.
    pub code: Option<i32>,
    /// Standard output.
    pub out: String,
    /// Standard error.
    pub err: String,
}

/// A folder, and all that is started in it.
pub struct Stage {
    folder: TempDir,
    /// What the liar is told.
    lie: Option<String>,
}

impl Stage {
    pub fn new() -> Self {
        let stage = Self { folder: tempfile::tempdir().unwrap(), lie: None };
        fs::write(stage.path("small.toml"), SMALL_SET).unwrap();
        stage
    }

    /// The stage on which the liar tells this: `SCENE STEP LIE`.
    pub fn with_lie(lie: &str) -> Self {
        let mut stage = Self::new();
        stage.lie = Some(lie.to_owned());
        stage
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn mark(&self) -> String {
        format!("{MARK}={}", self.folder.path().display())
    }

    /// `sim` with these arguments, split at spaces.
    pub fn command(&self, arguments: &str) -> Command {
        self.command_of(&program("sim"), arguments)
    }

    /// The same of a `sim` that lies elsewhere.
    pub fn command_of(&self, sim: &Path, arguments: &str) -> Command {
        let mut command = Command::new(sim);
        command.args(arguments.split_whitespace()).current_dir(self.folder.path());
        command.env(MARK, self.folder.path()).env_remove("RUST_LOG").env_remove("COLUMNS");
        command.env_remove(RUNTIME_VARIABLE);
        if let Some(lie) = &self.lie {
            command.env("RELOOP_LIE", lie);
        }
        command
    }

    /// Another program of the workspace, in this folder.
    pub fn beside(&self, name: &str) -> Command {
        let mut command = Command::new(program(name));
        command.current_dir(self.folder.path()).env(MARK, self.folder.path()).env_remove("RUST_LOG");
        command.env_remove(RUNTIME_VARIABLE);
        command
    }

    /// Runs `sim` to its end, and sees that nothing else is left running.
    pub fn sim(&self, arguments: &str) -> Ended {
        let ended = self.sim_beside(arguments);
        let left = self.processes();
        assert!(left.is_empty(), "left running: {left:?}");
        ended
    }

    /// Runs `sim` to its end, while others run.
    pub fn sim_beside(&self, arguments: &str) -> Ended {
        let output = self.command(arguments).output().unwrap();
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
        Ended { code: output.status.code(), out: text(output.stdout), err: text(output.stderr) }
    }

    /// Runs `sim` to its end, which must be a good one.
    pub fn good_sim(&self, arguments: &str) -> Ended {
        let ended = self.sim(arguments);
        assert_eq!(ended.code, Some(0), "{ended:?}");
        ended
    }

    /// Starts `sim` and does not wait.
    pub fn start(&self, arguments: &str) -> Child {
        let mut command = self.command(arguments);
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
    }

    /// Everything that was started on this stage and still runs: process number and name.
    pub fn processes(&self) -> Vec<(Pid, String)> {
        let mark = self.mark();
        let mut found = Vec::new();
        for entry in fs::read_dir("/proc").unwrap().flatten() {
            let Ok(pid) = entry.file_name().to_string_lossy().parse::<i32>() else { continue };
            let environment = fs::read(entry.path().join("environ")).unwrap_or_default();
            let marked = environment.split(|byte| *byte == 0).any(|variable| variable == mark.as_bytes());
            if marked && pid != std::process::id() as i32 {
                let name = fs::read_to_string(entry.path().join("comm")).unwrap_or_default();
                found.push((Pid::from_raw(pid), name.trim().to_owned()));
            }
        }
        found
    }

    /// Waits for a process of this name.
    pub fn wait_for(&self, name: &str) -> Pid {
        let mut pid = None;
        wait_until(&format!("{name} runs"), || {
            pid = self.processes().into_iter().find(|(_, running)| running == name).map(|(pid, _)| pid);
            pid.is_some()
        });
        pid.unwrap()
    }

    /// Waits until nothing that was started here runs any more.
    pub fn wait_until_alone(&self) {
        wait_until("all processes have left", || self.processes().is_empty());
    }

    /// How many episodes of a run are finished and stored.
    pub fn parts(&self, run: &str) -> usize {
        let parts = fs::read_dir(self.path(run).join("parts")).into_iter().flatten().flatten();
        parts.filter(|part| part.file_name().to_string_lossy().ends_with(".part")).count()
    }

    /// Every file of a run whose bytes must not depend on when and how it was run, by name.
    pub fn files(&self, run: &str) -> BTreeMap<String, Vec<u8>> {
        let mut files = BTreeMap::new();
        collect(&self.path(run), "", &mut files);
        for depends in [".lock", "timing.parquet", "run.toml"] {
            files.remove(depends);
        }
        files.retain(|name, _| !name.starts_with("logs/"));
        files
    }
}

impl Drop for Stage {
    fn drop(&mut self) {
        self.processes().iter().for_each(|(pid, _)| {
            let _ = kill(*pid, Signal::SIGKILL);
        });
    }
}

fn collect(folder: &Path, prefix: &str, files: &mut BTreeMap<String, Vec<u8>>) {
    for entry in fs::read_dir(folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display())).flatten() {
        let name = format!("{prefix}{}", entry.file_name().to_string_lossy());
        if entry.path().is_dir() {
            collect(&entry.path(), &format!("{name}/"), files);
        } else {
            files.insert(name, fs::read(entry.path()).unwrap());
        }
    }
}

/// Says which files differ, rather than printing megabytes of them.
pub fn assert_same(one: &BTreeMap<String, Vec<u8>>, other: &BTreeMap<String, Vec<u8>>) {
    let names = |files: &BTreeMap<String, Vec<u8>>| files.keys().cloned().collect::<Vec<_>>();
    assert_eq!(names(one), names(other));
    let differing: Vec<&String> =
        one.iter().filter(|(name, bytes)| other[*name] != **bytes).map(|(name, _)| name).collect();
    assert!(differing.is_empty(), "these differ: {differing:?}");
}

pub fn wait_until(what: &str, mut is_so: impl FnMut() -> bool) {
    let start = Instant::now();
    while !is_so() {
        assert!(start.elapsed() < PATIENCE, "waited in vain until {what}");
        sleep(Duration::from_millis(10));
    }
}

/// Where real scenes may lie; none, with a word about it, where there are none.
pub fn real_scenes(folder: &str) -> Option<PathBuf> {
    shared(&format!("data/{folder}"))
}

/// A folder of what is no part of the repository; none, with a word about it, where it is not at hand.
pub fn shared(folder: &str) -> Option<PathBuf> {
    let repository = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let candidates = [
        std::env::var_os("RELOOP_SHARED").map(PathBuf::from),
        Some(repository.join("../shared")),
        Some(repository.join("../../shared")),
    ];
    let found = candidates.into_iter().flatten().map(|shared| shared.join(folder)).find(|path| path.is_dir());
    if found.is_none() {
        eprintln!("skipped: no {folder} in $RELOOP_SHARED or ../shared");
    }
    found.map(|path| path.canonicalize().unwrap())
}
