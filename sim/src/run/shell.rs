//! A planner's command: whatever a shell understands.

/// The line for `sh -c`. The arguments of a node are its `"$@"`: where the command says so, else at the end of its last program,
/// which is no place in a pipeline, before a `;` or `&`, or behind several lines: such a command is left as it is, and the node
/// reads its environment.
#[must_use]
pub fn line(command: &str) -> String {
    if ends_in_a_program(command) { format!("{command} \"$@\"") } else { command.to_owned() }
}

/// Whether words that are put behind `command` are arguments of what it starts, and not said there already.
fn ends_in_a_program(command: &str) -> bool {
    if command.contains("$@") || command.contains("$*") {
        return false;
    }
    let mut quote = None;
    let mut before = ' ';
    let mut characters = command.trim().chars().peekable();
    while let Some(c) = characters.next() {
        match (quote, c) {
            (None | Some('"'), '\\') => drop(characters.next()),
            (Some(open), c) if c == open => quote = None,
            (Some(_), _) => {}
            (None, '\'' | '"') => quote = Some(c),
            // `a && b` starts b last; `2>&1` is a redirection.
            (None, '&') if characters.peek() == Some(&'&') => drop(characters.next()),
            (None, '&') if matches!(before, '>' | '<') => {}
            (None, '|' | ';' | '&' | '\n' | '(' | ')' | '`') => return false,
            (None, '#' | '{' | '}') if before.is_whitespace() => return false,
            (None, _) => {}
        }
        before = c;
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arguments_go_behind_the_last_program() {
        for command in [
            "python planner.py --fast",
            "cd planners && python planner.py",
            ". venv/bin/activate && SPEED=3 python planner.py",
            "python planner.py 2>&1",
            "python 'my | planner; &.py'",
            r"python a\;b.py",
            "python \"a (1).py\" > out.txt",
            "python ${HOME}/planner#2.py",
        ] {
            assert_eq!(line(command), format!("{command} \"$@\""));
        }
    }

    #[test]
    fn a_command_that_does_not_end_in_the_planner_is_left_alone() {
        for command in [
            "python planner.py | tee out.txt",
            "python planner.py \"$@\" | tee out.txt",
            "python planner.py || echo failed",
            "python planner.py; echo done",
            "python planner.py & wait",
            "(cd planners; python planner.py)",
            "{ python planner.py }",
            "python planner.py # mine",
            "cd planners\npython planner.py",
        ] {
            assert_eq!(line(command), command);
        }
    }
}
