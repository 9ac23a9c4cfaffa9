//! Recordings that are damaged with knowledge of how they are made: what a fuzzer that flips bits would take days to come upon.

use crate::records::{Chunk, Footer, Frame, HEADER_BYTES, MAGIC, op};

/// Numbers that come out the same for a seed (SplitMix64).
#[derive(Clone, Debug)]
pub struct Dice(pub u64);

impl Dice {
    /// The next number.
    pub fn roll(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        mixed ^ (mixed >> 31)
    }

    /// A number below `end`, or 0.
    pub fn below(&mut self, end: usize) -> usize {
        (self.roll() % end.max(1) as u64) as usize
    }

    /// A number that readers stumble over, perhaps near `there`.
    fn number(&mut self, there: u64) -> u64 {
        const LIKED: [u64; 12] =
            [0, 1, 8, 255, 65_535, 1 << 16, 1 << 24, 1 << 31, u32::MAX as u64, 1 << 32, 1 << 63, u64::MAX];
        match self.below(4) {
            0 => LIKED[self.below(LIKED.len())],
            1 => there.wrapping_add(self.roll() % 17).wrapping_sub(8),
            2 => self.roll() % there.saturating_mul(2).max(1),
            _ => self.roll() >> self.below(64),
        }
    }

    fn opcode(&mut self) -> u8 {
        if self.below(4) == 0 { self.roll() as u8 } else { self.below(17) as u8 }
    }
}

/// A damaged copy of a whole recording, the same for the same dice.
#[must_use]
pub fn mutant(whole: &[u8], dice: &mut Dice) -> Vec<u8> {
    let mut bytes = whole.to_vec();
    for _ in 0..=dice.below(3) {
        damage(&mut bytes, dice);
    }
    bytes
}

/// Where the records of `bytes` begin and end, from `start` on.
fn records(bytes: &[u8], start: usize) -> Vec<(usize, usize)> {
    let (mut at, mut found) = (start, Vec::new());
    while let Some(frame) = Frame::at(bytes, at) {
        found.push((at, frame.end(at)));
        at = frame.end(at);
    }
    found
}

fn damage(bytes: &mut Vec<u8>, dice: &mut Dice) {
    let found = records(bytes, MAGIC.len());
    if found.is_empty() {
        return;
    }
    match dice.below(8) {
        0 => shuffle(bytes, &found, dice),
        1 => {
            let end = dice.below(bytes.len());
            bytes.truncate(end);
        }
        2 => scratch(bytes, dice),
        3 => refoot(bytes, dice),
        4 => {
            let (at, _) = found[dice.below(found.len())];
            reframe(bytes, at, dice);
        }
        way => {
            let chunks: Vec<_> = found.iter().filter(|(at, _)| bytes[*at] == op::CHUNK).collect();
            let Some((at, end)) = chunks.get(dice.below(chunks.len())) else { return scratch(bytes, dice) };
            if way == 5 { rechunk(bytes, *at, dice) } else { repack(bytes, *at, *end, dice) }
        }
    }
}

/// Moves, doubles or drops records.
fn shuffle(bytes: &mut Vec<u8>, found: &[(usize, usize)], dice: &mut Dice) {
    let (from, end) = found[dice.below(found.len())];
    let (to, _) = found[dice.below(found.len())];
    let record = bytes[from..end].to_vec();
    let inserted = |bytes: &mut Vec<u8>| drop(bytes.splice(to..to, record.iter().copied()));
    match dice.below(3) {
        0 => inserted(bytes),
        1 => drop(bytes.drain(from..end)),
        _ if from < to => {
            inserted(bytes);
            bytes.drain(from..end);
        }
        _ => {
            bytes.drain(from..end);
            inserted(bytes);
        }
    }
}

/// Changes, inserts or drops bytes anywhere.
fn scratch(bytes: &mut Vec<u8>, dice: &mut Dice) {
    let at = dice.below(bytes.len());
    let end = (at + 1 + dice.below(32)).min(bytes.len());
    match dice.below(3) {
        0 => bytes.iter_mut().skip(at).take(1).for_each(|byte| *byte ^= 1 << dice.below(8)),
        1 => drop(bytes.drain(at..end)),
        _ => {
            let noise: Vec<u8> = (at..end).map(|_| dice.roll() as u8).collect();
            bytes.splice(at..at, noise);
        }
    }
}

