"""From the arrays of training windows to a batch in which nothing is held twice.

`distil` looks at one window: which agents have a row of their own, which lane and crosswalk slots are filled, and which distinct points these slots walk
over. It depends on the window alone, so a training run does it once per window, not per step. `collate` joins distilled windows; points are never shared
across windows. Shapes: N agents with rows, M windows that have absent agents (which share one row), B windows.
"""

from dataclasses import dataclass

import numpy as np
import torch

from .parameters import PADDED_TABLES

# Column of the lane point, embedding table, rows of the table.
CODES = (
    (10, "self_type", 4),
    (11, "left_type", 11),
    (12, "right_type", 11),
    (13, "traffic_light_type", 9),
    (14, "stop_point", 2),
    (15, "interpolating", 2),
    (16, "stop_sign", 2),
)


@dataclass
class Slots:
    """Filled map slots of one kind: distinct points, and the hundred points each slot walks over."""

    points: np.ndarray  # P x features
    walks: np.ndarray  # S x 100, into points
    agent: np.ndarray  # S, into the window's agents with rows


@dataclass
class Distilled:
    """One window without its repetitions."""

    rows: np.ndarray  # the agents (0 the AV) with a row of their own
    kind: np.ndarray  # of each: 0 vehicle, 1 pedestrian, 2 cyclist
    history: np.ndarray  # rows x 20 x 8
    absent: np.ndarray  # of each row: masked as a key
    token: np.ndarray  # of all eleven agents: position in rows, or len(rows) for the shared row of the empty ones
    lanes: Slots
    crosswalks: Slots
    slot: np.ndarray  # rows x 10: lane slot (0..5) or crosswalk slot (6..9), -1 where the slot is empty
    masked: np.ndarray  # rows x 10: not a key of the multi-modal attention
    current: np.ndarray  # 11 x 8
    reference: np.ndarray  # 1200 x 5
    future: np.ndarray  # 11 x 50 x 5


def _lane_features(points):
    """Ten measures and one column for every code that has a vector of its own (row 0 of a padded table is zero and stays it)."""
    columns = [points[:, :10]]
    for column, table, rows in CODES:
        codes = points[:, column].astype(np.int64)
        first = 1 if table in PADDED_TABLES else 0
        columns.append((codes[:, None] == np.arange(first, rows)).astype(np.float32))
    return np.concatenate(columns, axis=1)


def _slots(tensor, filled, rows, features):
    """Distinct points of the filled slots (rows x slots of `tensor`, agents x slots x 100 x columns)."""
    agent, slot = np.nonzero(filled[rows])
    points = tensor[rows[agent], slot].reshape(-1, tensor.shape[-1])
    # Bytes compare faster than rows of floats; +0.0 makes the two zeros one.
    keys = np.ascontiguousarray(points + np.float32(0.0)).view(np.dtype((np.void, points.dtype.itemsize * points.shape[1]))).ravel()
    _, first, inverse = np.unique(keys, return_index=True, return_inverse=True)
    # In order of first appearance, so that a walk reads its points mostly in sequence.
    order = np.argsort(first)
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return Slots(features(points[first[order]]), rank[inverse].reshape(-1, 100), agent), slot


def distil(ego, neighbors, lanes, crosswalks, reference, future):
    """One window of the authors' training files, float32."""
    history = np.concatenate([ego[None], neighbors[:, :, :8]])
    lane_filled = lanes.any(axis=(2, 3))
    crosswalk_filled = crosswalks.any(axis=(2, 3))
    shared = ~history.any(axis=(1, 2)) & ~lane_filled.any(axis=1) & ~crosswalk_filled.any(axis=1)
    rows = np.nonzero(~shared)[0]
    token = np.full(11, len(rows))
    token[rows] = np.arange(len(rows))
    types = np.concatenate([[1], neighbors[:, -1, 8].astype(np.int64)])[rows]
    lane_slots, lane_column = _slots(lanes, lane_filled, rows, _lane_features)
    crosswalk_slots, crosswalk_column = _slots(crosswalks, crosswalk_filled, rows, lambda points: points)
    slot = np.full((len(rows), 10), -1)
    slot[lane_slots.agent, lane_column] = np.arange(len(lane_slots.agent))
    slot[crosswalk_slots.agent, 6 + crosswalk_column] = np.arange(len(crosswalk_slots.agent))
    masked = np.concatenate([lanes[rows, :, 0, 0] == 0, crosswalks[rows, :, 0, 0] == 0], axis=1)
    masked[:, 0] = False
    return Distilled(
        rows,
        np.where(types == 2, 1, np.where(types == 3, 2, 0)),
        history[rows],
        history[rows, -1, 7] == 0,
        token,
        lane_slots,
        crosswalk_slots,
        slot,
        masked,
        history[:, -1],
        reference,
        future,
    )


def read_windows(arrays):
    """Distilled windows of `batch.npz`."""
    names = ("ego", "neighbors", "map_lanes", "map_crosswalks", "ref_line", "gt_future_states")
    return [distil(*window) for window in zip(*(arrays[name] for name in names), strict=True)]


@dataclass
class Chunk:
    """One window's part of the points and slots of a batch."""

    points: slice
    slots: slice
    walks: torch.Tensor  # flat, into the chunk's points


@dataclass
class SlotBatch:
    """The slots of a batch; the last chunk is the one empty slot that all empty slots share (its query is the row after the agents': zeros)."""

    features: torch.Tensor
    agent: torch.Tensor
    chunks: list


