//! `sim session`: one scene of a service, step by step. Commands come from standard input, so from a person or a script.

use std::fmt::Write as _;
use std::io::{self, BufRead, IsTerminal as _};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use results::part::reason_name;
use wire::proto::service::{self as message, Session, Settings, ask, reply};
use wire::proto::{AgentState, StepRecord};

use super::{ClientError, Service, settings};
use crate::cli::SessionArgs;
use crate::run::console::Console;
use crate::run::voice::escaped;

const HELP: &str = "\
step [N]            drive one step, or N
run                 drive to the end; Ctrl-C pauses
state               where the AV is, and who is near
plan                the plan that was driven last, each second of it
fork STEP DRIVER    another session, in which DRIVER takes over at STEP
use SESSION         go on with another of your sessions
sessions            name them
close               close this session
quit                close all, and leave; so does the end of the input
";

/// What is typed.
#[derive(Debug, PartialEq, Eq)]
enum Typed {
    Nothing,
    Step(u32),
    Run,
    State,
    Plan,
    Fork(u32, String),
    Use(String),
    Sessions,
    Close,
    Quit,
    Help,
}

impl Typed {
    fn parse(line: &str) -> Result<Self, String> {
        let words: Vec<&str> = line.split_whitespace().collect();
        let number = |text: &str| text.parse::<u32>().map_err(|_| format!("{text:?} is no number of steps"));
        Ok(match words[..] {
            [] => Self::Nothing,
            ["step" | "s"] => Self::Step(1),
            ["step" | "s", count] => Self::Step(number(count)?),
            ["run" | "r"] => Self::Run,
            ["state"] => Self::State,
            ["plan"] => Self::Plan,
            ["fork", step, driver] => Self::Fork(number(step)?, driver.to_owned()),
            ["use", session] => Self::Use(session.to_owned()),
            ["sessions"] => Self::Sessions,
            ["close"] => Self::Close,
            ["quit" | "exit" | "q"] => Self::Quit,
            ["help" | "?"] => Self::Help,
            [other, ..] => return Err(format!("{other:?} is no command, or not so\nhint: help lists them")),
        })
    }
}

/// Opens a session and does what is typed.
///
/// # Errors
/// [`ClientError`] where it cannot be opened; later ones are told, and the next command is read. A closed standard output.
pub fn session(arguments: &SessionArgs, service: &mut Service, console: &Console) -> anyhow::Result<()> {
    let paused = Arc::new(AtomicBool::new(false));
    let pressed = Arc::clone(&paused);
    ctrlc::set_handler(move || pressed.store(true, Ordering::Relaxed))?;
    let asked = message::Open {
        client: service.client.clone(),
        settings: Some(settings(&arguments.settings)),
        scene: arguments.scene.clone(),
    };
    let opened = answered(service.ask_once(ask::What::Open(asked))?)?;
    let mut talk = Talk {
        service,
        paused,
        sessions: vec![opened.session.clone()],
        now: 0,
        taken_over: settings(&arguments.settings),
    };
    terminal::say(&opening(&opened))?;
    let prompts = io::stdin().is_terminal();
    let mut lines = io::stdin().lock().lines();
    loop {
        if prompts {
            terminal::say("> ")?;
        }
        let Some(line) = lines.next().transpose()? else { break };
        let said = match Typed::parse(&line) {
            Ok(Typed::Quit) => break,
            Ok(typed) => talk.obey(typed),
            Err(what) => Err(anyhow::anyhow!(what)),
        };
        match said {
            Ok(text) => terminal::say(&text)?,
            Err(error) => console.line(&format!("error: {error}")),
        }
        if talk.sessions.is_empty() {
            break;
        }
    }
    talk.close_all();
    Ok(())
}

/// The sessions of one client.
struct Talk<'a> {
    service: &'a mut Service,
    paused: Arc<AtomicBool>,
    sessions: Vec<String>,
    /// Which is meant.
    now: usize,
    /// How who takes over drives, but for the driver.
    taken_over: Settings,
}

