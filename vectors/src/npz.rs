//! NumPy's `.npz` files: a zip archive of `.npy` arrays, stored or deflated. As much of both as vectors need.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use thiserror::Error;

/// An array: numbers in C order. Integers are read as floats.
#[derive(Clone, Debug, PartialEq)]
struct Array {
    /// Length along each axis; empty for a single number.
    shape: Vec<usize>,
    values: Vec<f64>,
}

/// The arrays of one file, by name.
#[derive(Clone, Debug, Default)]
pub struct Npz {
    path: PathBuf,
    arrays: BTreeMap<String, Array>,
}

/// Why a file or an array cannot be used.
#[derive(Debug, Error)]
pub enum NpzError {
    /// The file cannot be read.
    #[error("cannot read {path}")]
    Io {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The file is not what it should be.
    #[error("{path}: {what}")]
    Malformed {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        what: String,
    },
    /// An array is missing or of another shape.
    #[error("{path}: array {name} {what}")]
    Array {
        /// The file.
        path: PathBuf,
        /// The array.
        name: String,
        /// What is wrong.
        what: String,
    },
}

/// All arrays of a file together unpack to no more bytes than this: a file of a few bytes must not take all memory.
const LARGEST: usize = 1 << 28;

impl Npz {
    /// Reads a file.
    ///
    /// # Errors
    /// [`NpzError`] names the file and what is wrong with it.
    pub fn read(path: &Path) -> Result<Self, NpzError> {
        let bytes = fs::read(path).map_err(|source| NpzError::Io { path: path.to_owned(), source })?;
        Self::parse(path, &bytes)
    }

    /// Reads a file's bytes; `path` is for errors alone.
    ///
    /// # Errors
    /// [`NpzError::Malformed`].
    pub fn parse(path: &Path, bytes: &[u8]) -> Result<Self, NpzError> {
        let arrays = parse_zip(bytes).map_err(|what| NpzError::Malformed { path: path.to_owned(), what })?;
        Ok(Self { path: path.to_owned(), arrays })
    }

    /// Each array's name and length along each axis, by name.
    pub fn shapes(&self) -> impl Iterator<Item = (&str, &[usize])> {
        self.arrays.iter().map(|(name, array)| (name.as_str(), array.shape.as_slice()))
    }

    /// Whether there is such an array.
    #[must_use]
    pub fn has(&self, name: &str) -> bool {
        self.arrays.contains_key(name)
    }

    /// The numbers of an array; `None` along an axis of `shape` leaves it open.
    ///
    /// # Errors
    /// [`NpzError::Array`].
    pub fn array(&self, name: &str, shape: &[Option<usize>]) -> Result<&[f64], NpzError> {
        let error = |what| self.error(name, what);
        let array = self.arrays.get(name).ok_or_else(|| error("is missing".to_owned()))?;
        let fits = |(got, wanted): (&usize, &Option<usize>)| wanted.is_none_or(|wanted| wanted == *got);
        if array.shape.len() == shape.len() && array.shape.iter().zip(shape).all(fits) {
            Ok(&array.values)
        } else {
            Err(error(format!("has shape {:?}, but {shape:?} is needed", array.shape)))
        }
    }

    /// The numbers of an array, to be changed: for tests that one which is off is found.
    pub fn values_mut(&mut self, name: &str) -> Option<&mut [f64]> {
        Some(&mut self.arrays.get_mut(name)?.values)
    }

    /// The numbers of an array in groups of `N`, in C order; a last group that is not whole is left out.
    ///
    /// # Errors
    /// [`NpzError::Array`].
    pub fn rows<const N: usize>(&self, name: &str, shape: &[Option<usize>]) -> Result<&[[f64; N]], NpzError> {
        Ok(self.array(name, shape)?.as_chunks::<N>().0)
    }

