//! What a service lets its clients have: scene sets and weights by name, never by path; drivers of ours; and commands, if it is told so.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use clap::Parser as _;
use results::drivers::DRIVERS;
use results::files::{FileError, at};
use results::weights;
use scenarios::{SceneSet, SetError};
use thiserror::Error;
use wire::proto::service::refusal::Code;
use wire::proto::service::{DriverOffer, Offer as Message, Refusal, SceneSetOffer, Settings};

use super::record::Wish;
use crate::cli::{Cli, Command, RunArgs, ServeArgs};
use crate::request::Request;

/// The built-in scenes, which every service has.
const DEMO: &str = "demo";

/// Names of scenes that are listed of one set.
const LISTED: usize = 1000;

/// Characters of all settings together.
const LONGEST: usize = 16_384;

/// What cannot be offered.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum OfferError {
    #[error("{name}: {source}\nhint: {hint}", hint = .source.hint())]
    Set { name: String, source: Box<SetError> },
    #[error(transparent)]
    File(#[from] FileError),
    #[error("{0:?} cannot be a name: take letters, digits, dot, dash and underline\nhint: NAME=PATH gives it another")]
    Name(String),
    #[error("two are called {0}\nhint: NAME=PATH gives one another name")]
    Twice(String),
}

/// A scene set.
#[derive(Debug)]
struct Offered {
    path: String,
    scenes: Vec<String>,
}

/// What clients may have.
#[derive(Debug)]
pub struct Offer {
    sets: BTreeMap<String, Offered>,
    weights: BTreeMap<String, String>,
    commands: bool,
}

impl Offer {
    /// What these arguments offer. Every set is opened, so that one that cannot be is found now.
    ///
    /// # Errors
    /// [`OfferError`].
    pub fn new(arguments: &ServeArgs) -> Result<Self, OfferError> {
        let mut sets = BTreeMap::new();
        let demo = [(DEMO.to_owned(), DEMO.to_owned())];
        let given = arguments.sets.iter().map(|text| set_files(text)).collect::<Result<Vec<_>, _>>()?;
        for (name, path) in demo.into_iter().chain(given.into_iter().flatten()) {
            let set = SceneSet::open(std::slice::from_ref(&path));
            let set = set.map_err(|source| OfferError::Set { name: name.clone(), source: Box::new(source) })?;
            let scenes = set.entries().iter().map(|entry| entry.id.to_string()).collect();
            insert(&mut sets, name, Offered { path, scenes })?;
        }
        let mut weights = BTreeMap::new();
        for text in &arguments.weights {
            let (name, path) = named(text, |path| path.split('.').next().unwrap_or_default().to_owned())?;
            insert(&mut weights, name, path)?;
        }
        Ok(Self { sets, weights, commands: arguments.allow_commands })
    }

    /// What a client wishes by `settings`, if it can be meant and may be had.
    ///
    /// # Errors
    /// A refusal.
    pub fn wish(&self, settings: &Settings) -> Result<Wish, Refusal> {
        let refusal = |code: Code, text: String| Err(Refusal { code: code.into(), text });
        let commands = [
            ("planner-command", &settings.planner_command),
            ("predictor-command", &settings.predictor_command),
            ("traffic-command", &settings.traffic_command),
        ];
        if let Some((option, _)) = commands.iter().find(|(_, command)| !command.is_empty() && !self.commands) {
            return refusal(
                Code::NotAllowed,
                format!(
                    "this service starts no programs of its clients: {option} is not taken\nhint: take a driver of reloop, or start the service with --allow-commands"
                ),
            );
        }
        if settings.latency.trim_start().starts_with("trace:") {
            let text = "a trace of latencies is a file, and clients give no paths\nhint: fixed, measured and drawn latencies are taken";
            return refusal(Code::NotAllowed, text.to_owned());
        }
        let is_set = |on: bool, option: &str| on.then(|| format!("--{option}"));
        let texts = [
            ("driver", &settings.driver),
            ("predictor", &settings.predictor),
            ("features", &settings.features),
            ("label", &settings.label),
            ("protocol", &settings.protocol),
            ("motion", &settings.motion),
            ("latency", &settings.latency),
            ("record", &settings.record),
            ("deadline", &settings.deadline),
            ("start-timeout", &settings.start_timeout),
            ("planner-command", &settings.planner_command),
            ("predictor-command", &settings.predictor_command),
            ("traffic", &settings.traffic),
            ("traffic-command", &settings.traffic_command),
        ];
        // An empty command is none; and what is no driver's is said by what reads command lines.
        let texts = texts.into_iter().filter(|(_, value)| !value.is_empty());
        let arguments = texts.map(|(option, value)| format!("--{option}={value}"));
        let arguments = arguments.chain(settings.set.iter().map(|change| format!("--set={change}")));
        let arguments = arguments.chain(settings.traffic_seed.map(|seed| format!("--traffic-seed={seed}")));
        let arguments = arguments.chain(settings.traffic_set.iter().map(|change| format!("--traffic-set={change}")));
        let arguments: Vec<String> = arguments
            .chain(is_set(settings.in_process, "in-process"))
            .chain(is_set(settings.verify, "verify"))
            .collect();
        if arguments.iter().chain(&settings.scenes).map(String::len).sum::<usize>() > LONGEST {
            return refusal(Code::BadSettings, format!("the settings are longer than {LONGEST} characters"));
        }
        if arguments.iter().any(|argument| argument.contains('\0')) {
            return refusal(Code::BadSettings, "a setting holds a zero byte".to_owned());
        }
        let mut scenes = settings.scenes.clone();
        if scenes.is_empty() {
            scenes.push(DEMO.to_owned());
        }
        let parallel = u16::try_from(settings.parallel).ok().filter(|parallel| *parallel <= 256);
        let Some(parallel) = parallel else {
            return refusal(Code::BadSettings, "parallel is 0, for the run's share, to 256".to_owned());
        };
        let weights = (!settings.weights.is_empty()).then(|| settings.weights.clone());
        Ok(Wish { arguments, scenes, weights, parallel: (parallel > 0).then_some(parallel) })
    }

