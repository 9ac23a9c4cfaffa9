"""The differentiable planner: two Gauss-Newton iterations of step 0.4, unrolled, one dense system of 100 unknowns for each sample.

The Jacobian is written down in closed form, never obtained by differentiating. On the way back, a step d = -A^-1 J'r (A = J'J) passes a gradient g on as
that of -(mu' r + rho' J lambda + mu' J d) with lambda = A^-1 g, mu = J lambda and rho = r + J d held fixed; J lambda and J d are derivatives of the
residuals along a direction, which take O(50) each and which autograd differentiates once more.

Controls are B x 100, all accelerations first, then all steering angles; residuals are 383 a sample: speed 50, acceleration 50, jerk 49, steering 50,
steering change 49, lane position 50, lane heading 25, red light 50, safety 10.
"""

import math
from dataclasses import dataclass

import torch

STEP = 0.1
WHEELBASE = 3.089
TURN = 2.0 * math.pi
ROWS = (50, 50, 49, 50, 49, 50, 25, 50, 10)
KEYS = [0, 2, 5, 9, 14, 19, 24, 29, 39, 49]
ODD = slice(1, None, 2)


@dataclass
class Rollout:
    """Where controls lead; B x 50 each."""

    accelerates: torch.Tensor  # 1 where the acceleration is not clamped
    steers: torch.Tensor  # 1 where the steering angle is not clamped
    steering: torch.Tensor  # clamped
    moving: torch.Tensor  # 1 where the speed is not clamped
    speed: torch.Tensor
    turned: torch.Tensor  # heading, wrapped as C's fmod does
    cos: torch.Tensor
    sin: torch.Tensor
    x: torch.Tensor
    y: torch.Tensor


def roll_out(controls, current, limit):
    """The motion model, steering clamped to `limit`; `current` is the AV's row (B x 8), wheelbase and limits those of the authors."""
    a, steering = controls[:, :50], controls[:, 50:]
    start = torch.hypot(current[:, 3], current[:, 4])[:, None]
    sum_speed = start + STEP * a.clamp(-5.0, 5.0).cumsum(1)
    speed = sum_speed.clamp(min=0.0)
    clamped = steering.clamp(-limit, limit)
    turned = torch.fmod(current[:, 2:3] + (STEP / WHEELBASE) * (speed * clamped).cumsum(1), TURN)
    cos, sin = turned.cos(), turned.sin()
    x = current[:, 0:1] + STEP * (speed * cos).cumsum(1)
    y = current[:, 1:2] + STEP * (speed * sin).cumsum(1)
    ones = lambda condition: condition.to(controls.dtype)
    return Rollout(ones(a.abs() <= 5.0), ones(steering.abs() <= limit), clamped, ones(sum_speed >= 0.0), speed, turned, cos, sin, x, y)


def trajectory(controls, current):
    """... x 50 x 2 controls to ... x 50 x 3 (x, y, heading), by the training utilities' copy of the model: steering clamped to 0.6."""
    flat = controls.reshape(-1, 50, 2).transpose(1, 2).reshape(-1, 100)
    rolled = roll_out(flat, current.reshape(-1, 8), 0.6)
    return torch.stack([rolled.x, rolled.y, rolled.turned], -1).view(*controls.shape[:-1], 3)


def _nearest(line, x, y):
    """The first nearest sample of the line (B x 1200) for every position (B x K), and its distance."""
    squares = (x.unsqueeze(-1) - line[:, None, :, 0]).square_().add_((y.unsqueeze(-1) - line[:, None, :, 1]).square_())
    distance, index = squares.min(-1)
    return index, distance.sqrt_()


def _lateral(line, index, distance, x, y):
    """Signed distance: positive to the left of the line."""
    at = line.gather(1, index.unsqueeze(-1).expand(-1, -1, 3))
    cross = (y - at[..., 1]) * at[..., 2].cos() - (x - at[..., 0]) * at[..., 2].sin()
    return cross.sign() * distance


