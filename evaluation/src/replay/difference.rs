//! Where two messages part.

use std::fmt;

use prost::Message;

/// The first difference between what was said and what is said now.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Difference {
    /// The step, from 0; none for what is said once an episode.
    pub step: Option<u32>,
    /// Which message.
    pub message: &'static str,
    /// The field, as a path; empty where one side says nothing at all.
    pub field: String,
    /// What was said.
    pub recorded: String,
    /// What is said now.
    pub now: String,
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { step, message, field, recorded, now } = self;
        if let Some(step) = step {
            write!(f, "step {step}, ")?;
        }
        let dot = if field.is_empty() { "" } else { "." };
        write!(f, "{message}{dot}{field}: {recorded} in the recording, {now} now")
    }
}

/// Nothing where both say the same bytes; what one side alone says is a difference too.
pub(super) fn at<M: Message + fmt::Debug>(
    step: Option<u32>,
    message: &'static str,
    recorded: Option<&M>,
    now: Option<&M>,
) -> Result<(), Difference> {
    let bytes = |said: Option<&M>| said.map(Message::encode_to_vec);
    if bytes(recorded) == bytes(now) {
        return Ok(());
    }
    let lines = |said: Option<&M>| said.map_or_else(|| "nothing".to_owned(), |said| format!("{said:#?}"));
    let (recorded, now) = (lines(recorded), lines(now));
    let (field, recorded, now) = part(&recorded, &now);
    Err(Difference { step, message, field, recorded, now })
}

/// Where two values as `{:#?}` prints them part: a line a value, indented by what it is in.
fn part(recorded: &str, now: &str) -> (String, String, String) {
    let (mut a, mut b) = (recorded.lines(), now.lines());
    let mut path: Vec<Level> = Vec::new();
    loop {
        let (one, other) = (a.next(), b.next());
        let Some(line) = one.or(other) else {
            return (String::new(), "other bytes".to_owned(), "other bytes".to_owned());
        };
        let depth = (line.len() - line.trim_start().len()) / 4;
        path.resize_with(depth + 1, Level::default);
        let line = line.trim();
        if !line.starts_with(['}', ']', ')']) {
            let named = line.split_once(": ").map(|(name, _)| name.to_owned());
            let before = path[depth].number.map_or(0, |number| number + 1);
            let number = named.is_none().then_some(before);
            path[depth] = Level { name: named.unwrap_or_default(), number, is_list: line.ends_with('[') };
        }
        if one != other {
            let said = |line: Option<&str>| {
                let line = line.unwrap_or("nothing").trim().trim_end_matches(',');
                line.split_once(": ").map_or(line, |(_, value)| value).to_owned()
            };
            return (named_path(&path), said(one), said(other));
        }
    }
}

/// What is under way at a depth.
#[derive(Default)]
struct Level {
    name: String,
    /// Of those without a name.
    number: Option<usize>,
    is_list: bool,
}

/// `agents[3].state.x`: what a list holds is numbered, the names of types are left out.
fn named_path(path: &[Level]) -> String {
    let mut text = String::new();
    for pair in path.windows(2) {
        let [outer, level] = pair else { continue };
        match level.number {
            Some(number) if outer.is_list => text.push_str(&format!("[{number}]")),
            Some(_) => {}
            None if text.is_empty() => text.push_str(&level.name),
            None => text.push_str(&format!(".{}", level.name)),
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use wire::proto;

    use super::*;

    #[test]
    fn the_first_field_that_differs_is_named() {
        let agent = |x: f64| proto::Agent {
            track: 7,
            state: Some(proto::AgentState { x, ..Default::default() }),
            ..Default::default()
        };
        let observation =
            |x: f64| proto::Observation { step: 3, agents: vec![agent(0.0), agent(x)], ..Default::default() };
        assert_eq!(at(Some(3), "observation", Some(&observation(1.0)), Some(&observation(1.0))), Ok(()));
        let found = at(Some(3), "observation", Some(&observation(1.0)), Some(&observation(1.5))).unwrap_err();
        assert_eq!(found.to_string(), "step 3, observation.agents[1].state.x: 1.0 in the recording, 1.5 now");
        let lost = at(None, "event", Some(&proto::Event::default()), None).unwrap_err();
        assert_eq!((lost.now.as_str(), lost.field.as_str()), ("nothing", ""));
    }
}
