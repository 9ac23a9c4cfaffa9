//! One window as bytes. Its scene, step and AV are in the file's head.
//!
//! What is not there takes a bit: absent neighbours, empty slots, the repeated end of a line that is too short. A lane point's codes
//! are bytes where they can be, as they are in all real frames.

use network::Presence;
use network::constants::{
    AGENTS, CROSSWALK_ROW, CROSSWALKS, HISTORY, LANE_NUMBERS, LANE_ROW, LANES, NEIGHBOR_ROW, NEIGHBORS, POINTS, SLOTS,
    STATE, STEPS,
};
use world::reference_line::WINDOW_SAMPLES;

use super::bytes::{Reader, Writer};
use super::error::FileProblem;
use super::window::{Sketch, Window};

/// The bytes of a window.
pub(super) fn encode(window: &Window) -> Vec<u8> {
    let mut out = Writer(Vec::with_capacity(100_000));
    let Sketch { ego, neighbors, presence, lane_points, lanes, crosswalk_points, crosswalks } = &window.sketch;
    out.floats(ego.as_flattened());
    let rows: Vec<&[f32]> = neighbors.iter().map(|rows| rows.as_flattened()).collect();
    some(&rows, &mut out);
    put_presence(presence, &mut out);
    put_lane_points(lane_points, &mut out);
    put_slots(lanes, &mut out);
    out.u16(crosswalk_points.len() as u16);
    out.floats(crosswalk_points.as_flattened());
    put_slots(crosswalks, &mut out);
    let last = window.line.last().copied().unwrap_or_default();
    let is_last = |row: &[f32; 5]| row.map(f32::to_bits) == last.map(f32::to_bits);
    let kept = window.line.iter().rposition(|row| !is_last(row)).map_or(1, |row| row + 2).min(window.line.len());
    out.u16(kept as u16);
    out.floats(window.line[..kept].as_flattened());
    let rows: Vec<&[f32]> = window.future.iter().map(|rows| rows.as_flattened()).collect();
    some(&rows, &mut out);
    for seen in window.seen.iter() {
        out.u64(bits(seen.iter().copied()));
    }
    out.0
}

/// The window of `scene` that has these bytes.
///
/// # Errors
/// [`FileProblem`].
pub(super) fn decode(bytes: &[u8], scene: &str, step: u32, av: i32) -> Result<Window, FileProblem> {
    let mut from = Reader(bytes);
    let mut ego = [[0.0; STATE]; HISTORY];
    from.floats(ego.as_flattened_mut())?;
    let mut neighbors = [[[0.0; NEIGHBOR_ROW]; HISTORY]; NEIGHBORS];
    fill_some(neighbors.iter_mut().map(|rows| rows.as_flattened_mut()), &mut from)?;
    let presence = presence(&mut from)?;
    let lane_points = lane_points(&mut from)?;
    let lanes = slots(AGENTS * LANES, lane_points.len(), &mut from)?;
    let mut crosswalk_points = vec![[0.0; CROSSWALK_ROW]; usize::from(from.u16()?)];
    from.floats(crosswalk_points.as_flattened_mut())?;
    let crosswalks = slots(AGENTS * CROSSWALKS, crosswalk_points.len(), &mut from)?;
    let kept = usize::from(from.u16()?);
    if !(1..=WINDOW_SAMPLES).contains(&kept) {
        return Err(FileProblem::Impossible("a line of another length"));
    }
    let mut line = vec![[0.0; 5]; kept];
    from.floats(line.as_flattened_mut())?;
    line.resize(WINDOW_SAMPLES, line[kept - 1]);
    let mut future = Box::new([[[0.0; 5]; STEPS]; AGENTS]);
    fill_some(future.iter_mut().map(|rows| rows.as_flattened_mut()), &mut from)?;
    let mut seen = Box::new([[false; STEPS]; AGENTS]);
    for seen in seen.iter_mut() {
        spread(from.u64()?, seen)?;
    }
    from.end()?;
    let sketch = Sketch { ego, neighbors, presence, lane_points, lanes, crosswalk_points, crosswalks };
    Ok(Window { scene: scene.to_owned(), step, av, sketch, line, future, seen })
}

/// Those rows that are not all zero, and before them a bit for each.
fn some(rows: &[&[f32]], out: &mut Writer) {
    let is_there = |row: &[f32]| row.iter().any(|value| value.to_bits() != 0);
    out.u64(bits(rows.iter().map(|row| is_there(row))));
    rows.iter().filter(|row| is_there(row)).for_each(|row| out.floats(row));
}