class Scenes:
    """What of a batch's scenes does not depend on the controls."""

    def __init__(self, reference, current, predictions, coupled):
        """`predictions` B x 10 x 50 x 3; `coupled`: the authors' bug, lengths chosen by the first sample of the batch."""
        dtype = current.dtype
        self.line = reference[..., :3].contiguous()
        self.av = current[:, 0]
        self.start = torch.hypot(self.av[:, 3], self.av[:, 4])[:, None]
        self.coupled = coupled
        self.limit = reference[..., 4].amax(1, keepdim=True)
        ahead = (reference[:, 200:, 4] == 0).to(torch.int64)
        red = ahead.argmax(1)
        self.red_ahead = (red != 0)[:, None]
        self.stop = (STEP * red - 3.0).to(dtype)[:, None]
        neighbors = current[:, 1:]
        self.present = (neighbors[..., 7] != 0).unsqueeze(1)
        self.gap = ((self.av[:, 5:6] + neighbors[..., 5]) / 2 + 5.0).unsqueeze(1).expand(-1, 10, -1)
        self.window = ((self.av[:, 6:7] + neighbors[..., 6]) / 2 + 0.5).unsqueeze(1)
        with torch.no_grad():
            places = predictions[:, :, KEYS, :2].transpose(1, 2).reshape(-1, 100, 2)
            index, distance = _nearest(self.line, places[..., 0], places[..., 1])
            self.neighbor_index = index.view(-1, 10, 10)
            self.neighbor_lateral = _lateral(self.line, index, distance, places[..., 0], places[..., 1]).view(-1, 10, 10)


@dataclass
class Choices:
    """What the controls decide without a gradient: nearest samples of the line, and whom to keep a distance from."""

    lane: torch.Tensor  # B x 25 x 3
    whom: torch.Tensor  # B x 10: the nearest interacting neighbour at each key step
    interacts: torch.Tensor  # B x 10
    gap: torch.Tensor  # B x 10, in the residual
    own_gap: torch.Tensor  # B x 10, in the Jacobian (differs under the authors' bug alone)


def _choose(scenes, rolled, places):
    """`places`: neighbours at the key steps, B x 10 steps x 10 neighbours x 2."""
    steps = list(range(1, 50, 2)) + KEYS
    x, y = rolled.x[:, steps], rolled.y[:, steps]
    index, distance = _nearest(scenes.line, x, y)
    lane = scenes.line.gather(1, index[:, :25, None].expand(-1, -1, 3))
    lateral = _lateral(scenes.line, index, distance, x, y)[:, 25:, None]
    interacts = scenes.present & (scenes.neighbor_index > index[:, 25:, None]) & ((lateral - scenes.neighbor_lateral).abs() < scenes.window)
    apart = torch.hypot(x[:, 25:, None] - places[..., 0], y[:, 25:, None] - places[..., 1])
    whom = torch.where(interacts, apart, 100.0).argmin(-1)
    own_gap = scenes.gap.gather(2, whom.unsqueeze(-1)).squeeze(-1)
    gap = scenes.gap.gather(2, whom[:1, :, None].expand(len(whom), -1, -1)).squeeze(-1) if scenes.coupled else own_gap
    return Choices(lane, whom, interacts.gather(2, whom.unsqueeze(-1)).squeeze(-1), gap, own_gap)


def _apart(rolled, places, choices):
    """Vector from the neighbour to keep away from, and its length: 100 m where there is none."""
    other = places.gather(2, choices.whom[:, :, None, None].expand(-1, -1, 1, 2)).squeeze(2)
    vector = torch.stack([rolled.x[:, KEYS], rolled.y[:, KEYS]], -1) - other
    squares = vector.square().sum(-1)
    real = choices.interacts & (squares > 0.0)
    return vector, torch.where(real, torch.where(real, squares, 1.0).sqrt(), torch.where(choices.interacts, 0.0, 100.0).to(squares.dtype))


def _raw(controls, scenes):
    """Speed and way from unclamped accelerations, which two of the terms use, and where that speed is not clamped."""
    sum_speed = scenes.start + STEP * controls[:, :50].cumsum(1)
    speed = sum_speed.clamp(min=0.0)
    return speed, STEP * speed.cumsum(1), (sum_speed >= 0.0).to(controls.dtype)


def _changes(values):
    return (values[:, 1:] - values[:, :-1]) / STEP


def row_weights(weights):
    """The nine weights, each repeated for its term's rows: 383."""
    return weights.repeat_interleave(torch.tensor(ROWS))


