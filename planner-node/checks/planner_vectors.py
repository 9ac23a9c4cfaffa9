#!/usr/bin/env python3
"""Vectors of the differentiable planner, by an implementation of their own.

Computes what the authors' planner does with a situation, as `planner.md` specifies it, in the format that `planner-node
verify` reads. Derivatives are PyTorch's: the Jacobian forward, the gradients of training back through both unrolled
iterations. It shares nothing with the Rust code but that specification: where the two agree, both follow it.

    planner_vectors.py --out FOLDER      write vectors of the situations at the end of this file
    planner_vectors.py --check FOLDER    compute those in FOLDER again, print the worst deviations

Needs numpy and torch. Section numbers are those of the specification.
"""

import argparse
import math
import sys
from pathlib import Path

import numpy as np
import torch
from torch.nn.functional import smooth_l1_loss

torch.set_default_dtype(torch.float64)
torch.set_num_threads(1)

STEPS, DT, WHEELBASE = 50, 0.1, 3.089
NEIGHBORS, OWN_ROW = 10, 200
KEYS = torch.tensor([0, 2, 5, 9, 14, 19, 24, 29, 39, 49])
ROWS = torch.tensor([50, 50, 49, 50, 49, 50, 25, 50, 10])  # of each term, section 3
INPUTS = ("controls0", "predictions", "ref_line", "current_state", "weights", "target")


# --- Motion, section 2 --------------------------------------------------------------------------------------------------


def clip(value, low, high=math.inf):
    """With derivative 1 at the bounds, section 5; of `torch.clamp` that depends on the version."""
    return torch.where(value < low, low, torch.where(value > high, high, value))


def drive(controls, state, limit=0.5, turning=lambda steering: steering):
    """x, y, heading and speed (50 x 4) of an AV that starts in `state`."""
    acceleration, steering = controls.reshape(STEPS, 2).unbind(1)
    speed = clip(torch.hypot(state[3], state[4]) + DT * clip(acceleration, -5, 5).cumsum(0), 0)
    yaw_rate = speed * turning(clip(steering, -limit, limit)) / WHEELBASE
    heading = torch.fmod(state[2] + DT * yaw_rate.cumsum(0), 2 * math.pi)
    x = state[0] + DT * (speed * heading.cos()).cumsum(0)
    y = state[1] + DT * (speed * heading.sin()).cumsum(0)
    return torch.stack([x, y, heading, speed], 1)


# --- Cost, sections 3 and 4 ---------------------------------------------------------------------------------------------


def nearest(line, points):
    """The first of the nearest rows of the line."""
    return (points[..., None, :] - line[:, :2]).square().sum(-1).argmin(-1)


def frenet(line, points):
    row = nearest(line, points)
    off = points - line[row, :2]
    side = off[..., 1] * line[row, 2].cos() - off[..., 0] * line[row, 2].sin()
    return torch.stack([DT * (row - OWN_ROW), side.sign() * torch.hypot(off[..., 0], off[..., 1])], -1)


