"""The authors' training losses on the network's outputs."""

from dataclasses import dataclass

import torch
from torch.nn import functional as F

from . import planner

SAMPLES = [9, 19, 29, 39, 49]


@dataclass
class Losses:
    total: torch.Tensor
    multi_future: torch.Tensor
    score: torch.Tensor
    best_mode: torch.Tensor
    plan_terms: torch.Tensor | None = None
    plan_cost: torch.Tensor | None = None
    controls: torch.Tensor | None = None  # the planner's, B x 50 x 2
    residuals: torch.Tensor | None = None


def step_losses(outputs, batch, with_planner, coupled=False):
    """Losses of one step; `coupled` keeps the authors' bug of lengths chosen by the batch's first sample."""
    size = batch.size
    truth = batch.future[..., :3]
    av = batch.current[:, 0]
    driven = planner.trajectory(outputs.plans, av[:, None].expand(-1, 3, -1))
    with torch.no_grad():
        seen = truth[:, 1:] != 0
        sampled = outputs.predictions[:, :, :, SAMPLES, :2] * seen[:, None, :, SAMPLES, :2]
        apart = (sampled - truth[:, None, 1:, SAMPLES, :2]).norm(dim=-1).mean(-1).sum(-1)
        own = (driven[:, :, SAMPLES, :2] - truth[:, None, 0, SAMPLES, :2]).norm(dim=-1).mean(-1)
        best = (apart + own).argmin(1)
    rows = torch.arange(size)
    predictions = outputs.predictions[rows, best]
    futures = torch.cat([driven[rows, best].unsqueeze(1), predictions * seen], 1)
    errors = F.smooth_l1_loss(futures, truth, reduction="none")
    prediction = errors.sum() / (size * 150) + errors[:, :, -1].sum() / (size * 3)
    score = F.cross_entropy(outputs.scores, best)
    multi_future = 0.5 * prediction + score
    if not with_planner:
        return Losses(multi_future, multi_future, score, best)
    controls, residuals = planner.plan(outputs.plans[rows, best], predictions, outputs.cost_weights, batch, coupled)
    planned = F.smooth_l1_loss(planner.trajectory(controls, av), truth[:, 0], reduction="none")
    terms = torch.stack([planned.mean(), planned[:, -1].mean()])
    cost = residuals.square().sum(1).mean() / residuals.shape[1]
    return Losses(multi_future + terms.sum() + 0.001 * cost, multi_future, score, best, terms, cost, controls, residuals)
