//! Both ends of a service of the simulator: who answers, and who asks. What is said is in `proto/service.proto`.
//!
//! A question is a query under a key that holds the service's secret. Who does not know it reaches nobody, and cannot answer in
//! the service's place. All questions but [`Step`](crate::proto::service::Step) may be asked again for want of an answer.

use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::time::Duration;

use prost::Message as _;
use tempfile::TempDir;
use thiserror::Error;
use zenoh::query::{Query, Queryable};
use zenoh::{Session, Wait};

use crate::convert::{self, MAX_MESSAGE_BYTES, MessageError};
use crate::keys::{KeyError, SERVICE_VERSION, Secret, ServiceKey};
use crate::proto::service::refusal::Code;
use crate::proto::service::{Ask, Refusal, Reply, ask, reply};
use crate::session::{self, Router, RouterSettings, SessionError, ZenohFile};

/// Questions that wait to be looked at; who asks more is told to wait.
const MOST_WAITING: usize = 256;

/// A client that takes no answer is cut off after this.
const STALL: Duration = Duration::from_secs(1);

/// How long an answer may take: the service itself answers within a second, a machine that is busy may need longer.
const PATIENCE: Duration = Duration::from_secs(20);

/// Why there is no answer.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum ServiceError {
    #[error(transparent)]
    Session(#[from] SessionError),
    #[error(transparent)]
    Secret(#[from] KeyError),
    #[error(
        "no service at {0} knows this secret\nhint: is it a service, and RELOOP_SECRET the one that `sim serve` printed?"
    )]
    Nobody(String),
    #[error("the service at {endpoint} has not answered within {} s", PATIENCE.as_secs())]
    Silent { endpoint: String },
    #[error("the service's answer cannot be read: {0}\nhint: take service and client from the same revision")]
    Answer(#[from] MessageError),
    #[error("the service answers what was not asked\nhint: take service and client from the same revision")]
    OtherAnswer,
    #[error("{text}")]
    Refused { code: Code, text: String },
}

impl ServiceError {
    /// Whether asking again may help: the service may be on its way back.
    #[must_use]
    pub fn may_pass(&self) -> bool {
        matches!(self, Self::Session(_) | Self::Nobody(_) | Self::Silent { .. })
    }
}

/// A refusal.
#[must_use]
pub fn refused(code: Code, text: impl Into<String>) -> reply::What {
    reply::What::Refusal(Refusal { code: code.into(), text: text.into() })
}

/// The service's end: where it is asked.
pub struct Desk {
    session: Session,
    endpoint: String,
    /// Kept because dropping them ends them.
    _queryable: Queryable<()>,
    _folder: TempDir,
}

/// A question.
pub struct Asked {
    /// What is asked.
    pub what: ask::What,
    /// Who is to be answered.
    pub answer: Answer,
}

/// Who is to be answered. Where that is forgotten, the answer is that it was.
pub struct Answer(Option<Query>);

impl Drop for Answer {
    fn drop(&mut self) {
        self.send(refused(Code::Failed, "the service has no answer to this\nhint: its log may say why"));
    }
}

impl Answer {
    /// Answers. Who asked may be gone: that is no error.
    pub fn give(mut self, what: reply::What) {
        self.send(what);
    }

    fn send(&mut self, what: reply::What) {
        let Some(query) = self.0.take() else { return };
        let mut bytes = Reply { what: Some(what) }.encode_to_vec();
        if bytes.len() > MAX_MESSAGE_BYTES {
            let text = format!(
                "the answer has {} bytes, and {MAX_MESSAGE_BYTES} are the most\nhint: read the files of the run where the service is",
                bytes.len()
            );
            bytes = Reply { what: Some(refused(Code::Failed, text)) }.encode_to_vec();
        }
        if let Err(error) = query.reply(query.key_expr().clone(), bytes).wait() {
            tracing::debug!("a question could not be answered: {error}");
        }
    }
}

impl Desk {
    /// Listens at `endpoint`, with the user's own settings; what is asked there comes out of the channel.
    ///
    /// # Errors
    /// [`ServiceError`] where it cannot listen.
    pub fn open(
        endpoint: &str,
        secret: Secret,
        zenoh_file: Option<&ZenohFile>,
    ) -> Result<(Self, Receiver<Asked>), ServiceError> {
        let key = ServiceKey::new(secret)?;
        let settings = RouterSettings { outside: Some(endpoint), stall: STALL, zenoh_file, guarded: None };
        let Router { session, inside, outside, folder } = session::open_router(&settings)?;
        let endpoint = outside.unwrap_or(inside);
        let (questions, asked) = sync_channel(MOST_WAITING);
        let own = key.ask();
        let queryable =
            session.declare_queryable(key.ask_in_any_version()).callback(move |query| hear(query, &own, &questions));
        let queryable = queryable.wait().map_err(SessionError::bus("answer questions"))?;
        Ok((Self { session, endpoint, _queryable: queryable, _folder: folder }, asked))
    }

    /// Where it is.
    #[must_use]
    pub fn endpoint(&self) -> &str {
        &self.endpoint
    }

    /// Ends the session.
    pub fn close(self) {
        let session = self.session.clone();
        drop(self);
        if let Err(error) = session.close().wait() {
            tracing::debug!("closing the bus: {error}");
        }
    }
}

