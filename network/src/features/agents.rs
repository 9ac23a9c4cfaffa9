//! Agents' histories, in the AV's frame.

use world::geometry::Pose;
use world::scene::{AgentKind, AgentState};

use super::Style;
use super::transform::Transform;
use crate::frame::{AgentRow, HISTORY};

/// An agent's last 2 s, oldest first, the last one now.
pub type History = [Option<AgentState>; HISTORY];

/// What the authors' tensors call a kind.
pub(super) fn code(kind: AgentKind) -> f32 {
    match kind {
        AgentKind::Vehicle => 1.0,
        AgentKind::Pedestrian => 2.0,
        AgentKind::Cyclist => 3.0,
        AgentKind::Other => 4.0,
    }
}

/// A row in the log's frame.
#[derive(Clone, Copy, Debug, Default)]
struct WorldRow {
    /// x, y, heading, velocity x and y, length, width, height.
    values: [f64; 8],
    valid: bool,
}

impl WorldRow {
    fn of(state: &AgentState, round: bool) -> Self {
        let values = [
            state.x,
            state.y,
            state.heading,
            state.velocity_x,
            state.velocity_y,
            state.length,
            state.width,
            state.height,
        ];
        Self { values: if round { values.map(|value| f64::from(value as f32)) } else { values }, valid: true }
    }
}

/// The rows of `history` as `transform` sees them, and where the agent is now in the log's frame. `round`: the log is in f32.
pub(super) fn rows(history: &History, transform: &Transform, style: Style, round: bool) -> ([AgentRow; HISTORY], Pose) {
    let mut rows = [WorldRow::default(); HISTORY];
    for (row, state) in rows.iter_mut().zip(history) {
        *row = state.as_ref().map(|state| WorldRow::of(state, round)).unwrap_or_default();
    }
    fill(&mut rows, style);
    let now = rows[HISTORY - 1].values;
    (rows.map(|row| transform.row(&row.values, row.valid)), Pose::new(now[0], now[1], now[2]))
}

/// Fills rows that are missing from the one after: back along its velocity.
fn fill(rows: &mut [WorldRow; HISTORY], style: Style) {
    let is_missing = |row: &WorldRow| match style {
        Style::Authors => row.values[0] == 0.0,
        Style::Mended => !row.valid,
    };
    for index in (0..HISTORY - 1).rev() {
        let after = rows[index + 1];
        let row = &mut rows[index];
        if !is_missing(row) {
            continue;
        }
        let [x, y, heading, vx, vy, ..] = after.values;
        // The authors keep f32 at each step.
        let kept = |value: f64| if style == Style::Authors { f64::from(value as f32) } else { value };
        row.values[..5].copy_from_slice(&[kept(x - 0.1 * vx), kept(y - 0.1 * vy), heading, vx, vy]);
        if style == Style::Mended {
            row.values[5..].copy_from_slice(&after.values[5..]);
        }
        row.valid = after.valid;
    }
}
