//! What a process raised: the exception of Python or the panic of Rust that its lines tell of. A node whose main thread ended so
//! may stay, because of other threads; without this it looks like one that is slow.

/// Follows the lines of a process.
#[derive(Debug, Default)]
pub struct Raised {
    inside: Option<Account>,
    last: Option<String>,
}

/// What is being told.
#[derive(Clone, Copy, Debug)]
enum Account {
    /// Frames, indented; then the exception.
    Traceback,
    /// The message follows.
    Panic,
}

impl Raised {
    /// Takes in a line, escaped.
    pub fn hear(&mut self, line: &str) {
        if line.starts_with("Traceback (most recent call last)") {
            self.inside = Some(Account::Traceback);
        } else if line.starts_with("thread '") && line.contains(" panicked at ") {
            self.inside = Some(Account::Panic);
        } else if let Some(account) = self.inside {
            match account {
                Account::Traceback if line.starts_with(' ') || line.is_empty() => {}
                Account::Traceback => self.tell(format!("raised {line}")),
                Account::Panic => self.tell(format!("panicked: {line}")),
            }
        }
    }

    fn tell(&mut self, what: String) {
        (self.inside, self.last) = (None, Some(what));
    }

    /// The last of it, as words that follow a subject.
    #[must_use]
    pub fn last(&self) -> Option<&str> {
        self.last.as_deref()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn last(lines: &str) -> Option<String> {
        let mut raised = Raised::default();
        lines.lines().for_each(|line| raised.hear(line));
        raised.last().map(str::to_owned)
    }

    #[test]
    fn an_exception_is_told_by_the_line_behind_its_frames() {
        let text = "planning\nTraceback (most recent call last):\n  File \"planner.py\", line 3, in <module>\n    boom()\n\nValueError: no lane\nbye";
        assert_eq!(last(text).as_deref(), Some("raised ValueError: no lane"));
        // Of one exception while another was handled the second counts.
        let second = format!("{text}\nTraceback (most recent call last):\n  File \"x\"\nKeyError: 7");
        assert_eq!(last(&second).as_deref(), Some("raised KeyError: 7"));
    }

    #[test]
    fn a_panic_is_told_by_its_message() {
        let text = "thread 'main' (12) panicked at src/main.rs:3:5:\nindex out of bounds\nnote: run with";
        assert_eq!(last(text).as_deref(), Some("panicked: index out of bounds"));
    }

    #[test]
    fn other_lines_tell_nothing() {
        assert_eq!(last("ValueError: quoted\nthread 'main' started\nTraceback (most recent call last):\n  File"), None);
    }
}