class Situation:
    def __init__(self, arrays):
        for name in INPUTS:
            setattr(self, name, torch.tensor(np.asarray(arrays[name], float)))
        info = self.ref_line[:, 4]
        self.speed_target = info.max()
        red = (info[OWN_ROW:] == 0).int().argmax().item()
        is_red = red > 0 and info[OWN_ROW + red] == 0
        self.stop = DT * red - 3 if is_red else None

    def choices(self, states, predictions):
        """What is looked up and has no derivative: nearest rows, and at each key step the neighbor to keep clear of."""
        states, predictions = states.detach(), predictions.detach()
        places = predictions[:, KEYS, :2].transpose(0, 1)
        own, others = frenet(self.ref_line, states[KEYS, :2]), frenet(self.ref_line, places)
        sizes, present = self.current_state[:, 5:7], self.current_state[1:, 7] != 0
        reach = (sizes[0, 1] + sizes[1:, 1]) / 2 + 0.5
        ahead = others[..., 0] - own[:, None, 0] > 0
        in_path = present & ahead & ((own[:, None, 1] - others[..., 1]).abs() < reach)
        off = states[KEYS, None, :2] - places
        distance = torch.where(in_path, torch.hypot(off[..., 0], off[..., 1]), 100.0)
        return nearest(self.ref_line, states[:, :2]), distance.argmin(1), in_path.any(1)

    def residuals(self, controls, predictions):
        """The 383 rows without weights."""
        acceleration, steering = controls.reshape(STEPS, 2).unbind(1)
        states = drive(controls, self.current_state[0])
        rows, other, somebody = self.choices(drive(controls.detach(), self.current_state[0]), predictions)
        unclipped = clip(torch.hypot(*self.current_state[0, 3:5]) + DT * acceleration.cumsum(0), 0)
        seen, line = states[1::2], self.ref_line[rows[1::2]]
        driven = DT * unclipped.cumsum(0)
        beyond = torch.zeros(STEPS)
        if self.stop is not None:
            beyond = torch.where(driven > self.stop, driven - self.stop, 0.0)
        off = states[KEYS, :2] - predictions[other, KEYS, :2]
        distance = torch.where(somebody, off.square().sum(1), 1e4).sqrt()
        safe = (self.current_state[0, 5] + self.current_state[other + 1, 5]) / 2 + 5
        return torch.cat([
            unclipped - self.speed_target,
            acceleration,
            acceleration.diff() / DT,
            steering,
            steering.diff() / DT,
            seen[:, 0] - line[:, 0],
            seen[:, 1] - line[:, 1],
            seen[:, 2] - line[:, 2],
            beyond,
            torch.where(distance < safe, safe - distance, 0.0),
        ])

    def weighted(self, controls, predictions, weights):
        return weights.repeat_interleave(ROWS) * self.residuals(controls, predictions)

    def linearised(self, controls, predictions, weights):
        """Weighted rows and their Jacobian."""
        residuals = lambda controls: self.weighted(controls, predictions, weights)
        return residuals(controls), torch.func.jacfwd(residuals)(controls)


# --- Search, section 6 --------------------------------------------------------------------------------------------------


def test(situation):
    """The iterates, their objectives, and how it ended."""
    inputs = situation.predictions, situation.weights
    objective = lambda controls: 0.5 * situation.weighted(controls, *inputs).square().sum().item()
    iterates = [situation.controls0.flatten()]
    history = [objective(iterates[0])]
    best = history[0]
    words = {"test_best_iter": 0, "test_converged_iter": -1, "test_status": 2}
    best_controls = iterates[0]
    for iteration in range(50):
        rows, jacobian = situation.linearised(iterates[-1], *inputs)
        factor, failed = torch.linalg.cholesky_ex(jacobian.T @ jacobian)
        if failed or not factor.isfinite().all():
            words.update(test_converged_iter=iteration, test_status=-1)
            break
        step = torch.cholesky_solve(-(jacobian.T @ rows)[:, None], factor)[:, 0]
        iterates.append(iterates[-1] + 0.2 * step)
        history.append(objective(iterates[-1]))
        before, now = history[-2:]
        if now < best:
            best, best_controls = now, iterates[-1]
            words["test_best_iter"] = iteration
        elif math.isnan(now):
            best = now
        if abs(now) < 1e-2 or abs(before - now) < 1e-2 or abs(before - now) / before < 1e-8:
            words.update(test_converged_iter=iteration + 1, test_status=1)
            break
    state = situation.current_state[0]
    return {
        "test_iterates": torch.stack(iterates).reshape(-1, STEPS, 2),
        "test_objective_history": history,
        "test_iterations": len(history) - 1,
        "test_best_controls": best_controls.reshape(STEPS, 2),
        "test_final_controls": iterates[-1].reshape(STEPS, 2),
        "test_best_traj": drive(best_controls, state),
        "test_best_traj_output": drive(best_controls, state, limit=0.6, turning=torch.tan),
        **words,
    }


