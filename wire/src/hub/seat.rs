//! A seat: the place of one node on the bus. What is said there is heard here: answers go to the open episodes, and whatever else
//! anybody says is noticed.

use std::collections::BTreeMap;
use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex};

use prost::Message as _;
use zenoh::Wait;
use zenoh::bytes::ZBytes;
use zenoh::pubsub::{Publisher, Subscriber};
use zenoh::sample::{Locality, Sample, SampleKind};

use super::inbox::Inbox;
use super::nodes::SeatNumber;
use super::{Shared, lock};
use crate::convert::shown;
use crate::envelope::{self, Saying};
use crate::keys::{Answering, NodeId, Place, Role, Secret, Worker, Workers};
use crate::proto;
use crate::session::{self, Guarded, SessionError};

/// A place for one node of one role. Who is told its secret may take it; the first that does keeps it while it lives. Dropping the
/// seat takes it away.
pub struct Seat {
    inner: Arc<Inner>,
    secret: Secret,
    /// Kept because dropping them ends them.
    _subscribers: Vec<Subscriber<()>>,
}

/// What the seat, its lines and the transport's callbacks share.
pub(super) struct Inner {
    pub(super) number: SeatNumber,
    pub(super) role: Role,
    pub(super) place: Place,
    shared: Arc<Shared>,
    /// The open lines' inboxes, for the callbacks to find them.
    inboxes: Mutex<BTreeMap<Worker, Arc<Inbox>>>,
    /// What tells the node of each worker's episodes: declared once, for the transport keeps what it knows of a key for ever.
    tellers: Mutex<BTreeMap<Worker, Arc<Publisher<'static>>>>,
}

impl Seat {
    pub(super) fn open(
        shared: &Arc<Shared>,
        role: Role,
        workers: &Workers,
        secret: Secret,
    ) -> Result<Self, SessionError> {
        let place = Place::seat(&shared.run, &secret).map_err(|e| SessionError::bus("make a seat")(e.into()))?;
        let number = shared.nodes.add_seat(role, workers);
        let inner = Arc::new(Inner {
            number,
            role,
            place: place.clone(),
            shared: Arc::clone(shared),
            inboxes: Mutex::default(),
            tellers: Mutex::default(),
        });
        let mut seat = Self { inner: Arc::clone(&inner), secret, _subscribers: Vec::new() };
        for selector in place.everything() {
            let inner = Arc::clone(&inner);
            // What the sim itself says here is no news to it.
            let subscriber = shared.session.declare_subscriber(selector).allowed_origin(Locality::Remote);
            let subscriber = subscriber.callback(move |sample| inner.hear(&sample)).wait();
            seat._subscribers.push(subscriber.map_err(SessionError::bus("subscribe"))?);
        }
        if role == Role::Recorder {
            let seat = Arc::downgrade(&inner);
            let cut_off = move || seat.upgrade().iter().for_each(|seat| seat.cut_off());
            shared.tape.tell_also(number, place.clone(), cut_off);
        }
        let watch = shared.session.liveliness().declare_subscriber(place.nodes()).history(true);
        let watch = watch.callback(move |sample| inner.see(&sample)).wait();
        seat._subscribers.push(watch.map_err(SessionError::bus("watch nodes"))?);
        Ok(seat)
    }

    /// What the node must be told to take this seat.
    #[must_use]
    pub fn secret(&self) -> &Secret {
        &self.secret
    }

    /// Who sits here.
    #[must_use]
    pub fn node(&self) -> Option<NodeId> {
        self.inner.shared.nodes.at(self.inner.number)
    }

    pub(super) fn inner(&self) -> &Arc<Inner> {
        &self.inner
    }
}

impl Drop for Seat {
    fn drop(&mut self) {
        self.inner.shared.nodes.remove_seat(self.inner.number);
        // They hold this seat, and the seat them.
        lock(&self.inner.tellers).clear();
    }
}

impl Inner {
    /// Whoever sits here.
    pub(super) fn node(&self) -> Option<NodeId> {
        self.shared.nodes.at(self.number)
    }

    /// Puts what is said of `worker` into `inbox`; false where somebody listens already.
    pub(super) fn listen(&self, worker: &Worker, inbox: &Arc<Inbox>) -> bool {
        let mut inboxes = lock(&self.inboxes);
        let free = !inboxes.contains_key(worker);
        if free {
            inboxes.insert(worker.clone(), Arc::clone(inbox));
        }
        free
    }

    pub(super) fn listen_no_more(&self, worker: &Worker) {
        lock(&self.inboxes).remove(worker);
    }