impl Talk<'_> {
    fn obey(&mut self, typed: Typed) -> anyhow::Result<String> {
        Ok(match typed {
            Typed::Nothing | Typed::Quit => String::new(),
            Typed::Help => HELP.to_owned(),
            Typed::Step(count) => self.drive(Some(count))?,
            Typed::Run => self.drive(None)?,
            Typed::State => state(&self.step(0)?),
            Typed::Plan => plan(&self.step(0)?),
            Typed::Sessions => {
                let line = |(place, name): (usize, &String)| {
                    format!("{name}{}\n", if place == self.now { " (this one)" } else { "" })
                };
                self.sessions.iter().enumerate().map(line).collect()
            }
            Typed::Use(name) => {
                let place = self.sessions.iter().position(|session| *session == name);
                self.now = place
                    .ok_or_else(|| anyhow::anyhow!("{name:?} is none of your sessions\nhint: sessions names them"))?;
                state(&self.step(0)?)
            }
            Typed::Fork(step, driver) => {
                // The predictor and the weights of the one before are not those of another.
                let base = self.taken_over.clone();
                let settings =
                    Settings { driver, deadline: base.deadline, in_process: base.in_process, ..Settings::default() };
                let asked = message::Fork { session: self.sessions[self.now].clone(), step, settings: Some(settings) };
                let opened = answered(self.service.ask_once(ask::What::Fork(asked))?)?;
                self.sessions.push(opened.session.clone());
                self.now = self.sessions.len() - 1;
                opening(&opened)
            }
            Typed::Close => {
                let session = self.sessions.remove(self.now);
                self.now = 0;
                self.service.ask_once(ask::What::Close(message::Close { session: session.clone() }))?;
                format!("{session} is closed\n")
            }
        })
    }

    fn step(&mut self, steps: u32) -> Result<Session, ClientError> {
        let session = self.sessions[self.now].clone();
        answered(self.service.ask_once(ask::What::Step(message::Step { session, steps }))?)
    }

    /// Drives so many steps, or to the end.
    fn drive(&mut self, count: Option<u32>) -> anyhow::Result<String> {
        self.paused.store(false, Ordering::Relaxed);
        let mut left = count.unwrap_or(u32::MAX);
        let mut text = String::new();
        while left > 0 {
            let now = self.step(left)?;
            left = left.saturating_sub(now.records.len() as u32);
            text.push_str(&driven(&now));
            if let Some(end) = &now.end {
                let _ = writeln!(
                    text,
                    "the episode is over: {} after {} steps {}",
                    reason_name(end.reason()),
                    end.steps,
                    escaped(&end.detail)
                );
                break;
            }
            if self.paused.load(Ordering::Relaxed) {
                let _ = writeln!(text, "paused before step {}", now.step);
                break;
            }
        }
        Ok(text)
    }

    fn close_all(&mut self) {
        for session in std::mem::take(&mut self.sessions) {
            // One that is gone is closed.
            let _ = self.service.ask_once(ask::What::Close(message::Close { session }));
        }
    }
}

fn answered(reply: reply::What) -> Result<Session, ClientError> {
    match reply {
        reply::What::Session(session) => Ok(*session),
        _ => Err(ClientError::OtherAnswer),
    }
}

fn opening(session: &Session) -> String {
    let Session { session: name, scene, driver, step, horizon, .. } = session;
    let (name, scene, driver) = (escaped(name), escaped(scene), escaped(driver));
    format!("session {name}: {driver} drives {scene}, at step {step} of {horizon}; help lists what can be typed\n")
}

fn speed(av: &AgentState) -> f64 {
    (av.velocity_x * av.velocity_x + av.velocity_y * av.velocity_y).sqrt()
}

/// A line a step, and a line an event.
fn driven(session: &Session) -> String {
    let mut text = String::new();
    for record in &session.records {
        let StepRecord { step, av, control, .. } = record;
        let (av, control) = (av.unwrap_or_default(), control.unwrap_or_default());
        let _ = writeln!(
            text,
            "step {step}: at ({:.2}, {:.2}), heading {:.3} rad, {:.2} m/s; acceleration {:.2} m/s², steering {:.3} rad",
            av.x,
            av.y,
            av.heading,
            speed(&av),
            control.acceleration,
            control.steering
        );
        for event in session.events.iter().filter(|event| event.step == *step) {
            let _ = writeln!(text, "    {}", escaped(&event.text));
        }
    }
    text
}

/// The AV, and the nearest around it.
fn state(session: &Session) -> String {
    let Some(seen) = &session.observation else {
        return format!("the episode is over, after {} steps\n", session.step);
    };
    let av = seen.av.unwrap_or_default();
    let mut text = format!(
        "before step {} of {}: at ({:.2}, {:.2}), heading {:.3} rad, {:.2} m/s\n",
        session.step,
        session.horizon,
        av.x,
        av.y,
        av.heading,
        speed(&av)
    );
    let mut near: Vec<(f64, String)> = Vec::new();
    for agent in &seen.agents {
        let state = agent.state.unwrap_or_default();
        let (dx, dy) = (state.x - av.x, state.y - av.y);
        let distance = (dx * dx + dy * dy).sqrt();
        let kind = agent.kind().as_str_name().trim_start_matches("AGENT_KIND_").to_lowercase();
        near.push((distance, format!("    {kind} {}: {distance:.1} m away, {:.2} m/s\n", agent.track, speed(&state))));
    }
    near.sort_by(|one, other| one.0.total_cmp(&other.0));
    near.iter().take(5).for_each(|(_, line)| text.push_str(line));
    text
}

/// The plan that was driven last.
fn plan(session: &Session) -> String {
    let Some(plan) = &session.plan else { return "no step was driven yet\n".to_owned() };
    let mut text =
        format!("the plan of step {}: {} {} iterations\n", plan.step, escaped(&plan.status), plan.iterations);
    for (tenth, at) in plan.states.iter().enumerate().skip(9).step_by(10) {
        let seconds = (tenth + 1) / 10;
        let _ = writeln!(
            text,
            "    in {seconds} s: at ({:.2}, {:.2}), heading {:.3} rad, {:.2} m/s",
            at.x, at.y, at.heading, at.speed
        );
    }
    for term in &plan.objective {
        let _ = writeln!(text, "    {}: {:.4}", escaped(&term.name), term.value);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commands_are_words() {
        assert_eq!(Typed::parse("  step 10 "), Ok(Typed::Step(10)));
        assert_eq!(Typed::parse("s"), Ok(Typed::Step(1)));
        assert_eq!(Typed::parse("fork 40 idm"), Ok(Typed::Fork(40, "idm".to_owned())));
        assert_eq!(Typed::parse(""), Ok(Typed::Nothing));
        for wrong in ["step x", "step -1", "jump", "fork 40", "use"] {
            assert!(Typed::parse(wrong).is_err(), "{wrong}");
        }
    }
}