# --- Training, section 8 ------------------------------------------------------------------------------------------------


def train(situation):
    """Two unrolled iterations, the losses, and their gradients by controls, predictions and weights."""
    start = [situation.controls0.flatten(), situation.predictions, situation.weights]
    leaves = [one.clone().requires_grad_() for one in start]
    controls, *inputs = leaves
    for _ in range(2):
        rows, jacobian = situation.linearised(controls, *inputs)
        try:
            controls = controls - 0.4 * torch.linalg.solve(jacobian.T @ jacobian, jacobian.T @ rows)
        except torch.linalg.LinAlgError:
            return {"train_status": -1}
    states = drive(controls, situation.current_state[0], limit=0.6)
    squares = situation.weighted(controls, *inputs).square().sum()
    simple = smooth_l1_loss(states[:, :3], situation.target)
    whole = simple + smooth_l1_loss(states[-1, :3], situation.target[-1]) + 1e-3 * squares / 383
    found = {
        "train_status": 2,
        "train_controls": controls.reshape(STEPS, 2),
        "train_traj": states,
        "train_objective": 0.5 * squares,
    }
    for name, loss in (("simple", simple), ("train", whole)):
        by = torch.autograd.grad(loss, leaves, retain_graph=True, materialize_grads=True)
        found[f"loss_{name}"] = loss
        found[f"grad_{name}_controls"] = by[0].reshape(STEPS, 2)
        found[f"grad_{name}_predictions"], found[f"grad_{name}_weights"] = by[1:]
    return found


def vectors(arrays):
    """All that is computed of a situation, by the names of the vectors."""
    situation = Situation(arrays)
    states = drive(situation.controls0.flatten(), situation.current_state[0])
    rows, jacobian = situation.linearised(situation.controls0.flatten(), situation.predictions, situation.weights)
    found = {
        "traj0": states,
        "nearest0": nearest(situation.ref_line, states[:, :2]).int(),
        "frenet_ego0": frenet(situation.ref_line, states[:, :2]),
        "frenet_neighbors0": frenet(situation.ref_line, situation.predictions[:, KEYS, :2].transpose(0, 1)),
        "residual_weighted": rows,
        "jacobian": jacobian,
        **test(situation),
        **train(situation),
    }
    return {name: np.asarray(value.detach() if torch.is_tensor(value) else value) for name, value in found.items()}


# --- Situations of our own ----------------------------------------------------------------------------------------------

CAR, TRUCK, BICYCLE, PEDESTRIAN = (4.6, 1.9, 1.5), (9.5, 2.5, 3.2), (1.8, 0.7, 1.7), (0.6, 0.6, 1.8)


def reference_line(pieces, limit, side=0.0, red=None, crosswalk=None):
    """Pieces of (metres, curvature) from 20 m behind the AV, which is `side` metres to the left of it; the last one goes on. Red
    rows and a crosswalk are from .. to metres ahead."""
    ends = np.cumsum([metres for metres, _ in pieces])[:-1]
    curvature = np.array([curvature for _, curvature in pieces])[np.searchsorted(ends, DT * np.arange(1200), "right")]
    heading = np.concatenate([[0.0], np.cumsum(DT * curvature[:-1])])
    middle = heading + DT * curvature / 2
    x = np.concatenate([[0.0], np.cumsum(DT * np.cos(middle))[:-1]])
    y = np.concatenate([[0.0], np.cumsum(DT * np.sin(middle))[:-1]])
    # The AV's frame: at the line's row 200, along it.
    turn = -heading[OWN_ROW]
    x, y = x - x[OWN_ROW], y - y[OWN_ROW]
    x, y = x * math.cos(turn) - y * math.sin(turn), x * math.sin(turn) + y * math.cos(turn) - side
    info = np.full(1200, limit)
    for value, stretch in ((1.0, crosswalk), (0.0, red)):
        if stretch:
            info[OWN_ROW + round(stretch[0] / DT) : OWN_ROW + round(stretch[1] / DT)] = value
    heading = (heading + turn + math.pi) % (2 * math.pi) - math.pi
    return np.column_stack([x, y, heading, curvature, info])


