//! Messages in canonical order to the bytes of an episode's MCAP file.

use foxglove::Encode;
use foxglove::messages::log::Level;
use foxglove::messages::{FrameTransforms, Log, SceneUpdate};
use mcap::McapError;
use recording::{METADATA, METADATA_RUN, METADATA_SETTINGS, TOPICS};
use wire::convert::compact;
use wire::keys::Channel;
use wire::proto;

use super::file::{ChannelId, Encoder};
use super::foxglove_messages as show;
use crate::contacts::Contacts;
use crate::message::{Body, CHANNELS, Message, STEP_NANOSECONDS, schema};
use crate::origin::Origin;
use crate::strokes;

/// Writes one episode. Feed it messages in order; drain it with [`EpisodeWriter::take`].
pub struct EpisodeWriter {
    encoder: Encoder,
    /// By the place of the channel in [`CHANNELS`], but for the last.
    own: [ChannelId; CHANNELS.len() - 1],
    /// The last, once there is a message of it: most recordings have none, and the others' numbers stay.
    moves: Option<ChannelId>,
    shown: Shown,
    origin: Origin,
    /// Middle of the AV's box (m): plans and predictions have no height of their own.
    height: f64,
    /// The AV after the last step: no observation follows that would show it.
    last: Option<(u32, proto::AgentState, Option<proto::AgentState>)>,
    contacts: Contacts,
    /// As they were drawn last.
    agents: SceneUpdate,
    scratch: Vec<u8>,
}

/// The channels of Foxglove's messages.
struct Shown {
    map: ChannelId,
    frames: ChannelId,
    av: ChannelId,
    agents: ChannelId,
    signals: ChannelId,
    predictions: ChannelId,
    plan: ChannelId,
    log: ChannelId,
    logged_av: ChannelId,
}

fn add<T: Encode>(encoder: &mut Encoder, topic: &str) -> Result<ChannelId, McapError> {
    let schema = T::get_schema().ok_or_else(|| McapError::UnknownSchema(topic.to_owned(), 0))?;
    encoder.add_channel(topic, &schema.name, &schema.data)
}

fn add_own(encoder: &mut Encoder, channel: Channel) -> Result<ChannelId, McapError> {
    encoder.add_channel(&format!("{TOPICS}{}", channel.name()), schema(channel), wire::FILE_DESCRIPTOR_SET)
}

impl EpisodeWriter {
    /// A file of the run of this name, with these settings (TOML).
    ///
    /// # Errors
    /// [`McapError`].
    pub fn new(run: &str, settings: &str) -> Result<Self, McapError> {
        let mut encoder = Encoder::new()?;
        let version = wire::WIRE_VERSION.to_string();
        let entries = [(METADATA_RUN, run), (METADATA_SETTINGS, settings), ("wire_version", &version)];
        encoder.add_metadata(METADATA, &entries)?;
        let mut own = Vec::with_capacity(CHANNELS.len());
        for channel in CHANNELS.into_iter().filter(|channel| *channel != Channel::Moves) {
            own.push(add_own(&mut encoder, channel)?);
        }
        let own = own.try_into().map_err(|_| McapError::TooManyChannels)?;
        let shown = Shown {
            map: add::<SceneUpdate>(&mut encoder, "/view/map")?,
            frames: add::<FrameTransforms>(&mut encoder, "/tf")?,
            av: add::<SceneUpdate>(&mut encoder, "/view/av")?,
            agents: add::<SceneUpdate>(&mut encoder, "/view/agents")?,
            signals: add::<SceneUpdate>(&mut encoder, "/view/signals")?,
            predictions: add::<SceneUpdate>(&mut encoder, "/view/predictions")?,
            plan: add::<SceneUpdate>(&mut encoder, "/view/plan")?,
            log: add::<Log>(&mut encoder, "/log")?,
            // New ones come last: the numbers of schemas and channels stay.
            logged_av: add::<SceneUpdate>(&mut encoder, "/view/logged_av")?,
        };
        Ok(Self {
            encoder,
            own,
            moves: None,
            shown,
            origin: Origin::default(),
            height: 0.0,
            last: None,
            contacts: Contacts::default(),
            agents: SceneUpdate::default(),
            scratch: Vec::new(),
        })
    }