def residuals(controls, places, rows, scenes, rolled, choices):
    """Weighted residuals, B x 383; `rows` are `row_weights`."""
    a, steering = controls[:, :50], controls[:, 50:]
    speed, way, _ = _raw(controls, scenes)
    over = way - scenes.stop
    _, distance = _apart(rolled, places, choices)
    terms = [
        speed - scenes.limit,
        a,
        _changes(a),
        steering,
        _changes(steering),
        rolled.x[:, ODD] - choices.lane[..., 0],
        rolled.y[:, ODD] - choices.lane[..., 1],
        rolled.turned[:, ODD] - choices.lane[..., 2],
        torch.where((over > 0.0) & scenes.red_ahead, over, 0.0),
        torch.where(distance < choices.gap, choices.gap - distance, 0.0),
    ]
    return rows * torch.cat(terms, 1)


def along(direction, controls, places, rows, scenes, rolled, choices):
    """Derivatives of the residuals along directions (D x B x 100): D x B x 383."""
    a, steering = direction[..., :50], direction[..., 50:]
    _, way, raw_moving = _raw(controls, scenes)
    speed = rolled.moving * (STEP * (rolled.accelerates * a).cumsum(-1))
    turned = (STEP / WHEELBASE) * (speed * rolled.steering + rolled.speed * (rolled.steers * steering)).cumsum(-1)
    x = STEP * (speed * rolled.cos - rolled.speed * rolled.sin * turned).cumsum(-1)
    y = STEP * (speed * rolled.sin + rolled.speed * rolled.cos * turned).cumsum(-1)
    raw_speed = raw_moving * (STEP * a.cumsum(-1))
    vector, distance = _apart(rolled, places, choices)
    near = choices.interacts & (distance < choices.own_gap) & (distance > 0.0)
    away = (vector[..., 0] * x[..., KEYS] + vector[..., 1] * y[..., KEYS]) / torch.where(near, distance, 1.0)
    terms = [
        raw_speed,
        a,
        (a[..., 1:] - a[..., :-1]) / STEP,
        steering,
        (steering[..., 1:] - steering[..., :-1]) / STEP,
        x[..., ODD],
        y[..., ODD],
        turned[..., ODD],
        torch.where((way > scenes.stop) & scenes.red_ahead, STEP * raw_speed.cumsum(-1), 0.0),
        torch.where(near, -away, 0.0),
    ]
    return rows * torch.cat(terms, -1)


def jacobian(controls, places, rows, scenes, rolled, choices):
    """Weighted, B x 383 x 100, from prefix sums over the steps."""
    size, dtype = len(controls), controls.dtype
    before = lambda sums: torch.nn.functional.pad(sums, (1, 0))[:, :-1]
    lower = torch.ones(50, 50, dtype=dtype).tril_()
    turn = (STEP * STEP / WHEELBASE) * (rolled.moving * rolled.steering).cumsum(1)  # G
    ahead = STEP * STEP * (rolled.moving * rolled.cos).cumsum(1)  # C
    aside = STEP * STEP * (rolled.moving * rolled.sin).cumsum(1)  # S
    swing_x = STEP * (rolled.speed * rolled.sin * turn).cumsum(1)  # P
    swing_y = STEP * (rolled.speed * rolled.cos * turn).cumsum(1)  # Q
    steer = (STEP / WHEELBASE) * rolled.speed * rolled.steers
    x_before = torch.cat([scenes.av[:, 0:1], rolled.x[:, :-1]], 1)
    y_before = torch.cat([scenes.av[:, 1:2], rolled.y[:, :-1]], 1)

    def between(sums, at, first):
        """Sums from step i to t for the steps `at`: B x t x i."""
        return sums[:, at, None] - first[:, None, :]

    def pose(at):
        """d(x, y, heading) at the steps `at` by accelerations and by steering."""
        mask = lower[at]
        dx, dy = between(rolled.x, at, x_before), between(rolled.y, at, y_before)
        by_a, by_s, turn_before = (rolled.accelerates[:, None] * mask), (steer[:, None] * mask), before(turn)[:, None]
        x_a = by_a * (between(ahead, at, before(ahead)) - between(swing_x, at, before(swing_x)) + turn_before * dy)
        y_a = by_a * (between(aside, at, before(aside)) + between(swing_y, at, before(swing_y)) - turn_before * dx)
        return torch.cat([x_a, -by_s * dy], -1), torch.cat([y_a, by_s * dx], -1), torch.cat([by_a * between(turn, at, before(turn)), by_s], -1)

    _, way, raw_moving = _raw(controls, scenes)
    out = torch.zeros(size, 383, 100, dtype=dtype)
    out[:, 0:50, :50] = STEP * raw_moving[:, :, None] * lower
    identity = torch.eye(50, dtype=dtype)
    change = (identity[1:] - identity[:-1]) / STEP
    out[:, 50:100, :50], out[:, 100:149, :50] = identity, change
    out[:, 149:199, 50:], out[:, 199:248, 50:] = identity, change
    out[:, 248:273], out[:, 273:298], out[:, 298:323] = pose(list(range(1, 50, 2)))
    stopped = ((way > scenes.stop) & scenes.red_ahead).to(dtype)
    moved = STEP * STEP * raw_moving.cumsum(1)
    out[:, 323:373, :50] = stopped[:, :, None] * (moved[:, :, None] - before(moved)[:, None]) * lower
    vector, distance = _apart(rolled, places, choices)
    near = choices.interacts & (distance < choices.own_gap) & (distance > 0.0)
    normal = torch.where(near.unsqueeze(-1), -vector / torch.where(near, distance, 1.0).unsqueeze(-1), 0.0)
    key_x, key_y, _ = pose(KEYS)
    out[:, 373:] = normal[..., 0:1] * key_x + normal[..., 1:2] * key_y
    return out.mul_(rows[:, None])


