//! The id of a payload's scene by stepping over its fields, so that most of it need not be read. No IO.
//!
//! WOMD's own files, and whatever writes fields by their numbers, have the id behind the tracks: somewhere in the middle.

use world::scene::SceneId;

use super::read::{ID, TIMES, TRACKS};
use crate::tf_example::{self, Entry};
use crate::wire::varint;

/// Looks for the id. Give [`Skim::take`] bytes of the payload from [`Skim::offset`] on, until it tells.
#[derive(Debug)]
pub struct Skim {
    offset: u64,
    bytes: u64,
    id: Option<SceneId>,
    /// A field was there that only scenes have.
    is_scene: bool,
    /// It is of the data set's other format: fields are the entries of a list.
    is_example: bool,
}

/// How far skimming is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Skimmed {
    /// It goes on.
    More,
    /// The id, of what is a scene by its fields so far. If a second id follows, loading will say so.
    Id(SceneId),
    /// Only the whole payload can tell: see [`super::scene_id`].
    Untold,
}

impl Skim {
    /// Begins with a payload of so many bytes.
    #[must_use]
    pub fn new(bytes: u64) -> Self {
        Self { offset: 0, bytes, id: None, is_scene: false, is_example: false }
    }

    /// The place in the payload of the bytes that are wanted next.
    #[must_use]
    pub fn offset(&self) -> u64 {
        self.offset
    }

    /// Takes in bytes of the payload from [`Skim::offset`] on: 150 at least, or all to its end. Whatever lies beyond its end is passed over.
    pub fn take(&mut self, stretch: &[u8]) -> Skimmed {
        let begin = self.offset;
        if begin == 0 && tf_example::looks_like_example(stretch) {
            self.is_example = true;
            let entries = tf_example::entries(stretch).filter(|(length, _)| *length <= self.bytes);
            let Some((length, rest)) = entries else { return Skimmed::Untold };
            self.offset = (stretch.len() - rest.len()) as u64;
            self.bytes = self.bytes.min(self.offset.saturating_add(length));
        }
        loop {
            let rest = usize::try_from(self.offset - begin).ok().and_then(|taken| stretch.get(taken..));
            let left = usize::try_from(self.bytes - self.offset).unwrap_or(usize::MAX);
            match rest.and_then(|rest| self.step(&rest[..rest.len().min(left)])) {
                Some(()) => {}
                // The next field begins beyond the stretch, or is cut by its end.
                None if self.offset > begin && self.offset < self.bytes => return Skimmed::More,
                None => return Skimmed::Untold,
            }
            if let (Some(id), true) = (&self.id, self.is_scene) {
                return Skimmed::Id(id.clone());
            }
        }
    }

    /// Steps over the field that `rest` begins with; none where it is not whole, or not one that can be stepped over.
    fn step(&mut self, rest: &[u8]) -> Option<()> {
        if self.is_example {
            return self.step_over_entry(rest);
        }
        let mut after = rest;
        let key = varint(&mut after)?;
        let length = match key & 7 {
            0 => varint(&mut after).map(|_| 0)?,
            1 => 8,
            2 => varint(&mut after)?,
            5 => 4,
            _ => return None,
        };
        match key >> 3 {
            TIMES | TRACKS => self.is_scene = true,
            ID if key & 7 == 2 => {
                let id = after.get(..usize::try_from(length).ok()?)?;
                let id = SceneId::new(String::from_utf8_lossy(id)).ok()?;
                if self.id.get_or_insert_with(|| id.clone()) != &id {
                    return None;
                }
            }
            _ => {}
        }
        let next = (self.offset + (rest.len() - after.len()) as u64).checked_add(length)?;
        self.offset = Some(next).filter(|next| *next <= self.bytes)?;
        Some(())
    }

    /// The same of an entry, whose name comes first: of most of them no more is looked at.
    fn step_over_entry(&mut self, rest: &[u8]) -> Option<()> {
        let entry = Entry::of(rest)?;
        if entry.name == tf_example::ID.as_bytes() {
            self.id = Some(SceneId::new(String::from_utf8_lossy(entry.text()?)).ok()?);
            self.is_scene = true;
        }
        self.offset = Some(self.offset.checked_add(entry.bytes)?).filter(|next| *next <= self.bytes)?;
        Some(())
    }
}
