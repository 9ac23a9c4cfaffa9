//! Rerun's log messages with counted instead of random numbers: the same bytes for the same drawing.

use re_chunk::{Chunk, ChunkError, ChunkId, EntityPath, RowId, TimeColumn};
use re_log_encoding::{EncodeError, Encoder};
use re_log_types::{BlueprintActivationCommand, LogMsg, SetStoreInfo, StoreId, StoreInfo, StoreKind, StoreSource};
use re_sdk_types::{AsComponents, SerializationError, SerializedComponentColumn};
use thiserror::Error;

use crate::message::STEP_NANOSECONDS;

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

/// One store of a file, the recording or its blueprint, while it is written.
pub struct Store<'a> {
    encoder: &'a mut Encoder<Vec<u8>>,
    id: StoreId,
    /// Rows of a blueprint lie on a timeline of its own.
    is_blueprint: bool,
    chunks: u64,
    rows: u64,
}

impl<'a> Store<'a> {
    /// Begins a recording.
    ///
    /// # Errors
    /// [`RrdError`].
    pub fn recording(encoder: &'a mut Encoder<Vec<u8>>, name: &str) -> Result<Self, RrdError> {
        Self::begin(encoder, StoreKind::Recording, name)
    }

    /// Begins the blueprint of the recording `name`.
    ///
    /// # Errors
    /// [`RrdError`].
    pub fn blueprint(encoder: &'a mut Encoder<Vec<u8>>, name: &str) -> Result<Self, RrdError> {
        Self::begin(encoder, StoreKind::Blueprint, name)
    }

    fn begin(encoder: &'a mut Encoder<Vec<u8>>, kind: StoreKind, name: &str) -> Result<Self, RrdError> {
        let id = StoreId::new(kind, APPLICATION, name);
        let info = StoreInfo::new(id.clone(), StoreSource::Other("reloop recorder".to_owned()));
        encoder.append(&LogMsg::SetStoreInfo(SetStoreInfo { row_id: RowId::ZERO.as_tuid(), info }))?;
        Ok(Self { encoder, id, is_blueprint: kind == StoreKind::Blueprint, chunks: 0, rows: 0 })
    }

    /// Logs what holds for the whole recording.
    ///
    /// # Errors
    /// [`RrdError`].
    pub fn log(&mut self, path: impl Into<EntityPath>, what: &dyn AsComponents) -> Result<(), RrdError> {
        let components = what
            .as_serialized_batches()
            .into_iter()
            .map(|batch| {
                let length = batch.array.len();
                batch.partitioned([length])
            })
            .collect::<Result<Vec<_>, _>>()?;
        let times = if self.is_blueprint { vec![TimeColumn::new_sequence("blueprint", [0_i64])] } else { Vec::new() };
        self.append(path.into(), 1, times, components)
    }

    /// Logs a row for each of `steps`.
    ///
    /// # Errors
    /// [`RrdError`].
    pub fn log_columns(
        &mut self,
        path: impl Into<EntityPath>,
        steps: &[u32],
        columns: impl IntoIterator<Item = SerializedComponentColumn>,
    ) -> Result<(), RrdError> {
        if steps.is_empty() {
            return Ok(());
        }
        let nanoseconds = steps.iter().map(|step| i64::from(*step) * STEP_NANOSECONDS as i64);
        let times = vec![
            TimeColumn::new_sequence("step", steps.iter().map(|step| i64::from(*step))),
            TimeColumn::new_duration_nanos("sim_time", nanoseconds),
        ];
        self.append(path.into(), steps.len(), times, columns.into_iter().collect())
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

    fn append(
        &mut self,
        path: EntityPath,
        rows: usize,
        times: Vec<TimeColumn>,
        columns: Vec<SerializedComponentColumn>,
    ) -> Result<(), RrdError> {
        let row_ids: Vec<RowId> = (0..rows as u64).map(|row| RowId::ZERO.incremented_by(self.rows + row + 1)).collect();
        self.rows += rows as u64;
        self.chunks += 1;
        let id = ChunkId::from_tuid(RowId::ZERO.incremented_by(self.chunks).as_tuid());
        let times = times.into_iter().map(|column| (*column.timeline().name(), column)).collect();
        let chunk = Chunk::from_native_row_ids(id, path, Some(true), &row_ids, times, columns.into_iter().collect())?;
        self.encoder.append(&LogMsg::ArrowMsg(self.id.clone(), chunk.to_arrow_msg()?))?;
        Ok(())
    }
}
