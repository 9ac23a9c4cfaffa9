//! A driver that waits to be let on: before each step, until somebody asks for it. What is driven behind it is `sim run`'s own drive, so that a
//! session that is driven to its end comes to what a run comes to.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::Receiver;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use wire::proto::service::{Session, reply};
use wire::proto::{EpisodeEnd, Event, Observation as Seen, Plan as Said, Prediction, Scene, StepRecord};
use wire::service::Answer;
use world::observation::{Briefing, Observation};
use world::plan::Plan;
use world::traffic::{Taken, UncheckedMoves};

use super::no_session;
use crate::run::drive::Driver;
use crate::run::line::LineDriver;
use crate::run::witness::Witness;

/// A question for steps is answered after this, however many were driven.
const ANSWERED_WITHIN: Duration = Duration::from_secs(1);

/// What a session is told.
pub enum Order {
    /// Drive so many steps, and say how it went.
    Step(u32, Answer),
    /// Leave, and say where it was.
    Close(Answer),
}

impl Order {
    /// Tells who gave it that nothing comes of it.
    pub fn refuse(self, refusal: reply::What) {
        let (Self::Step(_, answer) | Self::Close(answer)) = self;
        answer.give(refusal);
    }
}

/// Steps that were asked for, and not all driven.
struct Asked {
    left: u32,
    answer: Answer,
    until: Instant,
}

/// Plans that were driven, for who forks.
pub type Driven = Arc<Mutex<Vec<Plan>>>;

/// A session's end of its orders, and what there is to say.
pub struct Post {
    orders: Receiver<Order>,
    idle: Duration,
    asked: Option<Asked>,
    /// Who opened the session, until it stands at its first step.
    opener: Option<Answer>,
    /// What the next answer says.
    news: Session,
}

impl Drop for Post {
    /// Who asked while the session was left is told so.
    fn drop(&mut self) {
        for order in self.orders.try_iter() {
            order.refuse(reply::What::Refusal(no_session(&self.news.session)));
        }
    }
}

impl Post {
    /// The post of a session that `opener` waits for.
    #[must_use]
    pub fn new(news: Session, opener: Answer, orders: Receiver<Order>, idle: Duration) -> Self {
        Self { orders, idle, asked: None, opener: Some(opener), news }
    }

    /// The session's name and where it is stay; what happened was told.
    fn tell(&mut self, answer: Answer) {
        let Session { session, scene, driver, step, horizon, observation, plan, prediction, end, .. } = &self.news;
        let after = Session {
            session: session.clone(),
            scene: scene.clone(),
            driver: driver.clone(),
            step: *step,
            horizon: *horizon,
            observation: observation.clone(),
            plan: plan.clone(),
            prediction: prediction.clone(),
            end: end.clone(),
            ..Session::default()
        };
        answer.give(reply::What::Session(Box::new(std::mem::replace(&mut self.news, after))));
    }

    /// Tells whoever waits for it that no more can be driven, or enough.
    fn tell_waiting(&mut self) {
        if let Some(answer) = self.opener.take().or_else(|| self.asked.take().map(|asked| asked.answer)) {
            self.tell(answer);
        }
    }

    /// Refuses whoever opened the session.
    pub fn refuse(mut self, refusal: reply::What) {
        if let Some(answer) = self.opener.take() {
            answer.give(refusal);
        }
    }

    /// Waits until a step is to be driven; false where the session is to be left.
    fn wait(&mut self) -> bool {
        loop {
            match &mut self.asked {
                Some(asked) if asked.left > 0 && Instant::now() < asked.until => {
                    asked.left -= 1;
                    return true;
                }
                _ => self.tell_waiting(),
            }
            match self.orders.recv_timeout(self.idle) {
                Ok(Order::Step(left, answer)) => {
                    self.asked = Some(Asked { left, answer, until: Instant::now() + ANSWERED_WITHIN });
                }
                Ok(Order::Close(answer)) => {
                    self.tell(answer);
                    return false;
                }
                Err(_) => return false,
            }
        }
    }

    /// The episode is over: says so to whoever asks, until the session is left.
    pub fn after(mut self, end: EpisodeEnd) {
        self.news.step = end.steps;
        self.news.observation = None;
        self.news.end = Some(end);
        self.tell_waiting();
        loop {
            match self.orders.recv_timeout(self.idle) {
                Ok(Order::Step(_, answer)) => self.tell(answer),
                Ok(Order::Close(answer)) => return self.tell(answer),
                Err(_) => return,
            }
        }
    }
}

/// The driver behind the gate.
pub struct Gate<'a, 'b> {
    /// Who drives.
    pub inner: &'a mut Witness<'b, LineDriver>,
    /// Who asks.
    pub post: &'a mut Post,
    /// What was driven.
    pub driven: &'a Driven,
    /// The first step that is waited for: before it somebody else's plans lead.
    pub from: u32,
    /// Set when the session is to be left.
    pub stop: &'a AtomicBool,
}

impl Driver for Gate<'_, '_> {
    fn brief(&mut self, briefing: &Briefing) -> Result<(), String> {
        self.post.news.horizon = briefing.horizon;
        self.post.news.briefing = Some(Scene::from(briefing));
        self.inner.brief(briefing)
    }

    fn answer(&mut self, observation: &Observation) -> Result<Plan, String> {
        self.post.news.step = observation.step;
        if observation.step >= self.from {
            self.post.news.observation = Some(Seen::from(observation));
            if !self.post.wait() {
                self.stop.store(true, Ordering::Relaxed);
                return Err("the session is closed".to_owned());
            }
        }
        let plan = self.inner.answer(observation)?;
        self.post.news.plan = Some(Said::from(&plan.clone().into_unchecked()));
        let prediction = self.inner.driver.prediction.clone();
        self.post.news.prediction = prediction.map(|prediction| Prediction::from(&prediction.into_unchecked()));
        self.driven.lock().unwrap_or_else(PoisonError::into_inner).push(plan.clone());
        Ok(plan)
    }

    fn moves(&mut self, observation: &Observation, taken: &[Taken]) -> Result<UncheckedMoves, String> {
        self.inner.moves(observation, taken)
    }

    fn step_done(&mut self, record: &StepRecord, events: &[Event]) {
        self.post.news.records.push(*record);
        self.post.news.events.extend_from_slice(events);
        self.inner.step_done(record, events);
    }

    fn dismiss(&mut self, end: &EpisodeEnd) -> Result<(), String> {
        self.inner.dismiss(end)
    }

    fn end(&mut self, events: &[Event], end: &mut EpisodeEnd) -> Result<(), String> {
        self.post.news.events.extend_from_slice(events);
        self.inner.end(events, end)
    }
}
