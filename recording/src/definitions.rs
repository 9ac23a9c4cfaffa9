//! Schemas and channels by their numbers.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;

use crate::damage::Fault;
use crate::fields::Fields;
use crate::records::{Frame, op};

/// The longest name of a topic or a schema (bytes).
const NAME_LIMIT: usize = 1 << 10;

/// A channel of a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Channel {
    /// What it is about, like `/reloop/plan`.
    pub topic: String,
    /// Its messages' full name; empty where nothing tells.
    pub schema: String,
}

/// What a file's schemas and channels are.
#[derive(Debug, Default)]
pub struct Definitions {
    schemas: BTreeMap<u16, String>,
    channels: BTreeMap<u16, Channel>,
    /// The summary's, in case that those among the data are lost.
    spare: BTreeMap<u16, Channel>,
}

impl Definitions {
    /// Those that a file's summary repeats, until the data has its own. What is wrong among them is left out.
    #[must_use]
    pub fn of_summary(records: &[u8]) -> Self {
        let (mut definitions, mut at) = (Self::default(), 0);
        while let Some(frame) = Frame::at(records, at) {
            let _ = definitions.take(frame);
            at = frame.end(at);
        }
        Self { spare: definitions.channels, ..Self::default() }
    }

    /// A channel by its number.
    #[must_use]
    pub fn channel(&self, id: u16) -> Option<&Channel> {
        self.channels.get(&id).or_else(|| self.spare.get(&id))
    }

    /// Takes a schema or a channel; other records are nothing to it. The channel's number, if it is a new one.
    ///
    /// # Errors
    /// What is wrong with the record. What was known before stays.
    pub fn take(&mut self, frame: Frame<'_>) -> Result<Option<u16>, Fault> {
        let mut fields = Fields(frame.body);
        match frame.opcode {
            op::SCHEMA => {
                let read = |fields: &mut Fields<'_>| Some((fields.u16()?, name(fields)?));
                let (id, name) = read(&mut fields).ok_or(Fault::Fields { opcode: op::SCHEMA })?;
                self.schemas.entry(id).or_insert(name);
                Ok(None)
            }
            op::CHANNEL => {
                let read = |fields: &mut Fields<'_>| Some((fields.u16()?, fields.u16()?, name(fields)?));
                let (id, schema, topic) = read(&mut fields).ok_or(Fault::Fields { opcode: op::CHANNEL })?;
                let schema = self.schemas.get(&schema).cloned().unwrap_or_default();
                let channel = Channel { topic, schema };
                match self.channels.entry(id) {
                    Entry::Vacant(entry) => {
                        entry.insert(channel);
                        Ok(Some(id))
                    }
                    Entry::Occupied(entry) if *entry.get() == channel => Ok(None),
                    Entry::Occupied(_) => Err(Fault::TwoChannels(id)),
                }
            }
            _ => Ok(None),
        }
    }
}

fn name(fields: &mut Fields<'_>) -> Option<String> {
    fields.text().filter(|name| name.len() <= NAME_LIMIT).map(str::to_owned)
}