    /// Writes the next message, and what shows it.
    ///
    /// # Errors
    /// [`McapError`].
    pub fn write(&mut self, message: &Message) -> Result<(), McapError> {
        let channel = message.channel();
        if let Some(place) = CHANNELS.iter().position(|known| *known == channel) {
            let packed = match &message.body {
                Body::Prediction(prediction) => compact::pack(prediction, &message.payload),
                _ => None,
            };
            let payload = packed.as_ref().unwrap_or(&message.payload);
            let id = match (self.own.get(place), self.moves) {
                (Some(own), _) => *own,
                (None, Some(moves)) => moves,
                (None, None) => *self.moves.insert(add_own(&mut self.encoder, channel)?),
            };
            self.encoder.write(id, message.log_time(), payload)?;
        }
        self.show(message)
    }

    /// Bytes for the file: whole records. Nothing while a chunk is open.
    pub fn take(&mut self) -> Vec<u8> {
        self.encoder.take()
    }

    /// Closes the open chunk, so that a file that is left as it is can be read to here.
    ///
    /// # Errors
    /// [`McapError`].
    pub fn close_chunk(&mut self) -> Result<(), McapError> {
        self.encoder.close_chunk()
    }

    /// The last bytes of the file.
    ///
    /// # Errors
    /// [`McapError`].
    pub fn finish(self) -> Result<Vec<u8>, McapError> {
        self.encoder.finish()
    }

    fn show(&mut self, message: &Message) -> Result<(), McapError> {
        let step = message.step();
        match &message.body {
            Body::Scene(scene) => {
                self.origin = Origin::of_scene(scene);
                let map = show::map(scene, &self.origin);
                self.put(self.shown.map, step, &map)
            }
            Body::Observation(observation) => {
                if let Some(av) = &observation.av {
                    self.height = av.z;
                    // The first step begins where the log has the AV; the record before tells the others.
                    let before = self.last.take().filter(|(after, ..)| *after == step);
                    let logged = if step == 0 { Some(*av) } else { before.and_then(|(.., logged)| logged) };
                    self.show_av(step, av, logged)?;
                }
                self.contacts.observe(observation);
                self.show_agents(step, &observation.agents)?;
                let signals = show::signals(observation, &self.origin);
                self.put(self.shown.signals, step, &signals)
            }
            Body::Prediction(prediction) => {
                let predictions = show::predictions(prediction, self.height, &self.origin);
                self.put(self.shown.predictions, step, &predictions)
            }
            Body::Plan(plan) => {
                let plan = show::plan(plan, self.height, &self.origin);
                self.put(self.shown.plan, step, &plan)
            }
            Body::Record(record) => {
                self.last = record.av.map(|av| (step.saturating_add(1), av, record.logged_av));
                Ok(())
            }
            // The observation after it shows where they are.
            Body::Moves(_) => Ok(()),
            Body::Event(event) => {
                let level = if strokes::is_grave(event) { Level::Error } else { Level::Warning };
                self.contacts.happen(event);
                let log = show::log(step, level, event.kind().as_str_name(), event.text.clone());
                self.put(self.shown.log, step, &log)
            }
            Body::End(end) => {
                if let Some((step, av, logged)) = self.last.take() {
                    self.show_av(step, &av, logged)?;
                    if let Some(agents) = self.contacts.last_seen() {
                        self.show_agents(step, &agents)?;
                    }
                }
                let reason = strokes::end_sentence(end);
                let log = show::log(step, Level::Info, "end", reason);
                self.put(self.shown.log, step, &log)
            }
        }
    }

    fn show_agents(&mut self, step: u32, agents: &[proto::Agent]) -> Result<(), McapError> {
        show::agents(&mut self.agents, step, agents, &self.contacts, &self.origin);
        put(&mut self.encoder, &mut self.scratch, self.shown.agents, step, &self.agents)
    }

    fn show_av(
        &mut self,
        step: u32,
        av: &proto::AgentState,
        logged: Option<proto::AgentState>,
    ) -> Result<(), McapError> {
        let logged = show::logged_av(step, logged.as_ref(), &self.origin);
        self.put(self.shown.logged_av, step, &logged)?;
        let frames = show::frames(step, av, &self.origin);
        self.put(self.shown.frames, step, &frames)?;
        let av = show::av(step, av, &self.origin);
        self.put(self.shown.av, step, &av)
    }

    fn put(&mut self, channel: ChannelId, step: u32, message: &impl prost::Message) -> Result<(), McapError> {
        put(&mut self.encoder, &mut self.scratch, channel, step, message)
    }
}

fn put(
    encoder: &mut Encoder,
    scratch: &mut Vec<u8>,
    channel: ChannelId,
    step: u32,
    message: &impl prost::Message,
) -> Result<(), McapError> {
    scratch.clear();
    message.encode_raw(scratch);
    encoder.write(channel, u64::from(step) * STEP_NANOSECONDS, scratch)
}