    /// What tells the node of the episodes of `worker`.
    pub(super) fn teller(&self, worker: &Worker) -> Result<Arc<Publisher<'static>>, SessionError> {
        let mut tellers = lock(&self.tellers);
        if let Some(teller) = tellers.get(worker) {
            return Ok(Arc::clone(teller));
        }
        let key = self.place.told(&Workers::One(worker.clone()));
        let teller = Arc::new(session::publisher(&self.shared.session, key)?);
        tellers.insert(worker.clone(), Arc::clone(&teller));
        Ok(teller)
    }

    /// Somebody put something at this seat. Called by the transport: never blocks.
    fn hear(&self, sample: &Sample) {
        let key = sample.key_expr().as_str();
        let expected =
            |answer: &Answering| sample.kind() == SampleKind::Put && Some(answer.channel) == self.role.answers_with();
        match Answering::parse(key).filter(expected) {
            Some(answer) if self.shared.nodes.is_at(self.number, &answer.session) => {
                let inbox = lock(&self.inboxes).get(&answer.worker).cloned();
                match inbox {
                    Some(inbox) => inbox.deliver(self.role, sample.payload()),
                    // Nobody waits for it any more: the episode it is for ended before, as failed.
                    None if self.shared.was_begun(sample.payload()) => {
                        tracing::debug!("{} answers an episode that is over", self.name());
                    }
                    None => self.shared.noticed(&format!("{} answers though no episode is on", self.name())),
                }
            }
            Some(answer) => {
                let (role, session) = (self.role, &answer.session);
                self.shared.noticed(&format!(
                    "an answer of the {role} of bus session {session} is not counted: {} is the one that is asked",
                    self.name()
                ));
            }
            // In the sim's name, to the sim's node: who can tell what that makes of it?
            None => {
                let what =
                    key.rsplit_once("/@seat-").and_then(|(_, rest)| rest.split_once('/')).map_or(key, |(_, rest)| rest);
                self.shared
                    .noticed(&format!("somebody else speaks to {} in the simulator's name ({what})", self.name()));
                lock(&self.inboxes).values().for_each(|inbox| inbox.intruded(self.role));
            }
        }
    }

    /// The node takes nothing any more: it is as good as gone.
    fn cut_off(&self) {
        if let Some(node) = self.node() {
            tracing::warn!("{node} takes nothing any more, and is cut off");
            self.lose(&node);
        }
    }

    fn lose(&self, node: &NodeId) {
        if self.shared.nodes.left(self.number, node) {
            tracing::debug!("{node} is gone");
            lock(&self.inboxes).values().for_each(|inbox| inbox.node_lost());
        }
    }

    fn name(&self) -> String {
        self.node().map_or_else(|| format!("a {}", self.role), |node| node.to_string())
    }

    /// A token is there, or gone.
    fn see(&self, sample: &Sample) {
        let key = sample.key_expr().as_str();
        let Some(node) = NodeId::parse(key) else {
            return self.shared.noticed(&format!("a {} has a token that cannot be read", self.role));
        };
        if sample.kind() == SampleKind::Delete {
            return self.lose(&node);
        }
        let certified = self.shared.refused_for_certificate(&self.place, &node).map_or(Ok(()), Err);
        match certified.and_then(|()| self.shared.nodes.ask(self.number, &node)) {
            Err(refusal) => self.shared.admit(&self.place, &node, Some(refusal)),
            Ok(()) => {
                self.shared.admit(&self.place, &node, None);
                self.shared.nodes.knows(self.number);
            }
        }
    }
}

impl Shared {
    /// Why the certificate of `node` does not let it sit at `place`. The router's access control is deaf to what it says there, whatever
    /// name it goes by.
    fn refused_for_certificate(&self, place: &Place, node: &NodeId) -> Option<String> {
        let Guarded { names, .. } = self.guarded.as_ref().filter(|guarded| guarded.seat == *place)?;
        let holder = node.session.as_ref().and_then(|session| session::certificate_of(&self.session, session));
        let whose = match &holder {
            Some(name) if names.contains(name) => return None,
            Some(name) => format!("its certificate is of {}", shown(name)),
            None => "it has no certificate".to_owned(),
        };
        Some(format!("{whose}, and the {} of this run must have that of {}", node.role, names.join(" or ")))
    }

    /// Whether `answer` is to an episode that was begun.
    fn was_begun(&self, answer: &ZBytes) -> bool {
        let begun = self.episodes.load(Ordering::Relaxed);
        envelope::open::<Saying>(&answer.to_bytes()).is_ok_and(|(episode, ..)| (1..=begun).contains(&episode))
    }

    /// Tells `node` whether it is let in, and the user if it is not.
    pub(super) fn admit(&self, place: &Place, node: &NodeId, refusal: Option<String>) {
        match &refusal {
            None => tracing::debug!("{node} is there"),
            Some(reason) => self.noticed(&format!("{node} is refused: {reason}")),
        }
        // Nodes of version 1 say no session, and do not listen.
        let Some(session) = &node.session else { return };
        let word = proto::Admission { accepted: refusal.is_none(), reason: refusal.unwrap_or_default() };
        let word = ZBytes::from(word.encode_to_vec());
        if let Err(e) = session::send(&self.session, &place.door(session), word) {
            tracing::debug!("{node} is not told whether it is let in: {e}");
        }
    }
}