fn fill_some<'a>(rows: impl ExactSizeIterator<Item = &'a mut [f32]>, from: &mut Reader<'_>) -> Result<(), FileProblem> {
    let mut there = vec![false; rows.len()];
    spread(from.u64()?, &mut there)?;
    for (row, there) in rows.zip(there) {
        if there {
            from.floats(row)?;
        }
    }
    Ok(())
}

fn put_presence(presence: &Presence, out: &mut Writer) {
    out.u64(bits(presence.agents));
    for slots in presence.slots {
        out.u16(bits(slots) as u16);
    }
}

fn presence(from: &mut Reader<'_>) -> Result<Presence, FileProblem> {
    let mut presence = Presence::default();
    spread(from.u64()?, &mut presence.agents)?;
    for slots in &mut presence.slots {
        spread(u64::from(from.u16()?), slots)?;
    }
    Ok(presence)
}

/// Numbers of a lane point that are codes.
const CODES: usize = LANE_ROW - LANE_NUMBERS;

/// How many, whether their codes are bytes, and each.
fn put_lane_points(points: &[[f32; LANE_ROW]], out: &mut Writer) {
    let is_byte = |value: &f32| f32::from(*value as u8).to_bits() == value.to_bits();
    let bytes = points.iter().all(|point| point[LANE_NUMBERS..].iter().all(is_byte));
    out.u16(points.len() as u16);
    out.u8(u8::from(bytes));
    for point in points {
        if bytes {
            out.floats(&point[..LANE_NUMBERS]);
            point[LANE_NUMBERS..].iter().for_each(|code| out.u8(*code as u8));
        } else {
            out.floats(point);
        }
    }
}

fn lane_points(from: &mut Reader<'_>) -> Result<Vec<[f32; LANE_ROW]>, FileProblem> {
    let mut points = vec![[0.0; LANE_ROW]; usize::from(from.u16()?)];
    let bytes = match from.u8()? {
        0 => false,
        1 => true,
        _ => return Err(FileProblem::Impossible("codes of another kind")),
    };
    for point in &mut points {
        if bytes {
            from.floats(&mut point[..LANE_NUMBERS])?;
            let codes = from.array::<CODES>()?;
            point[LANE_NUMBERS..].iter_mut().zip(codes).for_each(|(own, code)| *own = f32::from(code));
        } else {
            from.floats(point)?;
        }
    }
    Ok(points)
}

/// For each slot whether it is taken, then its points' numbers.
fn put_slots(slots: &[Option<[u16; POINTS]>], out: &mut Writer) {
    for slot in slots {
        out.u8(u8::from(slot.is_some()));
        slot.iter().flatten().for_each(|point| out.u16(*point));
    }
}

fn slots(count: usize, points: usize, from: &mut Reader<'_>) -> Result<Vec<Option<[u16; POINTS]>>, FileProblem> {
    let mut slots = vec![None; count];
    for slot in &mut slots {
        match from.u8()? {
            0 => {}
            1 => {
                let mut numbers = [0; POINTS];
                for number in &mut numbers {
                    *number = from.u16()?;
                    if usize::from(*number) >= points {
                        return Err(FileProblem::Impossible("a point's number without the point"));
                    }
                }
                *slot = Some(numbers);
            }
            _ => return Err(FileProblem::Impossible("a slot of another kind")),
        }
    }
    Ok(slots)
}

/// The first is the lowest bit.
fn bits(flags: impl IntoIterator<Item = bool>) -> u64 {
    flags.into_iter().enumerate().fold(0, |bits, (at, flag)| bits | u64::from(flag) << at)
}

fn spread(bits: u64, flags: &mut [bool]) -> Result<(), FileProblem> {
    if bits.checked_shr(flags.len() as u32).unwrap_or(0) != 0 {
        return Err(FileProblem::Impossible("a mark for something that cannot be there"));
    }
    flags.iter_mut().enumerate().for_each(|(at, flag)| *flag = bits >> at & 1 == 1);
    Ok(())
}

// What a mark or a number must have room for.
const _: () = assert!(AGENTS <= 64 && STEPS <= 64 && SLOTS <= 16 && WINDOW_SAMPLES <= u16::MAX as usize);
const _: () = assert!(AGENTS * LANES * POINTS <= u16::MAX as usize);