    /// The case at `index` of a batch of `cases`: arrays whose first axis is that long have its part of them alone, the others are
    /// shared.
    ///
    /// # Panics
    /// Where `index` is not below `cases`.
    #[must_use]
    pub fn case(&self, index: usize, cases: usize) -> Self {
        let part = |array: &Array| match array.shape.split_first() {
            Some((first, rest)) if *first == cases => {
                let length = rest.iter().product::<usize>();
                Array { shape: rest.to_vec(), values: array.values[index * length..][..length].to_vec() }
            }
            _ => array.clone(),
        };
        let arrays = self.arrays.iter().map(|(name, array)| (name.clone(), part(array))).collect();
        Self { path: self.path.clone(), arrays }
    }

    /// That this array is not as it should be.
    #[must_use]
    pub fn error(&self, name: &str, what: String) -> NpzError {
        NpzError::Array { path: self.path.clone(), name: name.to_owned(), what }
    }

    /// A single number.
    ///
    /// # Errors
    /// [`NpzError::Array`].
    pub fn number(&self, name: &str) -> Result<f64, NpzError> {
        Ok(self.array(name, &[])?[0])
    }
}

fn parse_zip(bytes: &[u8]) -> Result<BTreeMap<String, Array>, String> {
    let cut = || "the archive is cut off".to_owned();
    // The end of the central directory is the last record, before a comment.
    let end = bytes.windows(4).rposition(|w| w == b"PK\x05\x06").ok_or("it is no zip archive")?;
    let entries = u16_at(bytes, end + 10).ok_or_else(cut)?;
    let mut at = u32_at(bytes, end + 16).ok_or_else(cut)?;
    let mut arrays = BTreeMap::new();
    let mut left = LARGEST;
    for _ in 0..entries {
        if bytes.get(at..at + 4) != Some(b"PK\x01\x02") {
            return Err(format!("no directory entry at byte {at}"));
        }
        let field = |offset| u16_at(bytes, at + offset).ok_or_else(cut);
        let (method, name_length, extra, comment) = (field(10)?, field(28)?, field(30)?, field(32)?);
        let packed = u32_at(bytes, at + 20).ok_or_else(cut)?;
        let unpacked = u32_at(bytes, at + 24).ok_or_else(cut)?;
        let local = u32_at(bytes, at + 42).ok_or_else(cut)?;
        let name = bytes.get(at + 46..at + 46 + name_length).ok_or_else(cut)?;
        let name = String::from_utf8_lossy(name);
        let name = name.strip_suffix(".npy").unwrap_or(&name).to_owned();
        at += 46 + name_length + extra + comment;
        let skip = 30 + u16_at(bytes, local + 26).ok_or_else(cut)? + u16_at(bytes, local + 28).ok_or_else(cut)?;
        let data = bytes.get(local + skip..).and_then(|rest| rest.get(..packed)).ok_or_else(cut)?;
        left = left
            .checked_sub(unpacked.max(packed))
            .ok_or_else(|| format!("{name} claims {unpacked} bytes, and all arrays together may have {LARGEST}"))?;
        let array = match method {
            0 => parse_npy(data),
            8 => miniz_oxide::inflate::decompress_to_vec_with_limit(data, unpacked)
                .map_err(|error| format!("does not unpack: {error}"))
                .and_then(|data| parse_npy(&data)),
            method => Err(format!("is packed by method {method}, which is not known")),
        };
        arrays.insert(name.clone(), array.map_err(|what| format!("{name} {what}"))?);
    }
    Ok(arrays)
}

fn u16_at(bytes: &[u8], at: usize) -> Option<usize> {
    let field = bytes.get(at..)?.first_chunk::<2>()?;
    Some(usize::from(u16::from_le_bytes(*field)))
}

fn u32_at(bytes: &[u8], at: usize) -> Option<usize> {
    let field = bytes.get(at..)?.first_chunk::<4>()?;
    usize::try_from(u32::from_le_bytes(*field)).ok()
}

fn parse_npy(bytes: &[u8]) -> Result<Array, String> {
    let rest = bytes.strip_prefix(b"\x93NUMPY").ok_or("is no npy array")?;
    let cut = || "is cut off".to_owned();
    let (length, start) = match rest.first() {
        Some(1) => (u16_at(rest, 2).ok_or_else(cut)?, 4),
        Some(_) => (u32_at(rest, 2).ok_or_else(cut)?, 6),
        None => return Err(cut()),
    };
    let header = rest.get(start..start + length).ok_or_else(cut)?;
    let header = std::str::from_utf8(header).map_err(|_| "has a header that is no text")?;
    let value = |key: &str| header.split_once(key).map(|(_, rest)| rest.trim_start_matches([':', ' ']));
    if value("'fortran_order'").is_none_or(|v| !v.starts_with("False")) {
        return Err("is not in C order".to_owned());
    }
    let shape = value("'shape'").and_then(|v| v.strip_prefix('(')?.split_once(')')).ok_or("has no shape")?.0;
    let shape = shape.split(',').map(str::trim).filter(|v| !v.is_empty());
    let shape: Vec<usize> = shape.map(str::parse).collect::<Result<_, _>>().map_err(|_| "has a wrong shape")?;
    let kind = value("'descr'").and_then(|v| v.strip_prefix('\'')?.split_once('\'')).ok_or("has no type")?.0;
    let data = &rest[start + length..];
    let values: Vec<f64> = match kind {
        "<f8" => chunks(data, f64::from_le_bytes),
        "<f4" => chunks(data, |b| f64::from(f32::from_le_bytes(b))),
        "<i8" => chunks(data, |b| i64::from_le_bytes(b) as f64),
        "<i4" => chunks(data, |b| f64::from(i32::from_le_bytes(b))),
        "<i2" => chunks(data, |b| f64::from(i16::from_le_bytes(b))),
        "|i1" => data.iter().map(|b| f64::from(b.cast_signed())).collect(),
        "|b1" | "|u1" => data.iter().map(|b| f64::from(*b)).collect(),
        kind => return Err(format!("has type {kind}, which is not known")),
    };
    let wanted = shape.iter().try_fold(1_usize, |product, axis| product.checked_mul(*axis));
    if wanted == Some(values.len()) {
        Ok(Array { shape, values })
    } else {
        Err(format!("has {} numbers for shape {shape:?}", values.len()))
    }
}

fn chunks<const N: usize>(data: &[u8], number: impl Fn([u8; N]) -> f64) -> Vec<f64> {
    data.as_chunks::<N>().0.iter().map(|chunk| number(*chunk)).collect()
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    fn npy(kind: &str, shape: &str, data: &[u8]) -> Vec<u8> {
        let header = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}\n");
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend(u16::try_from(header.len()).unwrap().to_le_bytes());
        bytes.extend(header.as_bytes());
        bytes.extend(data);
        bytes
    }

