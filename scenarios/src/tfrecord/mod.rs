//! TFRecord framing: a file is a row of records, each guarded by two checksums.
//!
//! | bytes | what |
//! | --- | --- |
//! | 8 | payload length, little endian |
//! | 4 | masked CRC32C of these 8 bytes |
//! | n | payload |
//! | 4 | masked CRC32C of the payload |
//!
//! [`Decoder`] is the core without IO; [`Records`] drives it over any [`std::io::Read`] and holds one record at a time;
//! [`Unpack`] stands between where the file is packed as a whole. [`Frames`] steps from record to record past what they hold.

mod decode;
mod entrances;
mod packed;
mod skim;
mod stream;

pub use decode::{Decoder, FrameError, FrameProblem, Record};
pub use entrances::Entrances;
pub use packed::{PackedError, PackedProblem, Packing, Restart, Unpack};
pub use skim::{Frame, Frames};
pub use stream::{Records, StreamError};

/// Bytes before a payload.
pub const HEADER_BYTES: usize = 12;

/// Bytes after a payload.
pub const FOOTER_BYTES: usize = 4;

/// The longest payload that is read: 64 MiB, thirty times the largest scene seen. A longer one is a damaged length.
pub const MAX_PAYLOAD_BYTES: u64 = 64 << 20;

/// CRC32C of `bytes`, masked as TFRecord does, so that a sum over data that holds sums stays sound.
#[must_use]
pub fn masked_crc32c(bytes: &[u8]) -> u32 {
    crc32c::crc32c(bytes).rotate_right(15).wrapping_add(0xA282_EAD8)
}

/// Appends `payload` to `file` as a record.
pub fn append_record(file: &mut Vec<u8>, payload: &[u8]) {
    let length = (payload.len() as u64).to_le_bytes();
    file.reserve(HEADER_BYTES + payload.len() + FOOTER_BYTES);
    file.extend_from_slice(&length);
    file.extend_from_slice(&masked_crc32c(&length).to_le_bytes());
    file.extend_from_slice(payload);
    file.extend_from_slice(&masked_crc32c(payload).to_le_bytes());
}

/// Whether `start` begins like a TFRecord file: a header whose checksum is right.
#[must_use]
pub fn looks_like_tfrecord(start: &[u8]) -> bool {
    let Some((length, rest)) = start.split_first_chunk::<8>() else { return false };
    rest.first_chunk::<4>().is_some_and(|sum| u32::from_le_bytes(*sum) == masked_crc32c(length))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_published_check_value_and_its_mask() {
        assert_eq!(crc32c::crc32c(b"123456789"), 0xE306_9283);
        assert_eq!(masked_crc32c(b"123456789"), 0xC78A_B0E5);
    }

    #[test]
    fn a_real_files_header_is_recognised() {
        let header = [0x73, 0x8a, 0x0e, 0, 0, 0, 0, 0, 0x19, 0x37, 0x44, 0x11];
        assert!(looks_like_tfrecord(&header));
        assert!(!looks_like_tfrecord(&header[..11]));
        assert!(!looks_like_tfrecord(b"version https://git-lfs"));
    }
}
