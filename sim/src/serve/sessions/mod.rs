//! Sessions: one episode each, driven step by step as somebody asks, to see what a planner does and why. A session lives in a thread until it is
//! closed, nobody asks anything for a while, or the service ends.

mod gate;

use std::collections::BTreeMap;
use std::sync::mpsc::{SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use episode::protocol::{Motion, Protocol};
use wire::keys::Secret;
use wire::proto::service::refusal::Code;
use wire::proto::service::{self as message, Refusal, Session, reply};
use wire::service::{Answer, refused};
use world::plan::Plan;

use self::gate::{Driven, Gate, Order, Post};
use super::offer::{Offer, is_name};
use super::record::Wish;
use crate::cli::ServeArgs;
use crate::request::Request;
use crate::run::clock::WallClock;
use crate::run::console::Console;
use crate::run::drive::drive;
use crate::run::one::one;
use crate::run::process::Groups;

/// Questions to one session that wait.
const MOST_WAITING: usize = 16;

/// How long sessions may take to leave when the service ends.
const PATIENCE: Duration = Duration::from_secs(2);

/// What makes a session.
#[derive(Clone)]
struct Cast {
    scene: String,
    wish: Wish,
    request: Request,
}

/// A session, from the service's side.
struct Open {
    cast: Cast,
    driven: Driven,
    orders: SyncSender<Order>,
    thread: JoinHandle<()>,
}

/// All sessions of a service.
pub struct Sessions {
    by_name: BTreeMap<String, Open>,
    most: usize,
    idle: Duration,
    clock: WallClock,
    console: Console,
    /// The nodes of all of them.
    groups: Groups,
}

impl Sessions {
    /// None yet.
    #[must_use]
    pub fn new(arguments: &ServeArgs, clock: WallClock, console: &Console) -> Self {
        Self {
            by_name: BTreeMap::new(),
            most: arguments.most_sessions.into(),
            idle: arguments.session_idle,
            clock,
            console: console.clone(),
            groups: Groups::default(),
        }
    }

    /// How many there are.
    #[must_use]
    pub fn open_now(&self) -> usize {
        self.by_name.len()
    }

    /// How many there may be.
    #[must_use]
    pub fn most(&self) -> usize {
        self.most
    }

    /// Opens a session; it answers itself, once it stands before its first step.
    pub fn open(&mut self, asked: message::Open, offer: &Offer, answer: Answer) {
        let cast = || {
            if !is_name(&asked.client) {
                return Err(refusal(Code::BadSettings, "the client's name is 1 to 100 of A-Z a-z 0-9 _ . -"));
            }
            let wish = offer.wish(&asked.settings.clone().unwrap_or_default())?;
            let request = at_once(offer.request(&wish, 1)?)?;
            Ok(Cast { scene: asked.scene.clone(), wish, request })
        };
        match cast() {
            Ok(cast) => self.start(cast, Vec::new(), answer),
            Err(refusal) => answer.give(reply::What::Refusal(refusal)),
        }
    }

    /// Opens another session, which goes on from a step of this one with another driver.
    pub fn fork(&mut self, asked: message::Fork, offer: &Offer, answer: Answer) {
        match self.forked(asked, offer) {
            Ok((cast, lead)) => self.start(cast, lead, answer),
            Err(refusal) => answer.give(reply::What::Refusal(refusal)),
        }
    }

    fn forked(&self, asked: message::Fork, offer: &Offer) -> Result<(Cast, Vec<Plan>), Refusal> {
        let from = self.by_name.get(&asked.session).ok_or_else(|| no_session(&asked.session))?;
        let settings =
            message::Settings { scenes: from.cast.wish.scenes.clone(), ..asked.settings.unwrap_or_default() };
        let wish = offer.wish(&settings)?;
        let mut request = at_once(offer.request(&wish, 1)?)?;
        let is_played =
            |protocol: &Protocol| matches!(protocol, Protocol::Strict(strict) if strict.motion == Motion::Playback);
        let protocol = &from.cast.request.settings.protocol;
        if is_played(protocol) && !is_played(&request.settings.protocol) {
            let text = "the AV of this session is played back, not driven, and who takes over would be too\nhint: fork a session of another driver than human";
            return Err(refusal(Code::BadSettings, text));
        }
        request.settings.protocol = protocol.clone();
        let driven = from.driven.lock().unwrap_or_else(PoisonError::into_inner);
        let lead = driven.get(..asked.step as usize).ok_or_else(|| {
            let text = format!(
                "only {} steps of this session were driven\nhint: fork at one of them, or drive on first",
                driven.len()
            );
            refusal(Code::BadSettings, &text)
        })?;
        Ok((Cast { scene: from.cast.scene.clone(), wish, request }, lead.to_vec()))
    }

    fn start(&mut self, cast: Cast, lead: Vec<Plan>, answer: Answer) {
        self.tick();
        if self.by_name.len() >= self.most {
            let text = format!(
                "there are {} sessions, as many as may be\nhint: close one, or wait until one is closed that nobody uses",
                self.most
            );
            return answer.give(refused(Code::Full, text));
        }
        let Ok(random) = Secret::random() else {
            return answer.give(refused(Code::Failed, "the system gives no randomness"));
        };
        let name = format!("s-{}", random.reveal().get(..8).unwrap_or_default());
        let (orders, post) = sync_channel(MOST_WAITING);
        let driver = cast.request.settings.driver.clone();
        let news = Session { session: name.clone(), scene: cast.scene.clone(), driver, ..Session::default() };
        let post = Post::new(news, answer, post, self.idle);
        let (driven, own) = (Driven::default(), cast.clone());
        let (clock, console, groups, plans) =
            (self.clock, self.console.clone(), self.groups.clone(), Arc::clone(&driven));
        // A panic ends the session: whoever asks is told that it has no answer, and later that there is no such session.
        let thread = thread::spawn(move || hold(&own, lead, &plans, post, (clock, &console, &groups)));
        self.by_name.insert(name, Open { cast, driven, orders, thread });
    }

    /// Hands a question for steps on to its session.
    pub fn step(&mut self, asked: &message::Step, answer: Answer) {
        self.hand_on(&asked.session, answer, |answer| Order::Step(asked.steps, answer));
    }

    /// Closes a session.
    pub fn close(&mut self, asked: &message::Close, answer: Answer) {
        self.hand_on(&asked.session, answer, Order::Close);
    }

    fn hand_on(&mut self, session: &str, answer: Answer, order: impl FnOnce(Answer) -> Order) {
        let Some(open) = self.by_name.get(session).filter(|open| !open.thread.is_finished()) else {
            return answer.give(reply::What::Refusal(no_session(session)));
        };
        match open.orders.try_send(order(answer)) {
            Ok(()) => {}
            Err(TrySendError::Full(order)) => {
                order.refuse(refused(
                    Code::Full,
                    "the session is asked too much at once\nhint: ask one thing at a time",
                ));
            }
            // It is being left.
            Err(TrySendError::Disconnected(order)) => order.refuse(reply::What::Refusal(no_session(session))),
        }
    }

    /// Forgets those that are over.
    pub fn tick(&mut self) {
        self.by_name.retain(|_, open| !open.thread.is_finished());
    }

    /// Closes all.
    pub fn end(&mut self) {
        let threads: Vec<JoinHandle<()>> =
            std::mem::take(&mut self.by_name).into_values().map(|open| open.thread).collect();
        let until = Instant::now() + PATIENCE;
        while threads.iter().any(|thread| !thread.is_finished()) && Instant::now() < until {
            thread::sleep(Duration::from_millis(5));
        }
        self.groups.kill_all();
    }
}

/// Holds a session until it is left.
fn hold(cast: &Cast, lead: Vec<Plan>, driven: &Driven, mut post: Post, means: (WallClock, &Console, &Groups)) {
    let from = lead.len() as u32;
    let clock = means.0;
    let ended = one(&cast.request, &cast.scene, lead, means, |episode, inner, stop| {
        let mut gate = Gate { inner, post: &mut post, driven, from, stop };
        drive(episode, &mut gate, None, &clock, stop).map(|driven| driven.outcome.end)
    });
    match ended {
        Ok(Some(end)) => post.after(end),
        Ok(None) => {}
        Err(error) => post.refuse(refused(Code::BadSettings, error.to_string())),
    }
}

/// This request, if its plans take effect at once, for a step of a session is driven by the plan that is asked for it; and if all are replayed, for
/// what leads up to a fork are plans alone.
fn at_once(request: Request) -> Result<Request, Refusal> {
    let text = "plans of a session take effect at once\nhint: leave latency out, or submit a run";
    let replayed = "agents of a session are replayed\nhint: leave traffic out, or submit a run";
    match (&request.settings.latency, &request.settings.traffic) {
        (Some(_), _) => Err(refusal(Code::BadSettings, text)),
        (None, Some(_)) => Err(refusal(Code::BadSettings, replayed)),
        (None, None) => Ok(request),
    }
}

fn refusal(code: Code, text: &str) -> Refusal {
    Refusal { code: code.into(), text: text.to_owned() }
}

fn no_session(name: &str) -> Refusal {
    let text = format!(
        "there is no session {name:?}\nhint: one that nobody asks anything for a while is closed, and none outlives the service"
    );
    refusal(Code::NoSuchSession, &text)
}