    /// An archive of `pair` = [1, 2] and `number` = 2.5, both stored or both deflated.
    pub(crate) fn archive(stored: bool) -> Vec<u8> {
        let pair: Vec<u8> = [1_i32, 2].iter().flat_map(|v| v.to_le_bytes()).collect();
        let arrays = [("pair", npy("<i4", "(2,)", &pair)), ("number", npy("<f8", "()", &2.5_f64.to_le_bytes()))];
        let (mut bytes, mut directory) = (Vec::new(), Vec::new());
        for (name, array) in &arrays {
            let data = if stored { array.clone() } else { miniz_oxide::deflate::compress_to_vec(array, 6) };
            let name = format!("{name}.npy");
            let mut sizes = [data.len(), array.len()].map(|size| (size as u32).to_le_bytes()).concat();
            sizes.extend((name.len() as u16).to_le_bytes());
            sizes.extend([0; 2]);
            let mut common = vec![20, 0, 0, 0, if stored { 0 } else { 8 }, 0];
            common.extend([0; 8]); // time, date and checksum, which nobody reads
            common.extend(sizes);
            directory.extend(b"PK\x01\x02\x14\0");
            directory.extend(&common);
            directory.extend([0; 10]);
            directory.extend((bytes.len() as u32).to_le_bytes());
            directory.extend(name.as_bytes());
            bytes.extend(b"PK\x03\x04");
            bytes.extend(&common);
            bytes.extend(name.as_bytes());
            bytes.extend(data);
        }
        let start = bytes.len() as u32;
        bytes.extend(&directory);
        bytes.extend(b"PK\x05\x06\0\0\0\0\x02\0\x02\0");
        bytes.extend((directory.len() as u32).to_le_bytes());
        bytes.extend(start.to_le_bytes());
        bytes.extend([0; 2]);
        bytes
    }

