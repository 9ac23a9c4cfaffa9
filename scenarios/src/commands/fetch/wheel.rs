//! A file of a zip archive, as Python's packages are. The crates for zip bring writing, encryption and many ways of packing; the one way
//! that is met with here is a call of what unpacks scene files anyway.

use thiserror::Error;

/// Why a file cannot be had of an archive.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum WheelError {
    /// It has no list of files.
    #[error("it is no zip archive, or cut off")]
    NoArchive,
    /// It has no such file.
    #[error("it has no file {0}")]
    Missing(String),
    /// The file is damaged, or packed in another way.
    #[error("its file {0} is damaged")]
    Damaged(String),
}

/// The largest file that is unpacked (bytes).
const MOST_BYTES: usize = 64 << 20;

/// The file called `name` in the archive `zip`.
pub fn member(zip: &[u8], name: &str) -> Result<Vec<u8>, WheelError> {
    let entry = Listed::find(zip, name).ok_or(WheelError::NoArchive)?;
    let entry = entry.ok_or_else(|| WheelError::Missing(name.to_owned()))?;
    entry.unpack(zip).ok_or_else(|| WheelError::Damaged(name.to_owned()))
}

/// A file as the archive's list has it.
struct Listed {
    method: usize,
    crc: usize,
    packed: usize,
    unpacked: usize,
    offset: usize,
}

impl Listed {
    /// The file of this name, or none; nothing where there is no list.
    fn find(zip: &[u8], name: &str) -> Option<Option<Self>> {
        let end = zip.windows(4).rposition(|window| window == b"PK\x05\x06")?;
        let (count, mut at) = (number(zip, end + 10, 2)?, number(zip, end + 16, 4)?);
        for _ in 0..count {
            if zip.get(at..at.checked_add(4)?)? != b"PK\x01\x02" {
                return None;
            }
            let [of_name, of_extra, of_comment] = [28, 30, 32].map(|place| number(zip, at + place, 2));
            let named = zip.get(at + 46..at + 46 + of_name?)?;
            if named == name.as_bytes() {
                return Some(Some(Self {
                    method: number(zip, at + 10, 2)?,
                    crc: number(zip, at + 16, 4)?,
                    packed: number(zip, at + 20, 4)?,
                    unpacked: number(zip, at + 24, 4)?,
                    offset: number(zip, at + 42, 4)?,
                }));
            }
            at += 46 + of_name? + of_extra? + of_comment?;
        }
        Some(None)
    }

    fn unpack(&self, zip: &[u8]) -> Option<Vec<u8>> {
        let begin = self.offset + 30 + number(zip, self.offset + 26, 2)? + number(zip, self.offset + 28, 2)?;
        let packed = zip.get(begin..begin.checked_add(self.packed)?)?;
        let bytes = match self.method {
            0 => packed.to_vec(),
            8 => miniz_oxide::inflate::decompress_to_vec_with_limit(packed, self.unpacked.min(MOST_BYTES)).ok()?,
            _ => return None,
        };
        (bytes.len() == self.unpacked && crc32fast::hash(&bytes) as usize == self.crc).then_some(bytes)
    }
}

/// A little-endian number of so many bytes.
fn number(zip: &[u8], at: usize, bytes: usize) -> Option<usize> {
    let bytes = zip.get(at..at.checked_add(bytes)?)?;
    Some(bytes.iter().rev().fold(0, |sum, byte| sum << 8 | usize::from(*byte)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An archive of one deflated file and one that is stored.
    fn archive() -> Vec<u8> {
        let (mut zip, mut list) = (Vec::new(), Vec::new());
        for (name, content, method) in [("a/0.pkl", &[7_u8; 900][..], 8_u16), ("b", b"stored", 0)] {
            let packed = if method == 8 { miniz_oxide::deflate::compress_to_vec(content, 6) } else { content.to_vec() };
            let mut common = [&[20, 0, 0, 0][..], &method.to_le_bytes(), &[0; 4]].concat();
            common.extend(crc32fast::hash(content).to_le_bytes());
            common.extend((packed.len() as u32).to_le_bytes());
            common.extend((content.len() as u32).to_le_bytes());
            common.extend([name.len() as u8, 0, 0, 0]);
            list.extend([&b"PK\x01\x02\x14\0"[..], &common, &[0; 10], &(zip.len() as u32).to_le_bytes()].concat());
            list.extend(name.bytes());
            zip.extend([&b"PK\x03\x04"[..], &common, name.as_bytes(), &packed].concat());
        }
        let (offset, length) = (zip.len() as u32, list.len() as u32);
        zip.extend(list);
        zip.extend(b"PK\x05\x06\0\0\0\0\x02\0\x02\0");
        zip.extend([&length.to_le_bytes()[..], &offset.to_le_bytes(), &[0; 2]].concat());
        zip
    }

    #[test]
    fn files_are_found_by_name_and_damage_is_noticed() {
        let zip = archive();
        assert_eq!(member(&zip, "a/0.pkl"), Ok(vec![7; 900]));
        assert_eq!(member(&zip, "b"), Ok(b"stored".to_vec()));
        assert_eq!(member(&zip, "c"), Err(WheelError::Missing("c".into())));
        assert_eq!(member(&zip[..zip.len() - 30], "b"), Err(WheelError::NoArchive));
        let mut damaged = zip.clone();
        let at = zip.windows(6).position(|window| window == b"stored").unwrap();
        damaged[at] = b'S';
        assert_eq!(member(&damaged, "b"), Err(WheelError::Damaged("b".into())));
        // Any other byte may change: it is damage or another answer, and never a panic.
        for place in 0..zip.len() {
            let mut changed = zip.clone();
            changed[place] ^= 0xff;
            let _ = (member(&changed, "a/0.pkl"), member(&changed, "b"));
        }
    }
}