/// Gives a record another length or opcode.
fn reframe(bytes: &mut [u8], at: usize, dice: &mut Dice) {
    if dice.below(3) == 0 {
        bytes[at] = dice.opcode();
    } else {
        renumber::<8>(bytes, at + 1, dice);
    }
}

/// Gives a chunk's header other sizes, checksum or compression.
fn rechunk(bytes: &mut [u8], at: usize, dice: &mut Dice) {
    let body = at + HEADER_BYTES;
    match dice.below(5) {
        0 => renumber::<8>(bytes, body + 16, dice),
        1 => renumber::<4>(bytes, body + 24, dice),
        2 => renumber::<4>(bytes, body + 28, dice),
        3 => renumber::<8>(bytes, body + 36, dice),
        _ => bytes.iter_mut().skip(body + 32).take(4).for_each(|byte| *byte = dice.roll() as u8),
    }
}

/// Damages a chunk's records, and packs them again with the right size and checksum.
fn repack(bytes: &mut Vec<u8>, at: usize, end: usize, dice: &mut Dice) {
    let Some(chunk) = Frame::at(bytes, at).and_then(|frame| Chunk::of(frame.body)) else { return };
    let limit = usize::try_from(chunk.size).unwrap_or_default().min(1 << 24);
    let unpacked = if chunk.compression.is_empty() {
        Ok(chunk.packed.to_vec())
    } else {
        zstd::bulk::decompress(chunk.packed, limit)
    };
    let Ok(mut unpacked) = unpacked else { return };
    let found = records(&unpacked, 0);
    if found.is_empty() {
        return;
    }
    let (record, record_end) = found[dice.below(found.len())];
    match dice.below(5) {
        0 => shuffle(&mut unpacked, &found, dice),
        1 => reframe(&mut unpacked, record, dice),
        2 => scratch(&mut unpacked, dice),
        // Channel, sequence, times; then what is said, which lists and lengths begin.
        3 => renumber::<2>(&mut unpacked, record + HEADER_BYTES, dice),
        _ => {
            let place = record + HEADER_BYTES + dice.below(record_end - record - HEADER_BYTES);
            unpacked.iter_mut().skip(place).take(1 + dice.below(3)).for_each(|byte| *byte = dice.roll() as u8);
        }
    }
    let stored = dice.below(2) == 0;
    let packed = if stored { Ok(unpacked.clone()) } else { zstd::bulk::compress(&unpacked, 1) };
    let Ok(mut packed) = packed else { return };
    if dice.below(8) == 0 {
        scratch(&mut packed, dice);
    }
    let compression: &[u8] = if stored { b"" } else { b"zstd" };
    let mut body = vec![0; 16];
    body.extend((unpacked.len() as u64).to_le_bytes());
    body.extend(crc32fast::hash(&unpacked).to_le_bytes());
    body.extend((compression.len() as u32).to_le_bytes());
    body.extend(compression);
    body.extend((packed.len() as u64).to_le_bytes());
    body.extend(packed);
    let mut whole = vec![op::CHUNK];
    whole.extend((body.len() as u64).to_le_bytes());
    whole.extend(body);
    bytes.splice(at..end, whole);
}

/// Changes what the footer says, or the summary, perhaps with the right checksum.
fn refoot(bytes: &mut [u8], dice: &mut Dice) {
    let Some(footer) = Footer::find(bytes) else { return };
    let body = footer.at + HEADER_BYTES;
    match dice.below(4) {
        0 => renumber::<8>(bytes, body, dice),
        1 => renumber::<8>(bytes, body + 8, dice),
        2 => renumber::<4>(bytes, body + 16, dice),
        _ => {
            let length = footer.summary(bytes).len();
            let place = footer.at - length + dice.below(length);
            bytes[place] = dice.roll() as u8;
        }
    }
    if dice.below(2) == 0
        && let Some(crc) = Footer::find(bytes).and_then(|footer| footer.found_crc(bytes))
    {
        bytes[body + 16..body + 20].copy_from_slice(&crc.to_le_bytes());
    }
}

/// Writes another number in the place of that of `N` bytes.
fn renumber<const N: usize>(bytes: &mut [u8], at: usize, dice: &mut Dice) {
    let Some(field) = bytes.get_mut(at..at + N) else { return };
    let mut there = [0; 8];
    there[..N].copy_from_slice(field);
    field.copy_from_slice(&dice.number(u64::from_le_bytes(there)).to_le_bytes()[..N]);
}