    #[test]
    fn a_case_of_a_batch_has_its_part_of_each_array_that_is_as_long() {
        let npz = Npz::parse(Path::new("a.npz"), &archive(true)).unwrap();
        let second = npz.case(1, 2);
        assert_eq!((second.number("pair").unwrap(), second.number("number").unwrap()), (2.0, 2.5));
        assert_eq!(npz.case(0, 3).array("pair", &[None]).unwrap(), [1.0, 2.0]);
    }

    #[test]
    fn an_archive_is_read_stored_or_deflated() {
        for stored in [true, false] {
            let npz = Npz::parse(Path::new("a.npz"), &archive(stored)).unwrap();
            assert_eq!(npz.array("pair", &[None]).unwrap(), [1.0, 2.0]);
            assert_eq!(npz.number("number").unwrap(), 2.5);
            assert_eq!(npz.shapes().collect::<Vec<_>>(), [("number", &[][..]), ("pair", &[2])]);
            assert_eq!(
                npz.number("pair").unwrap_err().to_string(),
                "a.npz: array pair has shape [2], but [] is needed"
            );
            assert_eq!(npz.rows::<2>("none", &[None]).unwrap_err().to_string(), "a.npz: array none is missing");
        }
    }

    #[test]
    fn an_archive_that_claims_too_much_is_refused() {
        let mut bytes = archive(false);
        let entry = bytes.windows(4).position(|window| window == b"PK\x01\x02").unwrap();
        bytes[entry + 24..entry + 28].copy_from_slice(&u32::MAX.to_le_bytes());
        let error = Npz::parse(Path::new("a.npz"), &bytes).unwrap_err().to_string();
        assert_eq!(error, "a.npz: pair claims 4294967295 bytes, and all arrays together may have 268435456");
    }

    #[test]
    fn numbers_and_arrays_of_each_type_are_read() {
        let number = parse_npy(&npy("<f8", "()", &2.5_f64.to_le_bytes())).unwrap();
        assert_eq!((number.shape, number.values), (vec![], vec![2.5]));
        let data: Vec<u8> = [1_i32, -2, 3, 4].iter().flat_map(|v| v.to_le_bytes()).collect();
        let array = parse_npy(&npy("<i4", "(2, 2)", &data)).unwrap();
        assert_eq!((array.shape, array.values), (vec![2, 2], vec![1.0, -2.0, 3.0, 4.0]));
    }

    #[test]
    fn what_is_wrong_with_an_array_is_said() {
        let text = |bytes: &[u8]| parse_npy(bytes).unwrap_err();
        assert_eq!(text(b"PNG"), "is no npy array");
        assert_eq!(text(&npy("<c16", "(1,)", &[0; 16])), "has type <c16, which is not known");
        assert_eq!(text(&npy("<f8", "(2,)", &[0; 8])), "has 1 numbers for shape [2]");
        assert_eq!(
            text(&npy("<f8", "(99999999999, 99999999999)", &[0; 8])),
            "has 1 numbers for shape [99999999999, 99999999999]"
        );
        assert_eq!(parse_zip(b"nothing").unwrap_err(), "it is no zip archive");
        assert_eq!(parse_zip(b"PK\x05\x06\0\0\0\0\x01\0\x01\0").unwrap_err(), "the archive is cut off");
    }
}
