//! The command line of `sim`: what it says, and with which exit code.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod compare;
mod report;

use std::path::Path;
use std::process::Command;

/// Runs `sim` in `folder`: exit code, standard output, standard error.
fn sim(folder: &Path, arguments: &[&str]) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_sim"))
        .args(arguments)
        .current_dir(folder)
        .env_remove("RUST_LOG")
        .env("COLUMNS", "100")
        .output()
        .unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).replace(&*folder.to_string_lossy(), "[folder]");
    let code = output.status.code().map_or("a signal".to_owned(), |code| code.to_string());
    format!("code {code}\n--- stdout\n{}--- stderr\n{}", text(&output.stdout), text(&output.stderr))
}

#[test]
fn help_says_what_can_be_typed() {
    let folder = tempfile::tempdir().unwrap();
    insta::assert_snapshot!(sim(folder.path(), &["--help"]), @"
    code 0
    --- stdout
    Drives an autonomous vehicle through logged traffic in closed loop, and tells how well it drove

    Usage: sim [OPTIONS] <COMMAND>

    Commands:
      run          Drive scenes and write a run folder
      matrix       Drive scenes with several drivers, and print one table
      evaluate     Ask drivers for plans at frames of the log and judge them, without driving
      merge        Make runs of what shards have driven
      plan         Say what a run would take in time, memory and room, from a sample of its episodes
      table        Print the tables of finished runs
      compare      Compare two finished runs: what flipped, what moved, what may be chance
      score        Score finished runs by other tools' definitions, without driving again
      predictions  Score the predictions of recorded drives against what the agents then did
      replay       Drive recorded episodes again: is all the same, and what if another takes over?
      blame        Drive failures again, each time with one thing changed: what would have saved them?
      validity     Say where replayed agents would have had to react to the AV, and what the figures are
                   without those steps
      report       Write runs as one page to send to somebody, with failed drives to be played
      render       Draw a drive from above: a picture of a step, or a clip
      check-node   Check a planner, a predictor or traffic of your own against the rules of the bus, and
                   say what to do
      serve        Drive what others ask for: runs in a fair queue, and sessions step by step
      submit       Have a service drive a run
      status       Say how far a run in a folder is, or how the runs of a service are, or what that
                   offers
      watch        Show how a run of a service goes, and its table at the end
      cancel       Stop runs of a service
      session      Drive one scene of a service step by step, and let another driver take over
      verify       Hold the protocol `paper` to vectors of the authors' simulator
      help         Print this message or the help of the given subcommand(s)

    Options:
      -v, --verbose...  Say more on standard error; twice for everything
      -h, --help        Print help
      -V, --version     Print version
    --- stderr
    ");
    insta::assert_snapshot!(sim(folder.path(), &["run", "-h"]), @"
    code 0
    --- stdout
    Drive scenes and write a run folder

    Usage: sim run [OPTIONS] [PATH]...

    Options:
      -v, --verbose...  Say more on standard error; twice for everything
      -h, --help        Print help (see more with '--help')

    What to drive:
          --scenarios <PATH>...          Scenes, as PATH is; takes all that follows up to the next
                                         option
          --driver <NAME>                Who drives [default: proposals] [possible values: idm, human,
                                         constant-velocity, gn-ctrv, gn-oracle, proposals, contingency,
                                         dipp, sep, il-pred, il, cql]
          --predictor <NAME>             Where predictions come from [default: what the driver wants]
                                         [possible values: none, ctrv, ctra, oracle, network]
          --predictor-command <COMMAND>  A predictor of your own: a shell command, as --planner-command
          --weights <FILE>               Weights of the prediction network, a .safetensors file
                                         [default: those of dipp, built in; sep, il-pred, il and cql
                                         have none]
          --features <STYLE>             How the network's features are made: authors, for weights of
                                         theirs, or mended [default: as the weights say, or else
                                         authors] [possible values: authors, mended]
          --planner-command <COMMAND>    A planner of your own: a shell command, told where to connect
                                         by RELOOP_* variables and by arguments
          --planner <WHICH>              A planner that you start yourself, with --worker '*' and the
                                         endpoint, run and secret that the sim prints [possible values:
                                         external]
          --traffic <NAME>               Agents that react under `strict`, instead of doing what they
                                         did in the log (docs/traffic.md) [default: none] [possible
                                         values: none, idm, waymax, cautious, assertive, distracted,
                                         mixed, network]
          --traffic-command <COMMAND>    Traffic of your own: a shell command, as --planner-command,
                                         that says where the agents are next that react
          --traffic-seed <N>             What is drawn about agents that react is drawn from this
                                         [default: 0]
          --traffic-set <KEY=VALUE>      Who is taken over from the log: radius=60 or left-log=1 (m), or
                                         pedestrians=replayed or stop
          --label <NAME>                 What tables call the driver [default: its name]
          --protocol <PROTOCOL>          The rules of an episode [default: strict] [possible values:
                                         strict, paper]
          --set <KEY=VALUE>              A setting of `strict`, as horizon=100 or ending-collision=any;
                                         docs/running.md lists them
          --motion <MOTION>              How the AV follows its plan under `strict` [default: bicycle;
                                         playback for the driver `human`, and for it alone] [possible
                                         values: bicycle, playback]
          --latency <HOW>                When plans take effect under `strict`: 80ms, measured,
                                         trace:FILE, dist:normal:80ms:20ms, ... (docs/latency.md)
                                         [default: at once]
      [PATH]...                          Scenes: files of WOMD, ScenarioNet or Argoverse 2, folders,
                                         globs, or scene-set TOML files [default: the built-in demo set]

    How to run:
          --out <DIR>                    The run's folder [default: runs/DRIVER-PROTOCOL-N]; an
                                         unfinished run in it is continued
          --shard <I/N>                  Drive a share of the scenes, the I-th of N, beside other
                                         processes in the same --out; `sim merge` then makes it a run
                                         (docs/shards.md). auto or auto/N: as HyperQueue, Slurm or
                                         Kubernetes says
          --retry <WHICH>                Drive episodes of this run again: those that failed, those
                                         whose recording is not whole, or failed,unrecorded [possible
                                         values: failed, unrecorded]
          --verify                       Read every scene before the first is driven, so that damaged
                                         ones are found then, and not when their turn comes
          --record <RECORD>              Which episodes to keep a recording of [default: all] [possible
                                         values: all, failures, none]
          --parallel <N>                 Episodes driven at a time; results do not depend on it
                                         [default: the cores]
          --in-process                   Drive in this process, without nodes and bus: the same results
                                         and recordings at less cost; for drivers of ours
          --pin                          Keep each worker with its nodes on a core of its own: faster,
                                         where nothing else wants the cores
          --deadline <TIME>              How long an answer may take: 5s, 500ms [default: 5s]
          --start-timeout <TIME>         How long nodes may take to start [default: 20s; 10m for a
                                         planner that you start yourself]
          --endpoint <WHERE>             Where to listen for nodes of others: tcp/HOST:PORT, or
                                         tls/HOST:PORT with --zenoh-config [default: nowhere but at a
                                         socket of your own]
          --view                         Show the run in the Rerun viewer while it is driven: in one
                                         that is open, else `rerun` is started. The run never waits for
                                         it
          --zenoh-config <FILE>          A Zenoh configuration (JSON5) with the sim's certificate, to
                                         listen to other hosts by TLS; docs/hosts.md has examples
          --planner-certificate <NAMES>  Whose certificate a planner that you start yourself must have,
                                         by its common name; several, with commas between [default: any]
          --timing                       Say on standard error where the time went
    --- stderr
    ");
    insta::assert_snapshot!(sim(folder.path(), &["evaluate", "-h"]), @"
    code 0
    --- stdout
    Ask drivers for plans at frames of the log and judge them, without driving

    Usage: sim evaluate [OPTIONS] [PATH]...

    Options:
          --open-loop   Plans are asked for once a second of the log, and never driven
      -v, --verbose...  Say more on standard error; twice for everything
          --traffic     Nobody is asked: are the agents believable that reacted in finished runs, each
                        PATH a run's folder?
      -h, --help        Print help (see more with '--help')

    What to ask:
          --scenarios <PATH>...        Scenes, as PATH is; takes all that follows up to the next option.
                                       With --traffic, where the runs' scenes are now
          --drivers <NAMES>            Who is asked, a line of the table each: drivers of `sim run`,
                                       each `[LABEL:]DRIVER[=WEIGHTS]`
          --planner-command <COMMAND>  A planner of your own, as for `sim run`, a line more
          --label <NAME>               What the table calls your own planner [default: command]
          --predictor <NAME>           Where predictions come from [default: what each driver wants]
                                       [possible values: none, ctrv, ctra, oracle, network]
          --features <STYLE>           How the network's features are made, as for `sim run` [possible
                                       values: authors, mended]
          --definitions <DEFINITIONS>  By whose definitions plans are judged, and under whose protocol
                                       drivers are asked [default: strict] [possible values: strict,
                                       authors]
      [PATH]...                        Scenes, as for `sim run` [default: the built-in demo set]

    What to tell:
          --format <FORMAT>  How to print the table [default: text] [possible values: text, markdown,
                             csv, json]
          --out <FILE|DIR>   Keep a row a frame: FILE.parquet, or a new folder, with the drivers'
                             settings beside it

    How to run:
          --parallel <N>          Scenes at a time; results do not depend on it [default: the cores]
          --in-process            Have drivers of ours in this process, without nodes and bus: the same
                                  figures at less cost
          --pin                   Keep each worker with its nodes on a core of its own
          --deadline <TIME>       How long an answer may take: 5s, 500ms [default: 5s]
          --start-timeout <TIME>  How long nodes may take to start [default: 20s]
    --- stderr
    ");
    insta::assert_snapshot!(sim(folder.path(), &["table", "-h"]), @"
    code 0
    --- stdout
    Print the tables of finished runs

    Usage: sim table [OPTIONS] <DIR>...

    Arguments:
      <DIR>...  Folders of finished runs

    Options:
          --format <FORMAT>  How to print [default: text] [possible values: text, markdown, csv]
      -v, --verbose...       Say more on standard error; twice for everything
          --scenes           A row a scene, the worst first: how it ended, and what happened with whom
          --worst <N>        Only so many of the scenes
          --plot <FILE>      Draw score against latency, a line a driver, of runs at several: an SVG
                             file
      -h, --help             Print help (see more with '--help')
    --- stderr
    ");
    insta::assert_snapshot!(sim(folder.path(), &["compare", "-h"]));
    insta::assert_snapshot!(sim(folder.path(), &["score", "-h"]));
    insta::assert_snapshot!("help_of_replay", sim(folder.path(), &["replay", "-h"]));
    insta::assert_snapshot!("help_of_blame", sim(folder.path(), &["blame", "-h"]));
    insta::assert_snapshot!(sim(folder.path(), &["report", "-h"]), @"
    code 0
    --- stdout
    Write runs as one page to send to somebody, with failed drives to be played

    Usage: sim report [OPTIONS] <RUN>...

    Arguments:
      <RUN>...  Folders of finished runs

    Options:
          --html <FILE>          The page [default: report.html]
      -v, --verbose...           Say more on standard error; twice for everything
          --players <N>          So many of the failed drives are in the page to be played, the worst
                                 first [default: 20]
          --episodes <ID>...     These are too, failed or not, of each run that drove them
          --scenarios <PATH>...  Where the scenes are [default: where the runs have them from]
          --seed <N>             What draws the resamples of the intervals [default: 0]
      -h, --help                 Print help (see more with '--help')
    --- stderr
    ");
    insta::assert_snapshot!(sim(folder.path(), &["render", "-h"]), @"
    code 0
    --- stdout
    Draw a drive from above: a picture of a step, or a clip

    Usage: sim render [OPTIONS] --episode <ID> <--png <STEP>|--gif|--mp4> <RUN>

    Arguments:
      <RUN>  Folder of a finished run

    Options:
          --episode <ID>         The scene whose drive is drawn; `sim table --scenes` lists them
      -v, --verbose...           Say more on standard error; twice for everything
          --png <STEP>           A picture after this step, as tables number them; `last` is where the
                                 drive ended, `start` before its first step
          --gif                  A clip of the whole drive that plays in any page
          --mp4                  A clip of the whole drive as video
          --out <FILE>           The file [default: ID-STEP.png, ID.gif or ID.mp4]
          --size <WxH>           Pixels [default: 960x540, of a GIF 640x360]
          --across <METRES>      Metres that are seen across [default: 100]
          --scenarios <PATH>...  Where the scenes are [default: where the run has them from]
          --timing               Say on standard error how many frames a second were drawn
      -h, --help                 Print help (see more with '--help')
    --- stderr
    ");
}

#[test]
fn what_makes_no_sense_is_refused_with_code_2_and_a_hint() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    insta::assert_snapshot!(sim(path, &["run", "--driver", "nobody"]), @"
    code 2
    --- stdout
    --- stderr
    error: invalid value 'nobody' for '--driver <NAME>'
      [possible values: idm, human, constant-velocity, gn-ctrv, gn-oracle, proposals, contingency, dipp, sep, il-pred, il, cql]

    For more information, try '--help'.
    ");
    insta::assert_snapshot!(sim(path, &["run", "--planner", "external", "--planner-command", "x"]), @"
    code 2
    --- stdout
    --- stderr
    error: the argument '--planner <WHICH>' cannot be used with '--planner-command <COMMAND>'

    Usage: sim run --planner <WHICH> [PATH]...

    For more information, try '--help'.
    ");
    insta::assert_snapshot!(sim(path, &["run", "--deadline", "5"]), @"
    code 2
    --- stdout
    --- stderr
    error: invalid value '5' for '--deadline <TIME>': write it with its unit: 500ms, 5s or 2m

    For more information, try '--help'.
    ");
    insta::assert_snapshot!(sim(path, &["run", "--label", "../evil"]), @r#"
    code 2
    --- stdout
    --- stderr
    error: the driver's label "../evil" is not 1 to 64 of A-Z a-z 0-9 _ . -
    "#);
    insta::assert_snapshot!(sim(path, &["run", "--protocol", "paper", "--motion", "bicycle"]), @"
    code 2
    --- stdout
    --- stderr
    error: --motion has no meaning under the protocol paper: the AV is put on the plan's first pose, and nothing else can be set
    hint: leave --motion out, or drive under --protocol strict
    ");
    insta::assert_snapshot!(sim(path, &["run", "--scenarios", "nowhere"]), @"
    code 2
    --- stdout
    --- stderr
    error: there is no nowhere
    hint: paths are relative to the folder that the command is called in; the word demo means the built-in scenes
    ");
    insta::assert_snapshot!(sim(path, &["evaluate", "--drivers", "idm"]), @"
    code 2
    --- stdout
    --- stderr
    error: the following required arguments were not provided:
      --open-loop

    Usage: sim evaluate --drivers <NAMES> --open-loop [PATH]...

    For more information, try '--help'.
    ");
    insta::assert_snapshot!(sim(path, &["evaluate", "--open-loop"]), @"
    code 2
    --- stdout
    --- stderr
    error: nobody is asked
    hint: --drivers dipp,idm or --planner-command COMMAND
    ");
    insta::assert_snapshot!(sim(path, &["evaluate", "--open-loop", "--drivers", "idm,idm"]), @"
    code 2
    --- stdout
    --- stderr
    error: two rows of the table would be called idm
    hint: LABEL:DRIVER gives one another name, and --label a planner of your own
    ");
    insta::assert_snapshot!(sim(path, &["evaluate", "--open-loop", "--drivers", "idm=x"]), @"
    code 2
    --- stdout
    --- stderr
    error: --weights and --features are for the predictor network, and the driver idm has another
    hint: --driver dipp, sep, il-pred or il, or --predictor network; --weights is for --driver cql too
    ");
    insta::assert_snapshot!(sim(path, &["score", "."]), @"
    code 2
    --- stdout
    --- stderr
    error: . holds no run: there is no run.toml in it
    ");
    insta::assert_snapshot!(sim(path, &["table", "."]), @"
    code 2
    --- stdout
    --- stderr
    error: . holds no run: there is no run.toml in it
    ");
    assert!(std::fs::read_dir(path).unwrap().next().is_none(), "a refused command leaves files");
}

#[test]
fn a_folder_with_other_things_in_it_is_left_alone() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("diary.txt"), "dear diary").unwrap();
    insta::assert_snapshot!(sim(folder.path(), &["run", "--out", "."]), @"
    code 2
    --- stdout
    --- stderr
    error: . is not empty and holds no run
    hint: give another folder with --out
    ");
    assert_eq!(std::fs::read_to_string(folder.path().join("diary.txt")).unwrap(), "dear diary");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}
