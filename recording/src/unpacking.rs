//! Chunks to records.

use zstd::bulk::Decompressor;

use crate::damage::Fault;
use crate::records::{CHUNK_LIMIT, Chunk};

/// Holds the records of one chunk at a time.
#[derive(Default)]
pub struct Unpacker {
    records: Vec<u8>,
    decompressor: Decompressor<'static>,
}

impl Unpacker {
    /// The records of the chunk that was unpacked last.
    #[must_use]
    pub fn records(&self) -> &[u8] {
        &self.records
    }

    /// Unpacks a chunk into a room of the size that it tells, and not a byte beyond, and compares its checksum.
    ///
    /// # Errors
    /// What is wrong with it; its records are then of no use.
    pub fn unpack(&mut self, chunk: &Chunk<'_>) -> Result<(), Fault> {
        let Some(size) = usize::try_from(chunk.size).ok().filter(|_| chunk.size <= CHUNK_LIMIT) else {
            return Err(Fault::ChunkSize { bytes: chunk.size, limit: CHUNK_LIMIT });
        };
        self.records.clear();
        self.records.reserve_exact(size);
        match chunk.compression {
            "" => self.records.extend_from_slice(chunk.packed),
            "zstd" => {
                let unpacked = self.decompressor.decompress_to_buffer(chunk.packed, &mut self.records);
                unpacked.map_err(|error| Fault::Unpacking(error.to_string()))?;
            }
            other => return Err(Fault::Compression(other.to_owned())),
        }
        if self.records.len() != size {
            return Err(Fault::Unpacking("its size is another".to_owned()));
        }
        let (told, found) = (chunk.crc, crc32fast::hash(&self.records));
        if told == 0 || told == found { Ok(()) } else { Err(Fault::Chunk { told, found }) }
    }
}