    /// The command line of `sim run` that does what is wished, as far as the client has a say in it.
    ///
    /// # Errors
    /// What is wished and is not offered, as a sentence.
    pub fn command_line(&self, wish: &Wish) -> Result<Vec<String>, String> {
        let mut line = wish.arguments.clone();
        for name in &wish.scenes {
            let set = self.sets.get(name).ok_or_else(|| format!("no scene set {}", known(name, self.sets.keys())))?;
            line.push(format!("--scenarios={}", set.path));
        }
        if let Some(name) = &wish.weights {
            let path =
                self.weights.get(name).ok_or_else(|| format!("no weights {}", known(name, self.weights.keys())))?;
            line.push(format!("--weights={path}"));
        }
        Ok(line)
    }

    /// What `sim run` makes of that line.
    ///
    /// # Errors
    /// A refusal that says what it says.
    pub fn request(&self, wish: &Wish, cores: u16) -> Result<Request, Refusal> {
        let bad = |text: String| Refusal { code: Code::BadSettings.into(), text };
        let line = self.command_line(wish).map_err(bad)?;
        Request::resolve(typed(&line).map_err(bad)?, cores).map_err(|error| bad(error.to_string()))
    }

    /// As clients are told it, without what changes.
    #[must_use]
    pub fn message(&self) -> Message {
        let driver = |driver: &results::drivers::Driver| DriverOffer {
            name: driver.name.to_owned(),
            about: driver.about.to_owned(),
            ready: driver.weights.is_none_or(|file| file == weights::BUILT_IN),
        };
        let set = |(name, set): (&String, &Offered)| SceneSetOffer {
            name: name.clone(),
            scenes: set.scenes.len() as u32,
            ids: set.scenes.iter().take(LISTED).cloned().collect(),
        };
        Message {
            version: results::version::VERSION.to_owned(),
            git_revision: results::version::GIT_REVISION.to_owned(),
            wire_version: wire::WIRE_VERSION,
            drivers: DRIVERS.iter().map(driver).collect(),
            scene_sets: self.sets.iter().map(set).collect(),
            weights: self.weights.keys().cloned().collect(),
            commands: self.commands,
            ..Message::default()
        }
    }
}

/// `sim run` with these options.
fn typed(line: &[String]) -> Result<RunArgs, String> {
    let words = ["sim", "run"].into_iter().chain(line.iter().map(String::as_str));
    match Cli::try_parse_from(words).map(|cli| cli.command) {
        Ok(Command::Run(arguments)) => Ok(*arguments),
        Ok(_) => Err("that is no run".to_owned()),
        Err(error) => {
            let text = error.to_string();
            let text = text.split("\n\nUsage:").next().unwrap_or_default().split("\n\nFor more information").next();
            Err(text.unwrap_or_default().trim_start_matches("error: ").trim_end().to_owned())
        }
    }
}

/// Says that there is nothing called `name`, and what there is.
fn known<'a>(name: &str, names: impl Iterator<Item = &'a String>) -> String {
    let names: Vec<&str> = names.map(String::as_str).collect();
    let offered = if names.is_empty() { "nothing".to_owned() } else { names.join(", ") };
    format!("{name:?} is offered\nhint: this service offers {offered}; paths are not taken")
}