def along(line, start, speed, side=0.0, acceleration=0.0):
    """Poses (50 x 3) of one who follows the line from `start` metres ahead of the AV."""
    time = DT * np.arange(1, STEPS + 1)
    time = np.minimum(time, -speed / acceleration) if acceleration < 0 else time
    row = OWN_ROW + (start + speed * time + acceleration * time**2 / 2) / DT
    low = np.clip(row.astype(int), 0, 1198)
    share = (row - low)[:, None]
    x, y = ((1 - share) * line[low, :2] + share * line[low + 1, :2]).T
    heading = line[low, 2]
    return np.column_stack([x - side * np.sin(heading), y + side * np.cos(heading), heading])


def straight(x, y, heading, speed):
    way = speed * DT * np.arange(1, STEPS + 1)
    return np.column_stack([x + way * math.cos(heading), y + way * math.sin(heading), np.full(STEPS, heading)])


def stored(line, own, neighbors, weights, target, controls=(0.0, 0.0)):
    """The inputs, in single precision as the authors' are. `own`: x, y, heading and speed of the AV; `neighbors`: poses and size
    of each."""
    state, predictions = np.zeros((NEIGHBORS + 1, 8)), np.zeros((NEIGHBORS, STEPS, 3))
    x, y, heading, speed = own
    state[0] = [x, y, heading, speed * math.cos(heading), speed * math.sin(heading), 4.8, 2.0, 1.6]
    for j, (poses, size) in enumerate(neighbors):
        predictions[j] = poses
        velocity = (poses[1, :2] - poses[0, :2]) / DT
        state[j + 1] = [*(poses[0, :2] - DT * velocity), poses[0, 2], *velocity, *size]
    arrays = dict(controls0=np.broadcast_to(np.asarray(controls, float), (STEPS, 2)), predictions=predictions)
    arrays.update(ref_line=line, current_state=state, weights=weights, target=target)
    return {name: np.float32(value) for name, value in arrays.items()}


