//! What is asked of a node, and how it was found.

use wire::keys::Role;

/// What is asked of a node, in the order in which it is told.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, clap::ValueEnum)]
pub enum Rule {
    /// It is on the bus in time.
    Joins,
    /// Each observation has one whole answer.
    Answers,
    /// In time.
    InTime,
    /// In the frame of the log.
    InPlace,
    /// Agents move as bodies can.
    Moves,
    /// Nobody jumps when he is taken over.
    HandOver,
    /// The same again, in one process and in another.
    Repeats,
    /// What was driven before makes no difference.
    Forgets,
    /// Observations that are rare, and allowed.
    OddScenes,
    /// An episode that ends before its horizon.
    CutShort,
    /// Messages that cannot be read.
    Noise,
    /// A scene of another version.
    Version,
    /// Several workers at once.
    AllWorkers,
    /// A seat that was another's before.
    Late,
    /// A seat that is another's.
    Second,
    /// A run that does not know it.
    Unknown,
    /// It leaves when it is to.
    Leaves,
    /// The answers of before.
    Golden,
}

impl Rule {
    /// All of them.
    pub const ALL: [Self; 18] = [
        Self::Joins,
        Self::Answers,
        Self::InTime,
        Self::InPlace,
        Self::Moves,
        Self::HandOver,
        Self::Repeats,
        Self::Forgets,
        Self::OddScenes,
        Self::CutShort,
        Self::Noise,
        Self::Version,
        Self::AllWorkers,
        Self::Late,
        Self::Second,
        Self::Unknown,
        Self::Leaves,
        Self::Golden,
    ];

    /// Whether it is asked of nodes of this role.
    #[must_use]
    pub const fn is_of(self, role: Role) -> bool {
        match self {
            Self::InPlace => !matches!(role, Role::Traffic),
            Self::Moves | Self::HandOver => matches!(role, Role::Traffic),
            _ => true,
        }
    }

    /// Its name, in reports and documents.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Joins => "joins",
            Self::Answers => "answers",
            Self::InTime => "in-time",
            Self::InPlace => "in-place",
            Self::Moves => "moves",
            Self::HandOver => "hand-over",
            Self::Repeats => "repeats",
            Self::Forgets => "forgets",
            Self::OddScenes => "odd-scenes",
            Self::CutShort => "cut-short",
            Self::Noise => "noise",
            Self::Version => "version",
            Self::AllWorkers => "all-workers",
            Self::Late => "late",
            Self::Second => "second",
            Self::Unknown => "unknown",
            Self::Leaves => "leaves",
            Self::Golden => "golden",
        }
    }

    /// What to do where it is broken or in doubt.
    #[must_use]
    pub const fn advice(self) -> &'static str {
        match self {
            Self::Joins => {
                "connect as client to RELOOP_ENDPOINT, subscribe, then declare the token of your seat and keep it; docs/bus.md, \"A node in any other language\", \
                 says how"
            }
            Self::Answers => {
                "answer each observation once, with its step, 50 states (or 50 poses an agent; or a state for each agent that traffic drives) of finite numbers, and \
                 50 controls or none; say in `error` why there is none"
            }
            Self::InTime => {
                "a step is 0.1 s: load and compile when the process starts, not at the first observation; run with a longer --deadline where it must be"
            }
            Self::InPlace => {
                "states are in the log's frame, in metres, counter-clockwise from +x, the first 0.1 s after the observation, and agents are those that were observed"
            }
            Self::Moves => {
                "go on from the `state` that you are told: the size stays, the place is where the speeds lead, and speed and heading change by what tyres can do in 0.1 s"
            }
            Self::HandOver => {
                "an agent that is taken over goes on as it was logged: what it is aside of its way, or slower than you like, goes by and by"
            }
            Self::Repeats => {
                "seed whatever is random by what is observed, never by clock or process; take no order from a hash map, and no time limit as the end of a search"
            }
            Self::Forgets => {
                "keep what you keep by episode, make it anew with each `scene`, and drop it with its `end`"
            }
            Self::OddScenes => {
                "an observation may have no agent, hundreds of them, ones that come and go; the AV may stand still"
            }
            Self::CutShort => {
                "an `end` may come after any step: answer it with `done`, and begin anew with the next `scene`"
            }
            Self::Noise => "catch what your decoder raises: say so in `error`, or pass over it, but live on",
            Self::Version => {
                "compare `wire_version` of a scene with yours, and answer its observations with an `error`"
            }
            Self::AllWorkers => {
                "with --worker '*' keep a desk for each worker, by the part of the key before `told`: their episodes are on at the same time"
            }
            Self::Late => "nothing may depend on when the process starts: what it needs is told anew with each `scene`",
            Self::Second => {
                "listen to `@door/{session}`: where `accepted` is not set, print the reason and leave with an exit code other than 0"
            }
            Self::Unknown => {
                "a run that knows you says so at `@door/{session}`: where nobody does within some 10 s, say so and leave with an exit code other than 0"
            }
            Self::Leaves => {
                "leave with exit code 0 when standard input ends (if told --exit-with-parent), on SIGTERM, and when the sim's token goes"
            }
            Self::Golden => {
                "if the change is meant, write the file anew with --bless; if not, something that you depend on has changed"
            }
        }
    }
}

/// How a rule was found.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// As it should be.
    Holds,
    /// It works, but not everywhere, or not for long.
    Doubtful,
    /// It does not.
    Broken,
    /// It was not looked at.
    Skipped,
}

impl Verdict {
    /// As it is told.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Holds => "holds",
            Self::Doubtful => "in doubt",
            Self::Broken => "BROKEN",
            Self::Skipped => "skipped",
        }
    }
}

/// What came of a rule.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finding {
    /// The rule.
    pub rule: Rule,
    /// How it was found.
    pub verdict: Verdict,
    /// What was seen, as a sentence.
    pub seen: String,
}

impl Finding {
    /// It holds: this was seen.
    pub fn holds(rule: Rule, seen: impl Into<String>) -> Self {
        Self { rule, verdict: Verdict::Holds, seen: seen.into() }
    }

    /// It is in doubt, because of this.
    pub fn doubtful(rule: Rule, seen: impl Into<String>) -> Self {
        Self { rule, verdict: Verdict::Doubtful, seen: seen.into() }
    }

    /// It is broken: this was seen.
    pub fn broken(rule: Rule, seen: impl Into<String>) -> Self {
        Self { rule, verdict: Verdict::Broken, seen: seen.into() }
    }

    /// It was not looked at, because of this.
    pub fn skipped(rule: Rule, seen: impl Into<String>) -> Self {
        Self { rule, verdict: Verdict::Skipped, seen: seen.into() }
    }

    /// It holds where `outcome` is one, else it is broken.
    pub fn of(rule: Rule, outcome: Result<String, String>) -> Self {
        match outcome {
            Ok(seen) => Self::holds(rule, seen),
            Err(seen) => Self::broken(rule, seen),
        }
    }
}