class GaussNewtonStep(torch.autograd.Function):
    """The step d (B x 100) at these controls, and half the squared norm of the residuals there."""

    @staticmethod
    def forward(ctx, controls, places, rows, scenes):
        rolled = roll_out(controls, scenes.av, 0.5)
        choices = _choose(scenes, rolled, places)
        error = residuals(controls, places, rows, scenes, rolled, choices)
        slope = jacobian(controls, places, rows, scenes, rolled, choices)
        factor, pivots = torch.linalg.lu_factor(slope.transpose(1, 2) @ slope)
        step = torch.linalg.lu_solve(factor, pivots, -(slope.transpose(1, 2) @ error.unsqueeze(-1)))
        ctx.scenes, ctx.choices, ctx.slope, ctx.factor, ctx.pivots = scenes, choices, slope, factor, pivots
        ctx.remaining = error + (slope @ step).squeeze(-1)
        ctx.save_for_backward(controls, places, rows)
        ctx.step = step.squeeze(-1)
        objective = 0.5 * error.square().sum(1)
        ctx.mark_non_differentiable(objective)
        return ctx.step.clone(), objective

    @staticmethod
    def backward(ctx, grad, _):
        scenes, choices = ctx.scenes, ctx.choices
        adjoint = torch.linalg.lu_solve(ctx.factor, ctx.pivots, grad.unsqueeze(-1))
        seen = (ctx.slope @ adjoint).squeeze(-1)
        with torch.enable_grad():
            inputs = [tensor.detach().requires_grad_(True) for tensor in ctx.saved_tensors]
            controls, places, rows = inputs
            rolled = roll_out(controls, scenes.av, 0.5)
            error = residuals(controls, places, rows, scenes, rolled, choices)
            slopes = along(torch.stack([adjoint.squeeze(-1), ctx.step]), controls, places, rows, scenes, rolled, choices)
            total = -((seen * error).sum() + (ctx.remaining * slopes[0]).sum() + (seen * slopes[1]).sum())
        grads = torch.autograd.grad(total, inputs)
        del ctx.scenes, ctx.choices, ctx.slope, ctx.factor, ctx.pivots, ctx.remaining, ctx.step
        return *grads, None


def plan(controls, predictions, weights, batch, coupled):
    """Final controls (B x 50 x 2) and the weighted residuals there (B x 383), from a mode's plan and predictions."""
    scenes = Scenes(batch.reference, batch.current, predictions, coupled)
    places = predictions[:, :, KEYS, :2].transpose(1, 2)
    rows = row_weights(weights)
    u = controls.transpose(1, 2).reshape(-1, 100)
    moves, last = torch.ones(len(u), 1, dtype=torch.bool), None
    for _ in range(2):
        step, objective = GaussNewtonStep.apply(u, places, rows, scenes)
        if last is not None:
            change = (last - objective).abs()
            moves = ~((objective.mean() < 1e-10) | (change < 1e-10) | (change / last < 1e-8))[:, None]
        last = objective
        u = u + 0.4 * torch.where(moves, step, 0.0)
    rolled = roll_out(u, scenes.av, 0.5)
    with torch.no_grad():
        choices = _choose(scenes, rolled, places)
    return u.view(-1, 2, 50).transpose(1, 2), residuals(u, places, rows, scenes, rolled, choices)
