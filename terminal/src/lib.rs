//! How every program of the workspace meets the terminal: one way to say its version and its errors, to give completions and man pages,
//! and to decide on colours.

use std::error::Error;
use std::io::{self, IsTerminal, Write};
use std::process;

use clap::{Arg, ArgMatches, Command, CommandFactory, FromArgMatches};
use clap_complete::Shell;

/// The version and the git revision that is run: `0.1.0 (a1b2c3d4e5f6)`, `-dirty` where files were changed. A debug build
/// says that it is one.
pub const REVISION: &str = concat!(env!("CARGO_PKG_VERSION"), " (", env!("RELOOP_REVISION"), ")");

/// Whether to write colours to `stream`: on a terminal, unless `NO_COLOR` is set to anything (<https://no-color.org>).
#[must_use]
pub fn colours(stream: &impl IsTerminal) -> bool {
    stream.is_terminal() && std::env::var_os("NO_COLOR").is_none_or(|said| said.is_empty())
}

/// An error and its causes, one after the other. A cause that the words before it tell already is left out: many errors say theirs.
#[must_use]
pub fn whole(error: &(dyn Error + 'static)) -> String {
    let mut told = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        let words = error.to_string();
        if !told.contains(&words) {
            told = format!("{told}: {words}");
        }
        cause = error.source();
    }
    told
}

/// Writes to standard output. Whoever closed it has read enough (`| head`): no error.
///
/// # Errors
/// Any other that writing makes.
pub fn say(text: &str) -> io::Result<()> {
    write(text.as_bytes())
}

fn write(bytes: &[u8]) -> io::Result<()> {
    let mut out = io::stdout().lock();
    match out.write_all(bytes).and_then(|()| out.flush()) {
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        written => written,
    }
}

/// The command line of this program, or the end of it: a wrong one, `--help`, `--version`, `completions SHELL` and `man` are
/// answered here, alike for all programs.
#[must_use]
pub fn parse<Cli: CommandFactory + FromArgMatches>(version: &'static str) -> Cli {
    let mut command = with_pages(Cli::command().version(version));
    let matches = command.get_matches_mut();
    if let Some(page) = page(&mut command, &matches) {
        process::exit(if write(&page).is_err() { 2 } else { 0 });
    }
    Cli::from_arg_matches(&matches).unwrap_or_else(|error| error.format(&mut command).exit())
}

/// `command` with the subcommands `completions` and `man`; the help keeps to what is worked with.
fn with_pages(command: Command) -> Command {
    let shell = Arg::new("shell").required(true).value_parser(clap::value_parser!(Shell)).help("For which shell");
    // A program without subcommands has needs that these do not share.
    let alone = command.get_subcommands().next().is_none();
    let command = if alone {
        command.subcommand_negates_reqs(true).args_conflicts_with_subcommands(true).disable_help_subcommand(true)
    } else {
        command
    };
    let completions =
        Command::new("completions").about("Print a shell's completions of this program").hide(true).arg(shell);
    let man = Command::new("man").about("Print the manual page of this program, for man -l -").hide(true);
    command.subcommand(completions).subcommand(man)
}

/// What `completions` or `man` print; none where something else was asked for.
fn page(command: &mut Command, matches: &ArgMatches) -> Option<Vec<u8>> {
    let mut page = Vec::new();
    match matches.subcommand()? {
        ("completions", arguments) => {
            let name = command.get_name().to_owned();
            clap_complete::generate(*arguments.get_one::<Shell>("shell")?, command, name, &mut page);
        }
        ("man", _) => {
            // Writing into memory does not fail.
            let _ = manual(command, &mut page);
        }
        _ => return None,
    }
    Some(page)
}

/// The page of a program, and those of its subcommands behind it.
fn manual(command: &mut Command, out: &mut Vec<u8>) -> io::Result<()> {
    command.build();
    clap_mangen::Man::new(command.clone()).render(out)?;
    for subcommand in
        command.get_subcommands().filter(|subcommand| !subcommand.is_hide_set() && subcommand.get_name() != "help")
    {
        let man = clap_mangen::Man::new(subcommand.clone().display_name(subcommand.get_bin_name().unwrap_or_default()));
        let section = format!(".SH \"{}\"\n", subcommand.get_bin_name().unwrap_or_default().to_uppercase());
        out.extend_from_slice(section.as_bytes());
        man.render_description_section(out)?;
        man.render_synopsis_section(out)?;
        man.render_options_section(out)?;
    }
    Ok(())
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use clap::Parser;

    use super::*;

    #[test]
    fn a_cause_that_is_told_already_is_told_once() {
        #[derive(Debug)]
        struct Told(&'static str, Option<Box<Told>>);
        impl std::fmt::Display for Told {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str(self.0)
            }
        }
        impl Error for Told {
            fn source(&self) -> Option<&(dyn Error + 'static)> {
                self.1.as_deref().map(|cause| cause as _)
            }
        }
        let caused = |words, cause| Told(words, Some(Box::new(Told(cause, Some(Box::new(Told("not there", None)))))));
        assert_eq!(whole(&caused("cannot read a.toml", "no file")), "cannot read a.toml: no file: not there");
        assert_eq!(whole(&caused("cannot read: not there", "cannot read")), "cannot read: not there");
    }

    /// Serves something
    #[derive(Debug, Parser)]
    #[command(name = "server")]
    struct Cli {
        /// What to serve
        #[arg(long)]
        what: String,
    }

    fn pages(arguments: &[&str]) -> Option<String> {
        let mut command = with_pages(Cli::command().version("0.1.0 (abc)"));
        let matches = command.try_get_matches_from_mut(std::iter::once(&"server").chain(arguments)).unwrap();
        page(&mut command, &matches).map(|page| String::from_utf8(page).unwrap())
    }

    #[test]
    fn every_shell_gets_completions_and_man_a_page_without_what_serving_needs() {
        for shell in ["bash", "zsh", "fish"] {
            let completions = pages(&["completions", shell]).unwrap();
            assert!(completions.contains("server") && completions.contains("what"), "{completions}");
        }
        let man = pages(&["man"]).unwrap();
        assert!(man.contains(".TH server") && man.contains("What to serve") && man.contains("v0.1.0 (abc)"), "{man}");
        assert_eq!(pages(&["--what", "tea"]), None);
    }

    #[test]
    fn the_commands_are_well_formed() {
        with_pages(Cli::command()).debug_assert();
    }
}