fn insert<T>(map: &mut BTreeMap<String, T>, name: String, value: T) -> Result<(), OfferError> {
    if map.contains_key(&name) {
        return Err(OfferError::Twice(name));
    }
    map.insert(name, value);
    Ok(())
}

/// `NAME=PATH`, or a path and the name that its file's gives it. The path is made absolute: the service may be started again elsewhere.
fn named(text: &str, usual: impl Fn(&str) -> String) -> Result<(String, String), OfferError> {
    let (name, path) = match text.split_once('=') {
        Some((name, path)) if !Path::new(text).exists() => (name.to_owned(), path),
        _ => {
            let file = Path::new(text).file_name().map(|name| name.to_string_lossy().into_owned());
            (usual(&file.unwrap_or_default()), text)
        }
    };
    if !is_name(&name) {
        return Err(OfferError::Name(name));
    }
    let path = Path::new(path);
    let absolute = path.canonicalize().map_err(at("read", path))?;
    Ok((name, absolute.to_string_lossy().into_owned()))
}

/// The sets that `--sets` names by this text: one, or those of a folder of scene-set files.
fn set_files(text: &str) -> Result<Vec<(String, String)>, OfferError> {
    let folder = Path::new(text);
    let mut files = Vec::new();
    if folder.is_dir() {
        for entry in fs::read_dir(folder).map_err(at("list", folder))? {
            let path = entry.map_err(at("list", folder))?.path();
            // Beside shards, this tells how they were made.
            let is_generated = path.file_name().is_some_and(|name| name == "generated.toml");
            if path.extension().is_some_and(|extension| extension == "toml") && !is_generated {
                files.push(path.to_string_lossy().into_owned());
            }
        }
    }
    files.sort();
    if files.is_empty() {
        files.push(text.to_owned());
    }
    files.iter().map(|file| named(file, |name| name.strip_suffix(".toml").unwrap_or(name).to_owned())).collect()
}

