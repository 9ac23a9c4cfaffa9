"""One step of d3rlpy's CQL on a batch, networks and noise of ours: what it says of them, and what it makes of the networks.

    python d3rlpy_step.py FOLDER

FOLDER has `checkpoint.safetensors` (networks) and `before.safetensors` (batch and noise), which the test `d3rlpy` of this crate writes. Writes `after.safetensors`: losses,
Adam's means of the gradients (a tenth of the gradients), and targets after the step. Needs d3rlpy 2.8.1 and what it imports (torch among it).

Numbers of ours lie place by place, all channels together; PyTorch's lie channel by channel, and its dense layer of a critic sees picture and action side by side.
"""

import pathlib
import sys

import d3rlpy
import numpy as np
import torch
from d3rlpy.algos import CQLConfig
from d3rlpy.models.encoders import PixelEncoderFactory
from d3rlpy.torch_utility import TorchMiniBatch
from safetensors.numpy import load_file, save_file

assert d3rlpy.__version__ == "2.8.1", d3rlpy.__version__
folder = pathlib.Path(sys.argv[1])
before = load_file(folder / "before.safetensors") | load_file(folder / "checkpoint.safetensors")
side, channels, actions, dense, samples = (int(value) for value in before["sizes"])
filters = [[int(value) for value in row] for row in before["filters"]]
count = len(before["rewards"])


def pictures(name):
    """Channel by channel."""
    numbers = before[name].reshape(count, side, side, channels) / np.float32(255.0)
    return torch.tensor(np.ascontiguousarray(numbers.transpose(0, 3, 1, 2)))


def grids():
    """Side and channels of what each convolution sees, and of what comes out."""
    all_, now = [(side, channels)], side
    for number, kernel, stride in filters:
        now = (now - kernel) // stride + 1
        all_.append((now, number))
    return all_


def to_torch(prefix, heads):
    """Ours under their names in a module of theirs."""
    state = {}
    for layer, ((number, kernel, _), (_, inputs)) in enumerate(zip(filters, grids())):
        weight = before[f"{prefix}convolution.{layer}.weight"].reshape(number, kernel, kernel, inputs)
        # Convolution, activation, dropout.
        state[f"_encoder._cnn_layers.{2 * layer}.weight"] = weight.transpose(0, 3, 1, 2)
        state[f"_encoder._cnn_layers.{2 * layer}.bias"] = before[f"{prefix}convolution.{layer}.bias"]
    last, last_channels = grids()[-1]
    weight = before[f"{prefix}dense.weight"].reshape(dense, last, last, last_channels).transpose(0, 3, 1, 2).reshape(dense, -1)
    if f"{prefix}dense.action" in before:
        weight = np.concatenate([weight, before[f"{prefix}dense.action"]], axis=1)
    state["_encoder._last_layers.0.weight"] = weight
    state["_encoder._last_layers.0.bias"] = before[f"{prefix}dense.bias"]
    for own, theirs in heads:
        state[f"{theirs}.weight"], state[f"{theirs}.bias"] = before[f"{prefix}{own}.weight"], before[f"{prefix}{own}.bias"]
    return {name: torch.tensor(np.ascontiguousarray(value)) for name, value in state.items()}


def to_ours(prefix, heads, state):
    """And back."""
    ours = {}
    for layer, (number, _, _) in enumerate(filters):
        weight = state[f"_encoder._cnn_layers.{2 * layer}.weight"]
        ours[f"{prefix}convolution.{layer}.weight"] = weight.transpose(0, 2, 3, 1).reshape(number, -1)
        ours[f"{prefix}convolution.{layer}.bias"] = state[f"_encoder._cnn_layers.{2 * layer}.bias"]
    last, last_channels = grids()[-1]
    weight, flat = state["_encoder._last_layers.0.weight"], last * last * last_channels
    ours[f"{prefix}dense.weight"] = weight[:, :flat].reshape(dense, last_channels, last, last).transpose(0, 2, 3, 1).reshape(dense, -1)
    if weight.shape[1] > flat:
        ours[f"{prefix}dense.action"] = weight[:, flat:]
    ours[f"{prefix}dense.bias"] = state["_encoder._last_layers.0.bias"]
    for own, theirs in heads:
        ours[f"{prefix}{own}.weight"], ours[f"{prefix}{own}.bias"] = state[f"{theirs}.weight"], state[f"{theirs}.bias"]
    return ours


POLICY, CRITIC = [("mean", "_mu"), ("deviation", "_logstd")], [("value", "_fc")]

encoder = PixelEncoderFactory(filters=filters, feature_size=dense)
algorithm = CQLConfig(actor_encoder_factory=encoder, critic_encoder_factory=encoder, batch_size=count, n_action_samples=samples).create(device="cpu:0")
algorithm.create_impl((channels, side, side), actions)
implementation = algorithm.impl
modules = implementation.modules
modules.policy.load_state_dict(to_torch("policy.", POLICY))
for number in (0, 1):
    modules.q_funcs[number].load_state_dict(to_torch(f"critic.{number}.", CRITIC))
    modules.targ_q_funcs[number].load_state_dict(to_torch(f"target.{number}.", CRITIC))

# Their draws in the order in which they come: of the policy now and a step later (sample, transition, number), anywhere, and of the policy that is judged.
draws = [before["noise.now"].transpose(1, 0, 2), before["noise.next"].transpose(1, 0, 2), before["noise.actor"]]
draws = [torch.tensor(np.ascontiguousarray(draw)) for draw in draws]


def rsample(self, sample_shape=torch.Size()):
    noise = draws.pop(0)
    assert noise.shape == self._extended_shape(torch.Size(sample_shape)), (noise.shape, sample_shape)
    return self.loc + noise * self.scale


torch.distributions.Normal.rsample = rsample
anywhere = torch.tensor(before["noise.anywhere"].reshape(-1, actions))
torch.Tensor.uniform_ = lambda self, low, high: self.copy_(anywhere)

column = lambda name: torch.tensor(before[name]).reshape(-1, 1)
batch = TorchMiniBatch(
    observations=pictures("states"), actions=torch.tensor(before["actions"]), rewards=column("rewards"),
    next_observations=pictures("nexts"), next_actions=torch.tensor(before["actions"]), returns_to_go=torch.zeros(count, 1),
    terminals=column("terminals"), intervals=torch.ones(count, 1), device="cpu:0",
)
metrics = implementation.inner_update(batch, 0)
assert not draws
print({name: float(value) for name, value in metrics.items()})

def means(module, optimiser):
    """Adam's means of the gradients, by parameter."""
    return {name: optimiser.optim.state[value]["exp_avg"].numpy() for name, value in module.named_parameters()}


after = to_ours("exp_avg.policy.", POLICY, means(modules.policy, modules.actor_optim))
for number in (0, 1):
    after |= to_ours(f"exp_avg.critic.{number}.", CRITIC, means(modules.q_funcs[number], modules.critic_optim))
    target = {name: value.numpy() for name, value in modules.targ_q_funcs[number].state_dict().items()}
    after |= to_ours(f"target.{number}.", CRITIC, target)
bellman = float(metrics["critic_loss"]) - float(metrics["conservative_loss"])
report = [bellman, metrics["conservative_loss"], metrics["alpha"], metrics["temp"], metrics["actor_loss"]]
after["report"] = np.array([float(value) for value in report], dtype=np.float32)
save_file({name: np.ascontiguousarray(value, dtype=np.float32) for name, value in after.items()}, folder / "after.safetensors")
