"""The network over a collated batch, with every short cut that is exact.

Tokens are the N agents with a row of their own, window after window, then one for each window that has absent agents. Each LSTM runs on the agents of its
type. Key projections are folded into the single query (the key bias cancels in the softmax); value projections come after the pooling, where dropout on the
weights makes their bias count by the sum of what is kept.
"""

import math
from dataclasses import dataclass

import torch
from torch.nn import functional as F

from .batch import CODES, PADDED_TABLES
from .kernels import Lstm, PointSlots, dropout, feed_forward


@dataclass
class Outputs:
    plans: torch.Tensor  # B x 3 x 50 x 2: acceleration, steering; not clamped
    predictions: torch.Tensor  # B x 3 x 10 x 50 x 3: x, y, heading
    scores: torch.Tensor  # B x 3
    cost_weights: torch.Tensor  # 9


def encode_agents(parameters, batch):
    """N + M x 256."""
    encodings = []
    for kind, history in zip(("vehicle", "pedestrian", "cyclist"), batch.history, strict=True):
        if history.shape[1]:
            get = lambda name: parameters[f"{kind}_net.motion.{name}"]  # noqa: B023
            layers = [(get(f"weight_ih_l{i}"), get(f"weight_hh_l{i}"), get(f"bias_ih_l{i}") + get(f"bias_hh_l{i}")) for i in range(2)]
            encodings.append(Lstm.apply(history, *layers[0], *layers[1]))
    return torch.cat(encodings).index_select(0, batch.encoding)


def relate_agents(parameters, batch, x, p):
    """Two post-norm encoder layers; absent agents ask, but are not asked."""
    size, width = batch.padded.shape
    hidden = batch.key_masked.view(size, 1, 1, width)
    for layer in range(2):
        prefix = f"agent_agent.interaction_net.layers.{layer}."
        get = lambda name: parameters[prefix + name]  # noqa: B023
        qkv = F.linear(x, get("self_attn.in_proj_weight"), get("self_attn.in_proj_bias"))
        q, k, v = qkv.index_select(0, batch.padded.view(-1)).view(size, width, 3, 8, 32).permute(2, 0, 3, 1, 4)
        shares = torch.softmax((q @ k.transpose(2, 3) / math.sqrt(32.0)).masked_fill(hidden, -math.inf), -1)
        heard = (dropout(shares, p) @ v).transpose(1, 2).reshape(size * width, 256).index_select(0, batch.flat)
        heard = F.linear(heard, get("self_attn.out_proj.weight"), get("self_attn.out_proj.bias"))
        x = F.layer_norm(x + dropout(heard, p), (256,), get("norm1.weight"), get("norm1.bias"))
        inner = dropout(F.linear(x, get("linear1.weight"), get("linear1.bias")).relu_(), p)
        inner = F.linear(inner, get("linear2.weight"), get("linear2.bias"))
        x = F.layer_norm(x + dropout(inner, p), (256,), get("norm2.weight"), get("norm2.bias"))
    return x


def fold_query(parameters, prefix, heads, agents):
    """N x heads x 256: the query with the key projection and the scale in it, so that a key's score is a plain product with the key's input."""
    width = 256 // heads
    weight, bias = parameters[f"{prefix}.in_proj_weight"], parameters[f"{prefix}.in_proj_bias"]
    query = F.linear(agents, weight[:256], bias[:256]).mul(1.0 / math.sqrt(width)).view(-1, heads, width).transpose(0, 1)
    return torch.bmm(query, weight[256:512].view(heads, width, 256)).transpose(0, 1)


def project_pooled(parameters, prefix, heads, pooled, sums):
    """The attention's output from inputs pooled by each head (R x heads x 256) and the sums of their weights (R x heads)."""
    width = 256 // heads
    weight, bias = parameters[f"{prefix}.in_proj_weight"][512:], parameters[f"{prefix}.in_proj_bias"][512:]
    values = torch.bmm(pooled.transpose(0, 1), weight.view(heads, width, 256).transpose(1, 2)).transpose(0, 1)
    values = torch.addcmul(values, sums.unsqueeze(-1), bias.view(heads, width)).reshape(-1, 256)
    return F.linear(values, parameters[f"{prefix}.out_proj.weight"], parameters[f"{prefix}.out_proj.bias"])


def _lane_layers(parameters):
    """The lane encoder as two layers: no nonlinearity lies between the input maps and the first layer of the point net, so they are one matrix."""
    get = lambda name: parameters[f"lane_net.{name}"]
    weight = get("pointnet.0.weight")
    parts = [weight[:, 128 * i : 128 * (i + 1)] @ get(f"{line}.weight") for i, line in enumerate(("self_line", "left_line", "right_line"))]
    parts.append(weight[:, 384:448] @ get("speed_limit.weight"))
    tables = torch.cat([get(f"{table}.weight")[1 if table in PADDED_TABLES else 0 :] for _, table, _ in CODES])
    parts.append(weight[:, 448:] @ tables.t())
    biases = torch.cat([get(f"{name}.bias") for name in ("self_line", "left_line", "right_line", "speed_limit")])
    first_bias = torch.addmv(get("pointnet.0.bias"), weight[:, :448], biases)
    return torch.cat(parts, 1), first_bias, get("pointnet.2.weight"), get("pointnet.2.bias")