def situations():
    """By name."""
    wave = np.sin(np.arange(STEPS) / 6)[:, None] * [0.8, 0.03]

    # Left into a bend of 55 m, two slow cars ahead, a red light behind them.
    line = reference_line([(32, 0), (60, 1 / 55), (28, 0)], 11.2, side=0.3, red=(41, 41.4))
    slow = [(along(line, 17, 5.5, 0.2, -0.4), CAR), (along(line, 29, 4.0, -0.1, -0.6), TRUCK)]
    weights = [0.15, 0.4, 0.12, 0.02, 0.6, 0.45, 4, 9, 11]
    yield "bend", stored(line, (0, 0, 0, 8.7), slow, weights, along(line, 0, 8.7, acceleration=-1.5))

    # An S to the left, between seven others.
    line = reference_line([(26, 0), (18, 1 / 90), (18, -1 / 90), (58, 0)], 16.5, side=-0.2)
    ahead, behind = [(12, 11.0), (27, 12.5), (46, 13.0)], [(-7, 13.5), (-19, 14.0)]
    others = [(along(line, start, speed, 0.1 * start / 10), CAR) for start, speed in ahead + behind]
    others += [(straight(35, -0.3, 0.02, 8.0), TRUCK), (straight(9, -3.4, 0.0, 6.0), BICYCLE)]
    weights = [0.2, 0.6, 0.15, 0.05, 0.5, 0.5, 6, 10, 8]
    yield "merge", stored(line, (0.2, -0.1, 0.01, 12.4), others, weights, along(line, 0, 12.4), wave)

    # Standing behind a car before a red light; the others' rows are zeros, at the AV's own place.
    line = reference_line([(120, 0)], 8.3, red=(9.5, 9.9))
    waiting = [(straight(7.4, 0.1, 0.0, 0.0), CAR), (straight(3.0, 4.0, -1.6, 0.0), PEDESTRIAN)]
    weights = [0.1, 0.5, 0.2, 0.3, 0.5, 0.5, 5, 10, 10]
    yield "standstill", stored(line, (0, 0, 0, 0), waiting, weights, straight(0, 0, 0, 0.05))

    # Braking harder than the model lets anybody brake, for a lorry that stands and a pedestrian who crosses.
    line = reference_line([(70, 0), (50, -1 / 200)], 13.9, crosswalk=(20, 23))
    weights = [0.1, 0.3, 0.1, 0.04, 0.4, 0.5, 5, 10, 10]
    standing = [(straight(27, 0.4, 0.1, 0.0), TRUCK), (straight(21, -4.5, 1.5, 1.4), PEDESTRIAN)]
    target = along(line, 0, 13.2, acceleration=-3.4)
    yield "hard-braking", stored(line, (0, 0, 0, 13.2), standing, weights, target, [-5.5, 0.01] + wave)

    # Right at a crossing, nobody there.
    line = reference_line([(28, 0), (17, -1 / 11), (75, 0)], 9.7, side=0.15, crosswalk=(6, 9))
    weights = [0.05, 0.5, 0.1, 0.02, 0.5, 0.6, 6, 10, 10]
    yield "right-turn", stored(line, (0, 0, 0, 5.6), [], weights, along(line, 0, 5.6), [0.2, -0.1])

    # Round to the left until the heading jumps from pi to -pi, steering as far as the model lets anybody steer.
    line = reference_line([(23, 0), (28, 1 / 8), (69, 0)], 7.0)
    oncoming = [(straight(12, 11, math.pi, 5.0), CAR), (straight(2, 16.2, 0.0, 4.0), BICYCLE)]
    weights = [0.1, 0.4, 0.1, 0.01, 0.3, 0.5, 2, 10, 10]
    yield "u-turn", stored(line, (0, 0, 0, 5.0), oncoming, weights, along(line, 0, 5.0), [0.0, 0.4] + wave)

    # Standing where nothing but position has a price, so that steering has none.
    line = reference_line([(120, 0)], 5.0)
    weights = [0.1, 0, 0, 0, 0, 0.5, 0, 10, 10]
    yield "unsolvable", stored(line, (0, 0, 0, 0), [], weights, straight(0, 0, 0, 0.0))


# --- The command --------------------------------------------------------------------------------------------------------


def check(folder):
    """Prints the worst deviation of each array over the larger of 1 and the number that it should be, and the case."""
    worst = {}
    for path in sorted(folder.glob("*.npz")):
        with np.load(path) as theirs:
            for name, ours in vectors(theirs).items():
                wanted = theirs[name]
                off = math.inf
                if ours.shape == wanted.shape:
                    off = np.max(np.abs(ours - wanted) / np.maximum(1.0, np.abs(wanted)), initial=0.0)
                worst[name] = max(worst.get(name, (0.0, path.stem)), (math.inf if np.isnan(off) else off, path.stem))
    for name, (off, case) in worst.items():
        print(f"{name:24} {off:.1e}  {case}")
    return 0 if worst else "nothing to compare"


def main():
    arguments = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    to = arguments.add_mutually_exclusive_group(required=True)
    to.add_argument("--out", type=Path, help="folder to write vectors to")
    to.add_argument("--check", type=Path, help="folder of vectors to compare with")
    given = arguments.parse_args()
    if given.check:
        return check(given.check)
    given.out.mkdir(parents=True, exist_ok=True)
    for name, arrays in situations():
        found = vectors(arrays)
        # Some are views in another order, which the reader does not know.
        in_order = {name: value.copy(order="C") for name, value in {**arrays, **found}.items()}
        np.savez_compressed(given.out / f"{name}.npz", **in_order)
        print(f"{name:16} {found['test_iterations']} iterations, status {found['test_status']}")


if __name__ == "__main__":
    sys.exit(main())
