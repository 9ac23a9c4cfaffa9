//! The beginning of a file of windows: what it holds, and where.
//!
//! ```text
//! magic, version, length of the rest of the head, its CRC-32
//!   settings (TOML)
//!   scenes:  id, SHA-256 of the record, role, windows that were skipped and why
//!   windows: scene, step, AV, offset in the file, length, CRC-32
//! the windows, one after another
//! ```

use std::collections::BTreeMap;

use super::bytes::{Reader, Writer};
use super::error::FileProblem;
use super::split::Role;

const MAGIC: [u8; 8] = *b"windows\n";
const VERSION: u32 = 1;
/// Bytes before the rest of the head.
pub(super) const PREFIX: usize = 8 + 4 + 4 + 4;

/// What a file holds.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Head {
    pub settings: String,
    pub scenes: Vec<SceneRecord>,
    pub places: Vec<Place>,
}

/// A scene that was cut.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SceneRecord {
    /// Its id.
    pub id: String,
    /// SHA-256 of its record, in hex.
    pub sha256: String,
    /// What it is for.
    pub role: Role,
    /// Windows that it does not give.
    pub skipped: Vec<Skipped>,
}

/// Windows that are not there.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Skipped {
    /// Why.
    pub reason: String,
    /// How many.
    pub windows: u32,
}

/// Where a window lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Place {
    /// Number of its scene.
    pub scene: u32,
    pub step: u32,
    pub av: i32,
    pub offset: u64,
    pub length: u32,
    pub checksum: u32,
}

/// Bytes of a [`Place`].
const PLACE: usize = 4 + 4 + 4 + 8 + 4 + 4;
/// Bytes of a [`SceneRecord`] at least.
const SCENE: usize = 4 + 4 + 1 + 4;
/// Bytes of a [`Skipped`] at least.
const SKIPPED: usize = 4 + 4;
/// Longest text in a head, but for the settings.
const MOST_TEXT: usize = 1000;
const MOST_SETTINGS: usize = 100_000;

impl Head {
    /// Sets the windows' offsets: one after another behind the head, whose length does not depend on them.
    pub fn lay_out(&mut self) {
        let mut offset = self.write().len() as u64;
        for place in &mut self.places {
            place.offset = offset;
            offset += u64::from(place.length);
        }
    }

    /// As it is written.
    pub fn write(&self) -> Vec<u8> {
        let mut rest = Writer::default();
        rest.text(&self.settings);
        rest.u32(self.scenes.len() as u32);
        for scene in &self.scenes {
            rest.text(&scene.id);
            rest.text(&scene.sha256);
            rest.u8(u8::from(scene.role == Role::Validation));
            rest.u32(scene.skipped.len() as u32);
            for Skipped { reason, windows } in &scene.skipped {
                rest.text(reason);
                rest.u32(*windows);
            }
        }
        rest.u32(self.places.len() as u32);
        for place in &self.places {
            rest.u32(place.scene);
            rest.u32(place.step);
            rest.i32(place.av);
            rest.u64(place.offset);
            rest.u32(place.length);
            rest.u32(place.checksum);
        }
        let mut out = Writer(MAGIC.to_vec());
        out.u32(VERSION);
        out.u32(rest.0.len() as u32);
        out.u32(crc32fast::hash(&rest.0));
        out.0.extend(rest.0);
        out.0
    }

    /// Length and checksum of the rest of the head, by its first bytes.
    ///
    /// # Errors
    /// [`FileProblem`] where it is no head, or one of another version.
    pub fn prefix(start: &[u8]) -> Result<(usize, u32), FileProblem> {
        let mut from = Reader(start);
        if from.array::<8>() != Ok(MAGIC) {
            return Err(FileProblem::Foreign);
        }
        let found = from.u32()?;
        if found != VERSION {
            return Err(FileProblem::Version { found, known: VERSION });
        }
        Ok((from.u32()? as usize, from.u32()?))
    }

    /// The head whose bytes after the first are `rest`, of a file of `size` bytes.
    ///
    /// # Errors
    /// [`FileProblem`] where it is not what it was, or says what cannot be.
    pub fn parse(rest: &[u8], checksum: u32, size: u64) -> Result<Self, FileProblem> {
        if crc32fast::hash(rest) != checksum {
            return Err(FileProblem::Checksum);
        }
        let mut from = Reader(rest);
        let settings = from.text(MOST_SETTINGS)?;
        let mut scenes = Vec::new();
        let mut known = BTreeMap::new();
        for number in 0..from.count(SCENE)? {
            let scene = scene(&mut from)?;
            if known.insert(scene.id.clone(), number).is_some() {
                return Err(FileProblem::Impossible("a scene twice"));
            }
            scenes.push(scene);
        }
        let mut end = (PREFIX + rest.len()) as u64;
        let mut places = Vec::new();
        for _ in 0..from.count(PLACE)? {
            let place = Place {
                scene: from.u32()?,
                step: from.u32()?,
                av: from.i32()?,
                offset: from.u64()?,
                length: from.u32()?,
                checksum: from.u32()?,
            };
            if place.scene as usize >= scenes.len() {
                return Err(FileProblem::Impossible("a window without its scene"));
            }
            if place.offset != end {
                return Err(FileProblem::Impossible("a window in another place than behind the one before"));
            }
            end = place.offset.checked_add(u64::from(place.length)).ok_or(FileProblem::CutShort)?;
            places.push(place);
        }
        from.end()?;
        if end > size {
            return Err(FileProblem::CutShort);
        }
        if end < size {
            return Err(FileProblem::Impossible("more bytes than it says"));
        }
        Ok(Self { settings, scenes, places })
    }
}

fn scene(from: &mut Reader<'_>) -> Result<SceneRecord, FileProblem> {
    let (id, sha256) = (from.text(MOST_TEXT)?, from.text(MOST_TEXT)?);
    let role = match from.u8()? {
        0 => Role::Training,
        1 => Role::Validation,
        _ => return Err(FileProblem::Impossible("a scene of another role")),
    };
    let count = from.count(SKIPPED)?;
    let skipped = (0..count).map(|_| Ok(Skipped { reason: from.text(MOST_TEXT)?, windows: from.u32()? }));
    Ok(SceneRecord { id, sha256, role, skipped: skipped.collect::<Result<_, FileProblem>>()? })
}

/// See [`super::with_right_checksums`].
pub(super) fn with_right_checksums(bytes: &[u8]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    let Ok((length, _)) = Head::prefix(&bytes) else { return bytes };
    let Some(rest) = bytes.get(PREFIX..).and_then(|rest| rest.get(..length)) else { return bytes };
    let checksum = crc32fast::hash(rest);
    let head = Head::parse(rest, checksum, bytes.len() as u64);
    let rest = head.map_or_else(
        |_| rest.to_vec(),
        |mut head| {
            for place in &mut head.places {
                // Within the file, by its head.
                let payload = bytes.get(place.offset as usize..).and_then(|from| from.get(..place.length as usize));
                place.checksum = crc32fast::hash(payload.unwrap_or_default());
            }
            head.write()[PREFIX..].to_vec()
        },
    );
    bytes[PREFIX - 4..PREFIX].copy_from_slice(&crc32fast::hash(&rest).to_le_bytes());
    bytes[PREFIX..PREFIX + length].copy_from_slice(&rest);
    bytes
}