def attend_slots(parameters, batch, agents, p):
    """Rows of all slots: lanes, the empty lane, crosswalks, the empty crosswalk."""
    crosswalk = [parameters[f"crosswalk_net.point_net.{layer}.{name}"] for layer in (0, 2, 4) for name in ("weight", "bias")]
    out = []
    for slots, layers, element in ((batch.lanes, _lane_layers(parameters), "lane"), (batch.crosswalks, crosswalk, "crosswalk")):
        prefix = f"agent_map.{element}_attention"
        queries = F.pad(fold_query(parameters, f"{prefix}.cross_attention", 8, agents), (0, 0, 0, 0, 0, 1))
        pooled, sums = PointSlots.apply(slots, p, queries, *layers)
        attended = project_pooled(parameters, f"{prefix}.cross_attention", 8, pooled, sums)
        out.append(feed_forward(attended, parameters, f"{prefix}.transformer", p))
    return torch.cat(out)


def weigh_slots(parameters, batch, agents, slots, p):
    """3 x (N + 1) x 256: for each mode what its attention makes of an agent's ten slots; the last row is an agent's with none."""
    names = [f"agent_map.map_attention.attention.{mode}" for mode in range(3)]
    queries = F.pad(torch.cat([fold_query(parameters, name, 4, agents) for name in names], 1), (0, 0, 0, 0, 0, 1))
    keys = slots.index_select(0, batch.slot.view(-1)).view(-1, 10, 256)
    scores = torch.bmm(queries, keys.transpose(1, 2)).masked_fill(batch.masked.unsqueeze(1), -math.inf)
    shares = dropout(torch.softmax(scores, -1), p)
    pooled, sums = torch.bmm(shares, keys), shares.sum(-1)
    rows = [project_pooled(parameters, name, 4, pooled[:, 4 * i : 4 * i + 4], sums[:, 4 * i : 4 * i + 4]) for i, name in enumerate(names)]
    return feed_forward(torch.stack(rows), parameters, "agent_map.map_attention.ffn", p)


def score(parameters, batch, agents, slots, mapped, p):
    """B x 3 logits; nothing before this head learns from them."""
    get = lambda name: parameters[f"score.{name}"]
    with torch.no_grad():
        # The pools cover all eleven agents and all ten slots, absent ones included.
        rows = batch.agent_row[batch.token]
        map_pool = slots[batch.slot[rows].view(batch.size, 110)].amax(1)
        agent_pool = agents[batch.token].amax(1)
        mode_pool = mapped[:, rows].amax(2).transpose(0, 1)
    pools = torch.cat([map_pool, agent_pool], -1)
    reduced = F.elu(F.linear(dropout(pools, p), get("reduce.1.weight"), get("reduce.1.bias")))
    features = torch.cat([reduced.unsqueeze(1).expand(-1, 3, -1), mode_pool], -1)
    hidden = F.elu(F.linear(dropout(features, p), get("decode.1.weight"), get("decode.1.bias")))
    return F.linear(dropout(hidden, p), get("decode.3.weight"), get("decode.3.bias")).squeeze(-1)


def cost_weights(parameters):
    """The nine weights of the planner's cost: seven shares of a softmax over nine, scaled, and two constants."""
    get = lambda name: parameters[f"plan.cost.{name}"]
    hidden = (get("0.weight")[:, 0] + get("0.bias")).relu()
    shares = torch.softmax(torch.addmv(get("2.bias"), get("2.weight"), hidden), 0)
    scale = torch.tensor([1.0, 1.0, 1.0, 1.0, 1.0, 10.0, 100.0], dtype=shares.dtype)
    return torch.cat([shares[:7] * scale, torch.full((2,), 10.0, dtype=shares.dtype)])


def _decode(x, parameters, first, second, p):
    hidden = F.elu(F.linear(dropout(x, p), parameters[f"{first}.weight"], parameters[f"{first}.bias"]))
    return F.linear(hidden, parameters[f"{second}.weight"], parameters[f"{second}.bias"])


def forward(parameters, batch, p):
    """The network's outputs for a batch, with dropout of probability `p`."""
    agents = relate_agents(parameters, batch, encode_agents(parameters, batch), p)
    rows = len(batch.slot) - 1
    slots = attend_slots(parameters, batch, agents[:rows], p)
    mapped = weigh_slots(parameters, batch, agents[:rows], slots, p)
    features = torch.cat([mapped.index_select(1, batch.agent_row), agents.expand(3, -1, -1)], -1)
    plans = _decode(features.index_select(1, batch.token[:, 0]), parameters, "plan.control.1", "plan.control.3", p)
    offsets = _decode(features, parameters, "predict.decode.1", "predict.decode.3", p).view(3, -1, 50, 3)
    predictions = offsets[:, batch.token[:, 1:]].transpose(0, 1) + batch.current[:, None, 1:, None, :3]
    return Outputs(
        plans.view(3, -1, 50, 2).transpose(0, 1),
        predictions,
        score(parameters, batch, agents, slots, mapped, p),
        cost_weights(parameters),
    )
