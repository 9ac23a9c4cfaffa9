//! Rerun's log messages with counted instead of random numbers: the same bytes for the same drawing.

use re_chunk::{Chunk, ChunkError, ChunkId, EntityPath, RowId, TimeColumn};
use re_log_encoding::{EncodeError, Encoder};
use re_log_types::{BlueprintActivationCommand, LogMsg, SetStoreInfo, StoreId, StoreInfo, StoreKind, StoreSource};
use re_sdk_types::{AsComponents, SerializationError, SerializedComponentColumn};
use thiserror::Error;

/// The application that every recording and its layout belong to.
pub const APPLICATION: &str = "reloop";

/// Why no recording came out. None of these depends on what is recorded.
#[derive(Debug, Error)]
pub enum RrdError {
    /// Columns of different lengths.
    #[error(transparent)]
    Chunk(#[from] ChunkError),
    /// A value that Arrow cannot hold.
    #[error(transparent)]
    Serialization(#[from] SerializationError),
    /// The file's own encoding.
    #[error(transparent)]
    Encode(#[from] EncodeError),
}

/// A file in memory, without an index: Rerun writes that in the order of a hash map, another each time, and viewers do without.
///
/// # Errors
/// [`RrdError`].
pub fn encoder() -> Result<Encoder<Vec<u8>>, RrdError> {
    let mut encoder = Encoder::local()?;
    encoder.do_not_emit_footer();
    Ok(encoder)
}

/// How far the numbers of a store have come, so that it can be gone on with in a later piece of a stream.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Standing {
    chunks: u64,
    rows: u64,
}

/// One store of a file, the recording or its blueprint, while it is written.
pub struct Store<'a> {
    encoder: &'a mut Encoder<Vec<u8>>,
    id: StoreId,
    /// What all that is logged lies below.
    root: EntityPath,
    /// Rows of a blueprint lie on a timeline of its own.
    is_blueprint: bool,
    standing: Standing,
}

impl<'a> Store<'a> {
    /// Begins a recording that `program` writes.
    ///
    /// # Errors
    /// [`RrdError`].
    pub fn recording(encoder: &'a mut Encoder<Vec<u8>>, program: &str, name: &str) -> Result<Self, RrdError> {
        Self::begin(encoder, StoreKind::Recording, program, name)
    }

    /// Begins the blueprint of the recording `name`.
    ///
    /// # Errors
    /// [`RrdError`].
    pub fn blueprint(encoder: &'a mut Encoder<Vec<u8>>, program: &str, name: &str) -> Result<Self, RrdError> {
        Self::begin(encoder, StoreKind::Blueprint, program, &format!("{name}.blueprint"))
    }

    fn begin(encoder: &'a mut Encoder<Vec<u8>>, kind: StoreKind, program: &str, name: &str) -> Result<Self, RrdError> {
        let id = StoreId::new(kind, APPLICATION, name);
        let info = StoreInfo::new(id.clone(), StoreSource::Other(format!("{APPLICATION} {program}")));
        encoder.append(&LogMsg::SetStoreInfo(SetStoreInfo { row_id: RowId::ZERO.as_tuid(), info }))?;
        let is_blueprint = kind == StoreKind::Blueprint;
        Ok(Self { encoder, id, root: EntityPath::root(), is_blueprint, standing: Standing::default() })
    }

    /// Goes on with the recording `name` in a later piece of a stream: what is read one piece after the other is one recording.
    #[must_use]
    pub fn resumed(encoder: &'a mut Encoder<Vec<u8>>, name: &str, standing: Standing) -> Self {
        let id = StoreId::new(StoreKind::Recording, APPLICATION, name);
        Self { encoder, id, root: EntityPath::root(), is_blueprint: false, standing }
    }

    /// How far its numbers have come.
    #[must_use]
    pub fn standing(&self) -> Standing {
        self.standing
    }

