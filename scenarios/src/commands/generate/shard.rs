//! A file of records that appears under its name when it is whole.
//!
//! A packed one is a single gzip member, so that any reader takes it. Each record is compressed by itself, by whichever thread made
//! it: deflate may stop at any byte and begin with an empty window, and CRCs can be put together.

use std::fs::{self, File};
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use miniz_oxide::deflate::core::{
    CompressorOxide, TDEFLFlush, TDEFLStatus, compress_to_output, create_comp_flags_from_zip_params,
};
use scenarios::tfrecord;

use super::super::Failure;

/// Level of compression: what gzip does by itself.
const LEVEL: i32 = 6;
/// Gzip (RFC 1952) of deflate, without name and time, by an unknown system: the same bytes everywhere.
const GZIP_HEADER: [u8; 10] = [0x1f, 0x8b, 8, 0, 0, 0, 0, 0, 0, 255];
/// A last block with nothing in it.
const END_OF_DEFLATE: [u8; 2] = [3, 0];

/// A record as it lies in a shard.
#[derive(Debug)]
pub struct Segment {
    bytes: Vec<u8>,
    /// CRC and length before it was packed, if it is.
    plain: Option<crc32fast::Hasher>,
    plain_bytes: u64,
}

impl Segment {
    /// The record of `payload`, packed or not.
    pub fn of(payload: &[u8], gzip: bool) -> Self {
        let mut record = Vec::new();
        tfrecord::append_record(&mut record, payload);
        let plain_bytes = record.len() as u64;
        if !gzip {
            return Self { bytes: record, plain: None, plain_bytes };
        }
        let mut crc = crc32fast::Hasher::new();
        crc.update(&record);
        Self { bytes: deflate(&record), plain: Some(crc), plain_bytes }
    }
}

/// Deflate of `plain` up to a byte's end, such that more may follow.
fn deflate(plain: &[u8]) -> Vec<u8> {
    let mut packed = Vec::with_capacity(plain.len() / 3);
    let mut compressor = CompressorOxide::new(create_comp_flags_from_zip_params(LEVEL, 0, 0));
    let (status, taken) = compress_to_output(&mut compressor, plain, TDEFLFlush::Full, |bytes| {
        packed.extend_from_slice(bytes);
        true
    });
    debug_assert!(status == TDEFLStatus::Okay && taken == plain.len(), "a vector takes all");
    packed
}

/// A shard under way.
#[derive(Debug)]
pub struct ShardFile {
    path: PathBuf,
    partial: PathBuf,
    file: BufWriter<File>,
    /// For a packed one, the CRC and length of all before it was packed.
    gzip: Option<(crc32fast::Hasher, u64)>,
    whole: bool,
}

impl ShardFile {
    /// Begins the shard `name` in `folder`; what was left of an earlier beginning is overwritten.
    ///
    /// # Errors
    /// [`Failure::Write`].
    pub fn create(folder: &Path, name: &str, gzip: bool) -> Result<Self, Failure> {
        let (path, partial) = (folder.join(name), Self::partial(folder, name));
        let file = File::create(&partial).map_err(|source| Failure::write(&partial, source))?;
        let gzip = gzip.then(|| (crc32fast::Hasher::new(), 0));
        let mut shard = Self { path, partial, file: BufWriter::new(file), gzip, whole: false };
        if shard.gzip.is_some() {
            shard.write(&GZIP_HEADER)?;
        }
        Ok(shard)
    }

    /// What the shard `name` is called until it is whole.
    pub fn partial(folder: &Path, name: &str) -> PathBuf {
        folder.join(format!("{name}.partial"))
    }

    /// Appends a record, which is packed if the shard is.
    ///
    /// # Errors
    /// [`Failure::Write`].
    pub fn append(&mut self, segment: &Segment) -> Result<(), Failure> {
        if let (Some((crc, bytes)), Some(plain)) = (&mut self.gzip, &segment.plain) {
            crc.combine(plain);
            *bytes += segment.plain_bytes;
        }
        self.write(&segment.bytes)
    }

    /// Gives the file its name.
    ///
    /// # Errors
    /// [`Failure::Write`].
    pub fn finish(mut self) -> Result<(), Failure> {
        if let Some((crc, bytes)) = self.gzip.take() {
            // The trailer has the length modulo 2^32.
            let trailer = [crc.finalize().to_le_bytes(), (bytes as u32).to_le_bytes()].concat();
            self.write(&END_OF_DEFLATE)?;
            self.write(&trailer)?;
        }
        let synced = self.file.flush().and_then(|()| self.file.get_ref().sync_all());
        synced.map_err(|source| Failure::write(&self.partial, source))?;
        fs::rename(&self.partial, &self.path).map_err(|source| Failure::write(&self.path, source))?;
        self.whole = true;
        Ok(())
    }

    fn write(&mut self, bytes: &[u8]) -> Result<(), Failure> {
        self.file.write_all(bytes).map_err(|source| Failure::write(&self.partial, source))
    }
}

impl Drop for ShardFile {
    fn drop(&mut self) {
        if !self.whole {
            // It is of no use, and the next one that is begun overwrites it.
            let _ = fs::remove_file(&self.partial);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::io::Read;

    use super::*;
    use scenarios::tfrecord::{Packing, Records, Restart, Unpack};

    #[test]
    fn a_packed_shard_is_one_gzip_member_of_the_plain_ones_bytes() {
        let folder = tempfile::tempdir().unwrap();
        let payloads = [vec![], vec![7; 200_000], (0..=255).cycle().take(70_000).collect::<Vec<u8>>(), b"end".to_vec()];
        for gzip in [false, true] {
            let mut shard = ShardFile::create(folder.path(), &gzip.to_string(), gzip).unwrap();
            payloads.iter().for_each(|payload| shard.append(&Segment::of(payload, gzip)).unwrap());
            shard.finish().unwrap();
        }
        let [plain, packed] = ["false", "true"].map(|name| fs::read(folder.path().join(name)).unwrap());
        assert!(packed.len() < plain.len() / 50);
        let mut unpacked = Vec::new();
        Unpack::from(&packed[..], &Restart::beginning(Packing::Gzip)).read_to_end(&mut unpacked).unwrap();
        assert_eq!(unpacked, plain);
        let mut records = Records::new(&plain[..]);
        for payload in &payloads {
            assert_eq!(records.next_record().unwrap().unwrap().payload, payload);
        }
        assert!(records.next_record().unwrap().is_none());
    }

    #[test]
    fn what_is_not_finished_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let mut shard = ShardFile::create(folder.path(), "shard", false).unwrap();
        shard.append(&Segment::of(b"record", false)).unwrap();
        drop(shard);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