/// Hands a question under the key `own` on, or refuses it. Never waits.
fn hear(query: Query, own: &str, questions: &SyncSender<Asked>) {
    let is_other_version = query.key_expr().as_str() != own;
    let bytes = query.payload().map(|payload| payload.to_bytes().into_owned()).unwrap_or_default();
    let answer = Answer(Some(query));
    if is_other_version {
        let text = format!(
            "the service speaks version {SERVICE_VERSION}\nhint: take service and client from the same revision"
        );
        return answer.give(refused(Code::Malformed, text));
    }
    let what = match read(&bytes) {
        Ok(what) => what,
        Err(text) => return answer.give(refused(Code::Malformed, text)),
    };
    if let Err(TrySendError::Full(asked) | TrySendError::Disconnected(asked)) =
        questions.try_send(Asked { what, answer })
    {
        asked.answer.give(refused(Code::Full, "the service is asked too much at once\nhint: ask again later"));
    }
}

/// What the bytes of a question ask.
///
/// # Errors
/// That they are none, as a sentence.
pub fn read(bytes: &[u8]) -> Result<ask::What, String> {
    let ask: Ask = convert::decode(bytes).map_err(|error| error.to_string())?;
    ask.what.ok_or_else(|| "nothing is asked, or nothing that this service knows".to_owned())
}

/// A client's end.
pub struct Client {
    session: Session,
    endpoint: String,
    key: ServiceKey,
}

impl Client {
    /// Connects to the service at `endpoint`, with the user's own settings. Whether the secret is the right one shows with the first question.
    ///
    /// # Errors
    /// [`ServiceError`] where nobody listens.
    pub fn connect(endpoint: &str, secret: Secret, zenoh_file: Option<&ZenohFile>) -> Result<Self, ServiceError> {
        let key = ServiceKey::new(secret)?;
        Ok(Self { session: session::open_client_with(endpoint, zenoh_file)?, endpoint: endpoint.to_owned(), key })
    }

    /// Asks, and waits for the answer.
    ///
    /// # Errors
    /// [`ServiceError`], also where the service refuses.
    pub fn ask(&self, what: ask::What) -> Result<reply::What, ServiceError> {
        let payload = Ask { what: Some(what) }.encode_to_vec();
        let (sender, answers) = sync_channel(1);
        let asked = self.session.get(self.key.ask()).payload(payload).timeout(PATIENCE).callback(move |reply| {
            let bytes = reply.result().map(|sample| sample.payload().to_bytes().into_owned());
            let _ = sender.try_send(bytes.ok());
        });
        asked.wait().map_err(SessionError::bus("ask"))?;
        let silent = || ServiceError::Silent { endpoint: self.endpoint.clone() };
        let bytes = match answers.recv_timeout(PATIENCE + STALL) {
            Ok(Some(bytes)) => bytes,
            Ok(None) | Err(RecvTimeoutError::Timeout) => return Err(silent()),
            Err(RecvTimeoutError::Disconnected) => return Err(ServiceError::Nobody(self.endpoint.clone())),
        };
        match convert::decode::<Reply>(&bytes)?.what {
            Some(reply::What::Refusal(refusal)) => {
                let text = refusal.text.lines().map(convert::shown).collect::<Vec<_>>().join("\n");
                Err(ServiceError::Refused { code: refusal.code(), text })
            }
            Some(what) => Ok(what),
            None => Err(ServiceError::OtherAnswer),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::proto::service::{AskOffer, AskStatus, Offer, Runs};

    /// A service that offers its own version, and refuses all else.
    fn desk() -> Desk {
        let (desk, asked) = Desk::open("tcp/127.0.0.1:0", Secret::from("sesame"), None).unwrap();
        std::thread::spawn(move || {
            for Asked { what, answer } in asked {
                answer.give(match what {
                    ask::What::Offer(_) => reply::What::Offer(Offer { version: "here".to_owned(), ..Offer::default() }),
                    ask::What::Status(_) => reply::What::Runs(Runs::default()),
                    _ => refused(Code::NotAllowed, "no\u{7}\nhint: none"),
                });
            }
        });
        desk
    }

    #[test]
    fn who_knows_the_secret_is_answered_and_nobody_else() {
        let desk = desk();
        let client = Client::connect(desk.endpoint(), Secret::from("sesame"), None).unwrap();
        let offer = client.ask(ask::What::Offer(AskOffer {})).unwrap();
        assert!(matches!(offer, reply::What::Offer(offer) if offer.version == "here"));
        let refusal = client.ask(ask::What::Close(Default::default())).unwrap_err();
        assert_eq!(refusal.to_string(), "no\\u{7}\nhint: none");
        let stranger = Client::connect(desk.endpoint(), Secret::from("semolina"), None).unwrap();
        let error = stranger.ask(ask::What::Status(AskStatus::default())).unwrap_err();
        assert!(matches!(error, ServiceError::Nobody(_)), "{error}");
        desk.close();
    }

    #[test]
    fn what_is_no_question_is_refused_and_so_is_another_version() {
        let desk = desk();
        let client = Client::connect(desk.endpoint(), Secret::from("sesame"), None).unwrap();
        let raw = |key: &str, bytes: Vec<u8>| {
            let replies = client.session.get(key).payload(bytes).timeout(PATIENCE).wait().unwrap();
            let reply = replies.recv().unwrap().into_result().unwrap();
            match convert::decode::<Reply>(&reply.payload().to_bytes()).unwrap().what {
                Some(reply::What::Refusal(refusal)) => refusal,
                other => panic!("{other:?}"),
            }
        };
        for bytes in [vec![], vec![0xff; 9], vec![0; 70_000], vec![0xfa, 0x01, 0x00]] {
            assert_eq!(raw(&client.key.ask(), bytes).code(), Code::Malformed);
        }
        let refusal = raw("reloop/@service-sesame/7/ask", Vec::new());
        assert!(refusal.text.contains("version 1"), "{}", refusal.text);
        desk.close();
    }
}
