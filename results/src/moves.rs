//! Where those were that reacted: a column of `steps.parquet`, a list a step.

use std::iter::zip;
use std::sync::Arc;

use arrow_array::cast::AsArray as _;
use arrow_array::types::{Float64Type, Int32Type};
use arrow_array::{Array as _, ArrayRef, Float64Array, Int32Array, ListArray, StructArray};
use arrow_buffer::OffsetBuffer;
use arrow_schema::{DataType, Field, Fields};
use wire::proto::Agent;
use world::scene::{AgentState, TrackId};

use crate::parquet::{ParquetError, Table};

/// The column's name.
pub const COLUMN: &str = "reactive";

/// The fields of a list's members beside the track: place, heading, velocity.
const NUMBERS: [&str; 6] = ["x_m", "y_m", "z_m", "heading_rad", "velocity_x_mps", "velocity_y_mps"];

/// An agent after a step in which it reacted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moved {
    /// Which track.
    pub track: TrackId,
    /// As [`NUMBERS`] has them.
    numbers: [f64; NUMBERS.len()],
}

impl Moved {
    /// Its state; sizes, which do not change, are those of `before`.
    #[must_use]
    pub fn state(&self, before: &AgentState) -> AgentState {
        let [x, y, z, heading, velocity_x, velocity_y] = self.numbers;
        AgentState { x, y, z, heading, velocity_x, velocity_y, ..*before }
    }
}

fn fields() -> Fields {
    let track = Field::new("track", DataType::Int32, false);
    std::iter::once(track).chain(NUMBERS.map(|name| Field::new(name, DataType::Float64, false))).collect()
}

fn member() -> Field {
    Field::new("element", DataType::Struct(fields()), false)
}

/// The column: who reacted in each step.
pub(crate) fn column<'a>(steps: impl Iterator<Item = &'a [Agent]>) -> ListArray {
    let (mut lengths, mut tracks, mut numbers) = (Vec::new(), Vec::new(), [const { Vec::new() }; NUMBERS.len()]);
    for agents in steps {
        lengths.push(agents.len());
        for agent in agents {
            let state = agent.state.unwrap_or_default();
            tracks.push(agent.track);
            let own = [state.x, state.y, state.z, state.heading, state.velocity_x, state.velocity_y];
            zip(&mut numbers, own).for_each(|(column, number)| column.push(number));
        }
    }
    let numbers = numbers.map(|column| -> ArrayRef { Arc::new(Float64Array::from(column)) });
    let columns = std::iter::once::<ArrayRef>(Arc::new(Int32Array::from(tracks))).chain(numbers).collect();
    let members = StructArray::new(fields(), columns, None);
    ListArray::new(Arc::new(member()), OffsetBuffer::from_lengths(lengths), Arc::new(members), None)
}

/// Who reacted in each row of a table of steps.
///
/// # Errors
/// [`ParquetError::Column`].
pub fn of(table: &Table) -> Result<Vec<Vec<Moved>>, ParquetError> {
    table.column(COLUMN, &DataType::List(Arc::new(member())), |lists| {
        let lists = lists.as_list::<i32>();
        let (members, ends) = (lists.values().as_struct(), lists.value_offsets());
        let tracks = members.column(0).as_primitive::<Int32Type>().values();
        let numbers = [1, 2, 3, 4, 5, 6].map(|column| members.column(column).as_primitive::<Float64Type>().values());
        let moved =
            |row: usize| Moved { track: TrackId(tracks[row]), numbers: numbers.each_ref().map(|values| values[row]) };
        (0..lists.len()).map(|row| (ends[row] as usize..ends[row + 1] as usize).map(moved).collect()).collect()
    })
}

#[cfg(test)]
mod tests {
    use arrow_array::RecordBatch;

    use super::*;
    use crate::parquet::write;

    #[test]
    fn who_reacted_is_read_back_to_the_bit() {
        let agent = |track: i32, x: f64| Agent {
            track,
            state: Some(wire::proto::AgentState { x, y: 0.1 + 0.2, velocity_x: -3.5, ..Default::default() }),
            ..Agent::default()
        };
        let steps = [vec![agent(7, 1e-300), agent(-2, 4.0)], Vec::new(), vec![agent(i32::MAX, -0.5)]];
        let moved = column(steps.iter().map(Vec::as_slice));
        let scenes: ArrayRef = Arc::new(arrow_array::StringArray::from(vec!["a", "a", "b"]));
        let batch = RecordBatch::try_from_iter([("scene", scenes), (COLUMN, Arc::new(moved) as ArrayRef)]).unwrap();
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join("steps.parquet");
        write(&path, batch.schema(), [Ok(batch)]).unwrap();
        for table in [Table::read(&path).unwrap(), Table::read_of(&path, &[COLUMN], &["a", "b"].into()).unwrap()] {
            let read = of(&table).unwrap();
            assert_eq!(read.iter().map(Vec::len).collect::<Vec<_>>(), [2, 0, 1]);
            let state = read[0][0].state(&AgentState { length: 4.0, ..AgentState::default() });
            assert_eq!((state.x, state.y, state.velocity_x, state.length), (1e-300, 0.1 + 0.2, -3.5, 4.0));
            assert_eq!((read[0][1].track, read[2][0].track), (TrackId(-2), TrackId(i32::MAX)));
        }
        // Of some rows: a list does not begin where its values do.
        let some = Table::read_of(&path, &[COLUMN], &["b"].into()).unwrap();
        assert_eq!(of(&some).unwrap()[0][0].track, TrackId(i32::MAX));
        assert!(matches!(of(&Table::read_of(&path, &[], &["a"].into()).unwrap()), Err(ParquetError::Column { .. })));
    }
}