/// Whether a text can be the name of a run, a client or an offer: one that is a file's name anywhere, and no path.
#[must_use]
pub fn is_name(text: &str) -> bool {
    let allowed = |c: char| c.is_ascii_alphanumeric() || matches!(c, '_' | '.' | '-');
    (1..=100).contains(&text.len()) && text.chars().all(allowed) && !text.starts_with(['.', '-'])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn offer(sets: &[&str], commands: bool) -> Offer {
        let words = ["sim", "serve"].into_iter().chain((!sets.is_empty()).then_some("--sets"));
        let cli = Cli::parse_from(words.chain(sets.iter().copied()));
        let Command::Serve(mut arguments) = cli.command else { panic!("not a service") };
        arguments.allow_commands = commands;
        Offer::new(&arguments).unwrap()
    }

    fn refusal(offer: &Offer, settings: &Settings) -> (Code, String) {
        let refused = offer.wish(settings).and_then(|wish| offer.request(&wish, 2)).unwrap_err();
        (refused.code(), refused.text)
    }

    fn driven_by(driver: &str) -> Settings {
        Settings { driver: driver.to_owned(), ..Settings::default() }
    }

    #[test]
    fn settings_become_the_command_line_of_sim_run() {
        let settings = Settings {
            set: vec!["horizon=20".to_owned()],
            in_process: true,
            record: "none".to_owned(),
            latency: "80ms".to_owned(),
            parallel: 3,
            ..driven_by("idm")
        };
        let offer = offer(&[], false);
        let wish = offer.wish(&settings).unwrap();
        let line = offer.command_line(&wish).unwrap();
        assert_eq!(
            line,
            ["--driver=idm", "--latency=80ms", "--record=none", "--set=horizon=20", "--in-process", "--scenarios=demo"]
        );
        assert_eq!(wish.parallel, Some(3));
        let request = offer.request(&wish, 2).unwrap();
        assert_eq!((request.settings.driver.as_str(), request.machine.in_process), ("idm", true));
    }

    #[test]
    fn agents_that_react_become_options_of_sim_run() {
        let settings = Settings {
            traffic: "mixed".to_owned(),
            traffic_seed: Some(7),
            traffic_set: vec!["radius=80".to_owned(), "pedestrians=stop".to_owned()],
            ..driven_by("idm")
        };
        let offer = offer(&[], false);
        let wish = offer.wish(&settings).unwrap();
        let options = ["--traffic-seed=7", "--traffic-set=radius=80", "--traffic-set=pedestrians=stop"];
        assert_eq!(wish.arguments, [&["--driver=idm", "--traffic=mixed"][..], &options].concat());
        let traffic = offer.request(&wish, 2).unwrap().settings.traffic.unwrap();
        assert_eq!(
            (traffic.node.name.as_str(), &traffic.node.options[..]),
            ("mixed", &["--seed", "7"].map(str::to_owned)[..])
        );
        assert_eq!(traffic.hand_over.radius, 80.0);
    }

    #[test]
    fn what_is_not_offered_is_refused_with_what_to_do() {
        let offer = offer(&[], false);
        let scenes = |name: &str| Settings { scenes: vec![name.to_owned()], ..driven_by("idm") };
        let (code, text) = refusal(&offer, &scenes("/etc/passwd"));
        assert_eq!((code, text.lines().next()), (Code::BadSettings, Some("no scene set \"/etc/passwd\" is offered")));
        assert!(text.contains("offers demo"), "{text}");
        let weights = Settings { weights: "../w".to_owned(), ..Settings::default() };
        assert!(refusal(&offer, &weights).1.starts_with("no weights \"../w\" is offered"));
        let trace = Settings { latency: "trace:/etc/passwd".to_owned(), ..driven_by("idm") };
        assert_eq!(refusal(&offer, &trace).0, Code::NotAllowed);
        let command = Settings { planner_command: "rm -rf /".to_owned(), ..Settings::default() };
        assert_eq!(refusal(&offer, &command).0, Code::NotAllowed);
        let command = Settings { traffic_command: "rm -rf /".to_owned(), ..driven_by("idm") };
        let (code, text) = refusal(&offer, &command);
        assert!(code == Code::NotAllowed && text.contains("traffic-command is not taken"), "{text}");
        let traffic = |name: &str| Settings { traffic: name.to_owned(), ..driven_by("idm") };
        assert!(refusal(&offer, &traffic("nobody")).1.starts_with("invalid value 'nobody' for '--traffic <NAME>'"));
        let replayed = Settings { traffic_seed: Some(4), ..traffic("none") };
        assert!(refusal(&offer, &replayed).1.contains("all are replayed"));
        let nowhere = Settings { traffic_set: vec!["radius=-1".to_owned()], ..traffic("idm") };
        assert!(refusal(&offer, &nowhere).1.contains("radius"));
        assert!(refusal(&offer, &driven_by("nobody")).1.starts_with("invalid value 'nobody' for '--driver <NAME>'"));
        assert!(refusal(&offer, &driven_by("sep")).1.contains("needs weights"));
        // Nothing that is said becomes another option.
        for sly in ["idm --out=/tmp/x", "--out", "idm\0"] {
            assert_eq!(refusal(&offer, &driven_by(sly)).0, Code::BadSettings, "{sly}");
        }
        assert_eq!(refusal(&offer, &Settings { parallel: 257, ..driven_by("idm") }).0, Code::BadSettings);
        assert_eq!(
            refusal(&offer, &Settings { set: vec!["x".repeat(20_000)], ..driven_by("idm") }).0,
            Code::BadSettings
        );
    }

    #[test]
    fn commands_are_taken_where_the_service_says_so() {
        let settings = Settings { planner_command: "python mine.py".to_owned(), ..Settings::default() };
        let offer = offer(&[], true);
        let request = offer.request(&offer.wish(&settings).unwrap(), 2).unwrap();
        assert_eq!(request.settings.driver, "command");
        let settings = Settings { traffic_command: "python mine.py".to_owned(), ..driven_by("idm") };
        let traffic = offer.request(&offer.wish(&settings).unwrap(), 2).unwrap().settings.traffic.unwrap();
        assert_eq!(traffic.node.command.as_deref(), Some("python mine.py"));
    }

    #[test]
    fn sets_are_called_as_their_files_or_as_somebody_says() {
        let folder = tempfile::tempdir().unwrap();
        let set = "[[generate]]\nfamily = \"curve\"\nseed = 3\n";
        let nightly = folder.path().join("nightly.toml");
        fs::write(&nightly, set).unwrap();
        fs::write(folder.path().join("curves.toml"), set).unwrap();
        let names = |offer: &Offer| offer.sets.keys().cloned().collect::<Vec<_>>();
        assert_eq!(names(&offer(&[folder.path().to_str().unwrap()], false)), ["curves", "demo", "nightly"]);
        let other = format!("other={}", nightly.display());
        assert_eq!(names(&offer(&[&other], false)), ["demo", "other"]);
    }

    #[test]
    fn names_are_no_paths() {
        assert!(is_name("dipp-strict-1") && is_name("a"));
        for bad in ["", ".", "..", ".service", "a/b", "a b", "-x", "ä", &"x".repeat(101)] {
            assert!(!is_name(bad), "{bad}");
        }
    }
}