    /// What is logged from now on lies below `root`.
    pub fn below(&mut self, root: impl Into<EntityPath>) {
        self.root = root.into();
    }

    /// Logs what holds for the whole recording.
    ///
    /// # Errors
    /// [`RrdError`].
    pub fn log(&mut self, path: impl Into<EntityPath>, what: &dyn AsComponents) -> Result<(), RrdError> {
        let times = if self.is_blueprint { vec![TimeColumn::new_sequence("blueprint", [0_i64])] } else { Vec::new() };
        self.log_chunk(&chunk(self.root.join(&path.into()), 1, times, columns_of_one_row(what)?)?)
    }

    /// Logs a row for each entry of `times`, which are equally long.
    ///
    /// # Errors
    /// [`RrdError`].
    pub fn log_columns(
        &mut self,
        path: impl Into<EntityPath>,
        times: Vec<TimeColumn>,
        columns: impl IntoIterator<Item = SerializedComponentColumn>,
    ) -> Result<(), RrdError> {
        match columns_chunk(self.root.join(&path.into()), times, columns)? {
            Some(chunk) => self.log_chunk(&chunk),
            None => Ok(()),
        }
    }

    /// Logs a chunk that was made before, or in another file, with numbers of this store.
    ///
    /// # Errors
    /// [`RrdError`].
    pub fn log_chunk(&mut self, chunk: &Chunk) -> Result<(), RrdError> {
        let standing = &mut self.standing;
        let first = RowId::ZERO.incremented_by(standing.rows + 1);
        standing.rows += chunk.num_rows() as u64;
        standing.chunks += 1;
        let id = ChunkId::from_tuid(RowId::ZERO.incremented_by(standing.chunks).as_tuid());
        let chunk = chunk.clone_as(id, first);
        self.encoder.append(&LogMsg::ArrowMsg(self.id.clone(), chunk.to_arrow_msg()?))?;
        Ok(())
    }

    /// Ends a blueprint: the viewer is to use it.
    ///
    /// # Errors
    /// [`RrdError`].
    pub fn activate(self) -> Result<(), RrdError> {
        let command = BlueprintActivationCommand { blueprint_id: self.id, make_active: true, make_default: true };
        self.encoder.append(&LogMsg::BlueprintActivationCommand(command))?;
        Ok(())
    }
}

/// The chunk with a row for each entry of `times`, to be logged later; none where there is no row.
///
/// # Errors
/// [`RrdError`].
pub fn columns_chunk(
    path: impl Into<EntityPath>,
    times: Vec<TimeColumn>,
    columns: impl IntoIterator<Item = SerializedComponentColumn>,
) -> Result<Option<Chunk>, RrdError> {
    let rows = times.first().map_or(0, TimeColumn::num_rows);
    if rows == 0 {
        return Ok(None);
    }
    chunk(path.into(), rows, times, columns.into_iter().collect()).map(Some)
}

/// A chunk whose numbers are those of a store's first: a store gives it its own.
fn chunk(
    path: EntityPath,
    rows: usize,
    times: Vec<TimeColumn>,
    columns: Vec<SerializedComponentColumn>,
) -> Result<Chunk, RrdError> {
    let row_ids: Vec<RowId> = (0..rows as u64).map(|row| RowId::ZERO.incremented_by(row + 1)).collect();
    let times = times.into_iter().map(|column| (*column.timeline().name(), column)).collect();
    let columns = columns.into_iter().collect();
    Ok(Chunk::from_native_row_ids(ChunkId::ZERO, path, Some(true), &row_ids, times, columns)?)
}

/// What is there once, as columns of one row.
fn columns_of_one_row(what: &dyn AsComponents) -> Result<Vec<SerializedComponentColumn>, RrdError> {
    let columns = what.as_serialized_batches().into_iter().map(|batch| {
        let length = batch.array.len();
        batch.partitioned([length])
    });
    Ok(columns.collect::<Result<Vec<_>, _>>()?)
}