@dataclass
class Batch:
    size: int
    history: list  # for each kind: 20 x rows x 8; the vehicles' last row is the empty history
    encoding: torch.Tensor  # N + M tokens, into the encodings of the three kinds, one after the other
    lanes: SlotBatch
    crosswalks: SlotBatch
    slot: torch.Tensor  # (N + 1) x 10, into [lane slots, empty lane, crosswalk slots, empty crosswalk]; the last row is that of an empty agent
    masked: torch.Tensor  # (N + 1) x 10
    padded: torch.Tensor  # B x T: the tokens of each window, padded with its first
    key_masked: torch.Tensor  # B x T
    flat: torch.Tensor  # N + M, into the flattened B x T
    token: torch.Tensor  # B x 11
    agent_row: torch.Tensor  # N + M: row of `slot`, N for an empty agent
    current: torch.Tensor  # B x 11 x 8
    reference: torch.Tensor  # B x 1200 x 5
    future: torch.Tensor  # B x 11 x 50 x 5


def _join_slots(parts, empty, offsets, agents, dtype):
    chunks, point, slot = [], 0, 0
    for part in parts:
        if len(part.agent):
            points, slots = slice(point, point + len(part.points)), slice(slot, slot + len(part.agent))
            chunks.append(Chunk(points, slots, torch.from_numpy(part.walks.ravel())))
            point, slot = points.stop, slots.stop
    chunks.append(Chunk(slice(point, point + 1), slice(slot, slot + 1), torch.zeros(100, dtype=torch.int64)))
    agent = np.concatenate([part.agent + offset for part, offset in zip(parts, offsets, strict=True)] + [[agents]])
    features = np.concatenate([part.points for part in parts] + [empty])
    return SlotBatch(torch.from_numpy(features).to(dtype), torch.from_numpy(agent.astype(np.int64)), chunks)


def collate(windows, dtype):
    """The batch of these windows, in order."""
    counts = [len(window.rows) for window in windows]
    offsets = np.concatenate([[0], np.cumsum(counts)[:-1]])
    agents = sum(counts)
    kind = np.concatenate([window.kind for window in windows])
    history = np.concatenate([window.history for window in windows])
    by_kind = [np.nonzero(kind == k)[0] for k in range(3)]
    encoding = np.empty(agents, dtype=np.int64)
    start, histories = 0, []
    for k, members in enumerate(by_kind):
        rows = history[members]
        if k == 0:
            rows = np.concatenate([rows, np.zeros((1, 20, 8), np.float32)])
            empty_encoding = len(members)
        encoding[members] = start + np.arange(len(members))
        start += len(rows)
        histories.append(torch.from_numpy(np.ascontiguousarray(rows.transpose(1, 0, 2))).to(dtype))

    lane_counts = [len(window.lanes.agent) for window in windows]
    crosswalk_counts = [len(window.crosswalks.agent) for window in windows]
    empty_lane, empty_crosswalk = sum(lane_counts), sum(lane_counts) + 1 + sum(crosswalk_counts)
    slot, lane_offset, crosswalk_offset = [], 0, empty_lane + 1
    for window, lanes, crosswalks in zip(windows, lane_counts, crosswalk_counts, strict=True):
        own = window.slot.copy()
        own[:, :6] = np.where(own[:, :6] < 0, empty_lane, own[:, :6] + lane_offset)
        own[:, 6:] = np.where(own[:, 6:] < 0, empty_crosswalk, own[:, 6:] + crosswalk_offset)
        slot.append(own)
        lane_offset, crosswalk_offset = lane_offset + lanes, crosswalk_offset + crosswalks
    slot.append(np.array([[empty_lane] * 6 + [empty_crosswalk] * 4]))
    masked = np.concatenate([window.masked for window in windows] + [[[False] + [True] * 9]])

    width = max(count + (window.token == count).any() for window, count in zip(windows, counts, strict=True))
    padded, key_masked, token, flat_shared = [], [], [], []
    flat = np.empty(agents, dtype=np.int64)
    shared = agents
    for b, (window, count, offset) in enumerate(zip(windows, counts, offsets, strict=True)):
        own = list(range(offset, offset + count))
        hidden = list(window.absent)
        flat[own] = b * width + np.arange(count)
        token.append(np.where(window.token == count, shared, window.token + offset))
        if (window.token == count).any():
            own.append(shared)
            hidden.append(True)
            flat_shared.append(b * width + count)
            shared += 1
        padding = width - len(own)
        padded.append(own + [offset] * padding)
        key_masked.append(hidden + [True] * padding)
    total = shared

    def numbers(name):
        return torch.from_numpy(np.stack([getattr(window, name) for window in windows])).to(dtype)

    integers = lambda values: torch.from_numpy(np.asarray(values, dtype=np.int64))
    return Batch(
        size=len(windows),
        history=histories,
        encoding=integers(np.concatenate([encoding, np.full(total - agents, empty_encoding)])),
        lanes=_join_slots([window.lanes for window in windows], _lane_features(np.zeros((1, 17), np.float32)), offsets, agents, dtype),
        crosswalks=_join_slots([window.crosswalks for window in windows], np.zeros((1, 3), np.float32), offsets, agents, dtype),
        slot=integers(np.concatenate(slot)),
        masked=torch.from_numpy(masked),
        padded=integers(padded),
        key_masked=torch.from_numpy(np.asarray(key_masked)),
        flat=integers(np.concatenate([flat, flat_shared]).astype(np.int64)),
        token=integers(np.stack(token)),
        agent_row=integers(np.concatenate([np.arange(agents), np.full(total - agents, agents)])),
        current=numbers("current"),
        reference=numbers("reference"),
        future=numbers("future"),
    )
