"""The skeleton of a predictor that is a torch network: history in, futures with probabilities out.

The network below is untrained, so what it predicts is noise about constant velocity. Put yours in its place.
"""

import sys

import numpy as np

import reloop

try:
    import torch
except ImportError:
    sys.exit("error: this predictor needs torch\n  hint: pip install torch")

FUTURES = 3
HISTORY = 20  # steps
FEATURES = 7  # reloop.views.history.FIELDS


class Network(torch.nn.Module):
    """(agents, 20, 7) in each agent's own frame to (agents, 3, 50, 2) offsets in metres, and (3,) logits."""

    def __init__(self):
        super().__init__()
        self.body = torch.nn.Sequential(torch.nn.Flatten(), torch.nn.Linear(HISTORY * FEATURES, 64), torch.nn.ReLU())
        self.places = torch.nn.Linear(64, FUTURES * reloop.PLAN_STEPS * 2)
        self.logits = torch.nn.Linear(64, FUTURES)

    def forward(self, history):
        hidden = self.body(history)
        places = self.places(hidden).reshape(-1, FUTURES, reloop.PLAN_STEPS, 2)
        return places, self.logits(hidden.mean(dim=0))


class Predictor(reloop.Predictor):
    """One object for each episode; they share the network."""

    def __init__(self, network):
        self.network = network

    def predict(self, step):
        others = step.agents
        if not len(others):
            return reloop.Prediction([])
        offsets, logits = self.network(torch.from_numpy(features(step)))
        cos, sin = np.cos(others.heading), np.sin(others.heading)
        turn = np.stack([np.stack([cos, sin], axis=-1), np.stack([-sin, cos], axis=-1)], axis=-2)  # (agents, 2, 2)
        ahead = reloop.STEP_SECONDS * np.arange(1, reloop.PLAN_STEPS + 1)
        straight = others.position[:, None] + others.velocity[:, None] * ahead[:, None]  # (agents, 50, 2)
        places = straight[:, None] + np.einsum("afki,aij->afkj", offsets.double().numpy(), turn)
        headings = np.broadcast_to(others.heading[:, None, None, None], (*places.shape[:3], 1))
        poses = np.concatenate([places, headings], axis=3)  # (agents, futures, 50, 3)
        chances = torch.softmax(logits.double(), dim=0).numpy()
        return reloop.Prediction([reloop.Future(chances[f], others.track, poses[:, f]) for f in range(FUTURES)])


def features(step):
    """(agents, 20, 7), float32: places from where each agent is, in its own frame; 0 where it was not seen."""
    states = step.history.of(step.agents.track)[:, -HISTORY:].copy()
    states = np.concatenate([np.full((len(states), HISTORY - states.shape[1], FEATURES), np.nan), states], axis=1)
    now = states[:, -1:, :]
    cos, sin = np.cos(now[..., 2]), np.sin(now[..., 2])
    for x, y in ((0, 1), (3, 4)):  # places, velocities
        dx, dy = (
            (states[..., x] - now[..., x], states[..., y] - now[..., y]) if x == 0 else (states[..., x], states[..., y])
        )
        states[..., x], states[..., y] = cos * dx + sin * dy, cos * dy - sin * dx
    states[..., 2] -= now[..., 2]
    return np.nan_to_num(states).astype(np.float32)


if __name__ == "__main__":
    torch.manual_seed(0)  # where a seed is not said, runs do not repeat
    torch.set_grad_enabled(False)
    torch.set_num_threads(1)  # each worker has a process of its own
    network = Network().eval()  # network.load_state_dict(torch.load("mine.pt"))
    reloop.serve(lambda: Predictor(network))
