//! What a process says: line by line to the terminal, under its name, and to a log in the run's folder. Lines are cut where
//! they do not end, and nothing in them can command the terminal.

use std::fs::{self, File, OpenOptions};
use std::io::{ErrorKind, Read, Write};
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

use super::console::Console;
use super::raised::Raised;

/// Bytes after which a line is broken: a program may write for ever without ending one.
const LONGEST_LINE: usize = 4096;

/// Bytes that one process may leave in its log; the terminal goes on.
const LONGEST_LOG: usize = 64 << 20;

/// Characters of a reason that tables and files show.
const LONGEST_REASON: usize = 1000;

/// Where the lines of one process go.
#[derive(Clone, Debug)]
pub struct Voice {
    /// The process.
    name: String,
    console: Console,
    /// Shared, because standard output and standard error are read by a thread each.
    log: Arc<Mutex<Log>>,
    raised: Arc<Mutex<Raised>>,
}

/// A log; its file is made with its first line, so that silent processes leave none.
#[derive(Debug)]
struct Log {
    path: PathBuf,
    file: Option<File>,
    room: usize,
}

impl Voice {
    /// The voice of the process `name`, with a log at `path`.
    #[must_use]
    pub fn new(name: &str, console: &Console, path: PathBuf) -> Self {
        let log = Log { path, file: None, room: LONGEST_LOG };
        Self { name: name.to_owned(), console: console.clone(), log: Arc::new(Mutex::new(log)), raised: Arc::default() }
    }

    /// A voice that no log keeps.
    #[must_use]
    pub fn unlogged(name: &str, console: &Console) -> Self {
        let log = Log { path: PathBuf::new(), file: None, room: 0 };
        Self { name: name.to_owned(), console: console.clone(), log: Arc::new(Mutex::new(log)), raised: Arc::default() }
    }

    /// Passes on what is read from `from`, to its end.
    pub fn read(&self, from: impl Read) {
        each_line(from, |line| {
            let text = escaped(&String::from_utf8_lossy(line));
            self.raised.lock().unwrap_or_else(PoisonError::into_inner).hear(&text);
            let line = format!("{}: {text}", self.name);
            self.console.line(&line);
            self.note(&line);
        });
    }

    /// What the process raised last, if it said so.
    #[must_use]
    pub fn raised(&self) -> Option<String> {
        self.raised.lock().unwrap_or_else(PoisonError::into_inner).last().map(str::to_owned)
    }

    /// Writes a line to the log alone.
    pub fn note(&self, line: &str) {
        self.log.lock().unwrap_or_else(PoisonError::into_inner).write(line);
    }
}

impl Log {
    /// A log that cannot be written is no reason to end a run.
    fn write(&mut self, line: &str) {
        let line = if line.len() < self.room { format!("{line}\n") } else { "... the log ends here\n".to_owned() };
        if self.room == 0 {
            return;
        }
        self.room = if line.len() < self.room { self.room - line.len() } else { 0 };
        if self.file.is_none() {
            let _ = self.path.parent().map_or(Ok(()), fs::create_dir_all);
            self.file = OpenOptions::new().create(true).append(true).open(&self.path).ok();
        }
        if let Some(file) = &mut self.file {
            let _ = file.write_all(line.as_bytes());
        }
    }
}

/// Calls `say` for each line. A carriage return ends one too: that is how progress bars draw over themselves.
fn each_line(mut from: impl Read, mut say: impl FnMut(&[u8])) {
    let mut line = Vec::new();
    let mut chunk = [0; 4096];
    let mut returned = false;
    loop {
        let read = match from.read(&mut chunk) {
            Ok(0) => break,
            Ok(read) => read,
            Err(error) if error.kind() == ErrorKind::Interrupted => continue,
            Err(_) => break,
        };
        for byte in &chunk[..read] {
            match byte {
                // The second half of an end of line.
                b'\n' if returned => {}
                b'\n' | b'\r' => say(&std::mem::take(&mut line)),
                byte => line.push(*byte),
            }
            returned = *byte == b'\r';
            if line.len() == LONGEST_LINE {
                say(&std::mem::take(&mut line));
            }
        }
    }
    if !line.is_empty() {
        say(&line);
    }
}

/// With everything that a terminal would obey, or that turns the direction of writing, written out; tabs stay.
#[must_use]
pub fn escaped(text: &str) -> String {
    let commands = |c: char| c.is_control() && c != '\t';
    let turns = |c: char| matches!(c, '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        if commands(c) || turns(c) { out.extend(c.escape_default()) } else { out.push(c) }
    }
    out
}

/// Why a driver failed, as tables and files show it: a node's words, escaped, and no more of them than people read.
#[must_use]
pub fn reason(text: &str) -> String {
    match text.char_indices().nth(LONGEST_REASON) {
        Some((end, _)) => escaped(&text[..end]) + " ...",
        None => escaped(text),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines(text: &[u8]) -> Vec<String> {
        let mut lines = Vec::new();
        each_line(text, |line| lines.push(String::from_utf8_lossy(line).into_owned()));
        lines
    }

    #[test]
    fn lines_end_at_newlines_and_returns_and_blank_ones_stay() {
        assert_eq!(lines(b"one\n\ntwo\r\nthree\r10 %\r20 %\nend"), ["one", "", "two", "three", "10 %", "20 %", "end"]);
        assert_eq!(lines(b""), Vec::<String>::new());
    }

    #[test]
    fn a_line_without_an_end_is_cut() {
        let cut = lines(&vec![b'x'; 3 * LONGEST_LINE + 7]);
        assert_eq!(cut.iter().map(String::len).collect::<Vec<_>>(), [LONGEST_LINE, LONGEST_LINE, LONGEST_LINE, 7]);
    }

    #[test]
    fn nothing_that_is_shown_commands_a_terminal() {
        assert_eq!(escaped("\u{1b}[2Jgone\u{7}\u{202e}\tä\u{9b}1m"), "\\u{1b}[2Jgone\\u{7}\\u{202e}\tä\\u{9b}1m");
        assert_eq!(reason("two\nlines"), "two\\nlines");
        assert_eq!(reason(&"é".repeat(2000)), "é".repeat(LONGEST_REASON) + " ...");
    }

    #[test]
    fn a_log_is_made_with_its_first_line_and_ends_when_it_is_full() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("logs/w0.log");
        let voice = Voice::new("planner w0", &Console::new(), path.clone());
        assert!(!path.exists());
        voice.read(&b"hello\n\x1b[31mred"[..]);
        assert_eq!(fs::read_to_string(&path).unwrap(), "planner w0: hello\nplanner w0: \\u{1b}[31mred\n");
        voice.log.lock().unwrap().room = 10;
        voice.note("more than there is room for");
        voice.note("x");
        assert!(fs::read_to_string(&path).unwrap().ends_with("red\n... the log ends here\n"));
    }
}
