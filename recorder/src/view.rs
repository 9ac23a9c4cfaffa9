//! The live view: hears what the simulator tells of a run, and draws it into a Rerun viewer while it is driven.
//!
//! ```text
//! transport ──▶ messages (bounded) ──▶ drawer ──▶ pieces (bounded) ──▶ writer ──▶ `rerun -`
//! ```
//!
//! The drives come first. What finds no room on the way is left out and counted: the transport never waits for the drawer, the drawer never for the
//! viewer, and nobody for a viewer that takes nothing when the run is over.

use std::collections::{BTreeMap, BTreeSet};
use std::io::Write as _;
use std::os::unix::process::CommandExt as _;
use std::process::{ChildStdin, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread;
use std::time::{Duration, Instant};

use thiserror::Error;
use wire::keys::{Address, Channel, Worker};
use wire::node::{Connection, NodeError, Options, Stop, Voice};
use world::scene::SceneId;

use crate::message::{CHANNELS, Message};
use crate::rrd::{Live, RrdError};

/// The viewer, as `pip install rerun-sdk` brings it.
const VIEWER: &str = "rerun";

/// What the viewer keeps at most: then it drops what is oldest.
const VIEWER_MEMORY: &str = "2GB";

/// Bytes that may wait for the drawer, and as many for the viewer.
const WAITING: usize = 64 << 20;

/// Messages that may wait for the drawer, and pieces for the viewer: however small they are.
const MESSAGES: usize = 1 << 16;
const PIECES: usize = 4096;

/// An episode is drawn on after so many of its messages, or so long.
const TOGETHER: usize = 40;
const OFTEN: Duration = Duration::from_millis(100);

/// Episodes that may be on at once. An honest run has one for each worker.
const OPEN: usize = 256;

/// When the run is over, the rest is awaited for so long.
const LULL: Duration = Duration::from_millis(300);
/// And the viewer for so long.
const LEAVING: Duration = Duration::from_secs(2);

/// Why nothing is to be seen.
#[derive(Debug, Error)]
pub enum ViewError {
    /// The run cannot be joined.
    #[error(transparent)]
    Node(#[from] NodeError),
    /// There is no viewer.
    #[error("no viewer: `{VIEWER}` cannot be started: {0}\nhint: pip install rerun-sdk==0.36.3 puts it on the PATH")]
    Viewer(std::io::Error),
}

/// Room for so many bytes as may wait.
#[derive(Debug, Default)]
struct Room(AtomicUsize);

impl Room {
    /// Whether there is room for `bytes`; then they have it.
    fn take(&self, bytes: usize) -> bool {
        let fits = self.0.load(Ordering::Relaxed) + bytes <= WAITING;
        if fits {
            self.0.fetch_add(bytes, Ordering::Relaxed);
        }
        fits
    }

    fn give_back(&self, bytes: usize) {
        self.0.fetch_sub(bytes, Ordering::Relaxed);
    }
}

/// What was not shown.
#[derive(Debug, Default)]
struct LeftOut {
    messages: AtomicUsize,
    pieces: AtomicUsize,
    /// The viewer is gone: nothing more is for anybody to see.
    is_gone: AtomicBool,
}

/// Shows a run until it ends, or the viewer does. A viewer of this machine that runs already shows it, else one is started, which stays.
///
/// # Errors
/// [`ViewError`] where nothing can be shown.
pub fn view(options: &Options) -> Result<Stop, ViewError> {
    // Everybody may look on; a secret is for who sits at a seat.
    let connection = Connection::open(&Options { secret: None, ..options.clone() })?;
    let info = connection.run_info()?;
    let mut viewer = Command::new(VIEWER);
    viewer.args(["--bind", "127.0.0.1", "--memory-limit", VIEWER_MEMORY, "-"]);
    // It says much that is of no concern here. And it stays when this program, or all of its group, is ended.
    viewer.env("RUST_LOG", "error").stdin(Stdio::piped()).stdout(Stdio::null()).process_group(0);
    let mut viewer = viewer.spawn().map_err(ViewError::Viewer)?;
    let left_out = Arc::new(LeftOut::default());
    let (waiting, unread) = (Arc::new(Room::default()), Arc::new(Room::default()));
    let (pieces, written) = sync_channel(PIECES);
    let (done, is_done) = sync_channel(1);
    if let Some(stdin) = viewer.stdin.take() {
        let (waiting, left_out) = (Arc::clone(&waiting), Arc::clone(&left_out));
        thread::spawn(move || {
            write(stdin, &written, &waiting, &left_out.is_gone);
            let _ = done.try_send(());
        });
    }
    let (messages, heard) = sync_channel(MESSAGES);
    let drawer = Drawer {
        run: options.run.to_string(),
        settings: info.settings,
        voice: connection.voice(),
        open: BTreeMap::new(),
        passed_over: BTreeSet::new(),
        has_layout: false,
        unread: Arc::clone(&unread),
        outlet: Outlet { pieces, waiting, left_out: Arc::clone(&left_out) },
    };
    let drawing = thread::spawn(move || drawer.draw(&heard));
    let (door, lost) = (messages, Arc::clone(&left_out));
    connection.subscribe(&CHANNELS, move |address, payload| {
        if lost.is_gone.load(Ordering::Relaxed) {
            return;
        }
        let bytes = payload.len();
        let has_room = unread.take(bytes);
        if has_room && door.try_send((address, payload.to_bytes().into_owned())).is_ok() {
            return;
        }
        if has_room {
            unread.give_back(bytes);
        }
        lost.messages.fetch_add(1, Ordering::Relaxed);
    })?;
    let stop = connection.stay(LULL)?;
    // The connection is closed, and with it the door: what was heard is drawn and written, as far as the viewer takes it.
    let until = Instant::now() + LEAVING;
    while !drawing.is_finished() && Instant::now() < until {
        thread::sleep(Duration::from_millis(5));
    }
    if is_done.recv_timeout(until.saturating_duration_since(Instant::now())).is_err() {
        tracing::warn!("the viewer takes nothing any more, and is left alone");
    }
    let [messages, pieces] = [&left_out.messages, &left_out.pieces].map(|count| count.load(Ordering::Relaxed));
    if messages + pieces > 0 && !left_out.is_gone.load(Ordering::Relaxed) {
        tracing::warn!(
            "the view was slower than the run: {messages} messages and {pieces} pieces of the drawing were left out; recordings hold all"
        );
    }
    Ok(stop)
}

/// Writes pieces into the viewer until there are no more, or the viewer is gone.
fn write(mut viewer: ChildStdin, pieces: &Receiver<Vec<u8>>, waiting: &Room, is_gone: &AtomicBool) {
    for piece in pieces {
        let written = viewer.write_all(&piece).and_then(|()| viewer.flush());
        waiting.give_back(piece.len());
        if let Err(error) = written {
            is_gone.store(true, Ordering::Relaxed);
            tracing::warn!("the viewer is gone, and the run goes on without it: {error}");
            return;
        }
    }
}

/// The way to the viewer.
struct Outlet {
    pieces: SyncSender<Vec<u8>>,
    waiting: Arc<Room>,
    left_out: Arc<LeftOut>,
}

impl Outlet {
    /// Whether the piece is on its way.
    fn give(&self, piece: Vec<u8>) -> bool {
        let bytes = piece.len();
        let has_room = self.waiting.take(bytes);
        if has_room && self.pieces.try_send(piece).is_ok() {
            return true;
        }
        if has_room {
            self.waiting.give_back(bytes);
        }
        self.left_out.pieces.fetch_add(1, Ordering::Relaxed);
        false
    }
}

type Place = (Worker, SceneId);

/// Draws what is heard.
struct Drawer {
    run: String,
    settings: String,
    voice: Voice,
    open: BTreeMap<Place, Live>,
    /// Episodes whose beginning is not to be had, until their end.
    passed_over: BTreeSet<Place>,
    /// The layout is with the viewer.
    has_layout: bool,
    /// Of what is heard, the room that it had.
    unread: Arc<Room>,
    outlet: Outlet,
}

impl Drawer {
    fn draw(mut self, heard: &Receiver<(Address, Vec<u8>)>) {
        let mut due = Instant::now() + OFTEN;
        loop {
            match heard.recv_timeout(due.saturating_duration_since(Instant::now())) {
                Ok((address, payload)) => self.take(address, payload),
                Err(RecvTimeoutError::Timeout) => {
                    self.open.values_mut().for_each(|live| show(live, &self.outlet));
                    due = Instant::now() + OFTEN;
                }
                Err(RecvTimeoutError::Disconnected) => {
                    self.open.values_mut().for_each(|live| show(live, &self.outlet));
                    return;
                }
            }
        }
    }

    fn take(&mut self, address: Address, payload: Vec<u8>) {
        self.unread.give_back(payload.len());
        let Address { worker, scene, channel } = address;
        let message = match Message::decode(channel, payload) {
            Ok(message) => message,
            Err(error) => return tracing::warn!("episode {scene}: {error}; ignored"),
        };
        let place = (worker, scene);
        match channel {
            Channel::Scene => self.begin(place, &message),
            Channel::End => {
                if let Some(mut live) = self.open.remove(&place) {
                    live.push(&message);
                    show(&mut live, &self.outlet);
                }
                self.passed_over.remove(&place);
            }
            _ => self.go_on(place, &message),
        }
    }

    /// A viewer that comes when an episode is on asks for its scene, once.
    fn go_on(&mut self, place: Place, message: &Message) {
        if !self.open.contains_key(&place) {
            if self.passed_over.contains(&place) {
                return;
            }
            let (worker, scene) = place.clone();
            let scene = self.voice.ask(&Address { worker, scene, channel: Channel::Scene }, LULL);
            match scene.and_then(|payload| Message::decode(Channel::Scene, payload).ok()) {
                Some(scene) => self.begin(place.clone(), &scene),
                None => drop(self.passed_over.insert(place.clone())),
            }
        }
        if let Some(live) = self.open.get_mut(&place)
            && live.push(message) >= TOGETHER
        {
            show(live, &self.outlet);
        }
    }

    fn begin(&mut self, place: Place, scene: &Message) {
        if self.open.len() + self.passed_over.len() >= OPEN {
            return tracing::warn!("{OPEN} episodes are open: one more, {}, is not shown", place.1);
        }
        let (live, piece) = match Live::begin(scene, &self.run, &self.settings, !self.has_layout) {
            Ok(Some(begun)) => begun,
            Ok(None) => return,
            Err(error) => return not_drawn(&error),
        };
        // Without its beginning the rest is of no use.
        if self.outlet.give(piece) {
            self.has_layout = true;
            self.passed_over.remove(&place);
            self.open.insert(place, live);
        } else {
            self.passed_over.insert(place);
        }
    }
}

fn show(live: &mut Live, outlet: &Outlet) {
    match live.piece() {
        Ok(Some(piece)) => drop(outlet.give(piece)),
        Ok(None) => {}
        Err(error) => not_drawn(&error),
    }
}

fn not_drawn(error: &RrdError) {
    tracing::error!("a piece cannot be drawn: {error}");
}
