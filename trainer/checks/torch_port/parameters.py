"""The 135 tensors of the network by PyTorch's names: their shapes, in state-dict order, and the formula that fills them.

The formula (splitmix64 over the name's FNV-1a hash) makes weights that every implementation can make for itself, bit for bit.
"""

import numpy as np
import torch

PADDED_TABLES = ("self_type", "left_type", "right_type", "traffic_light_type")
TABLES = {"self_type": 4, "left_type": 11, "right_type": 11, "traffic_light_type": 9, "interpolating": 2, "stop_sign": 2, "stop_point": 2}


def _linear(name, rows, columns):
    return [(f"{name}.weight", (rows, columns)), (f"{name}.bias", (rows,))]


def _norm(name):
    return [(f"{name}.weight", (256,)), (f"{name}.bias", (256,))]


def _attention(name):
    return [(f"{name}.in_proj_weight", (768, 256)), (f"{name}.in_proj_bias", (768,)), *_linear(f"{name}.out_proj", 256, 256)]


def _feed_forward(name):
    return [*_norm(f"{name}.0"), *_linear(f"{name}.1", 1024, 256), *_linear(f"{name}.4", 256, 1024), *_norm(f"{name}.5")]


def shapes():
    """Name and shape of every parameter, in the order of the state dict."""
    out = []
    for kind in ("vehicle", "pedestrian", "cyclist"):
        for layer, width in (("l0", 8), ("l1", 256)):
            prefix = f"{kind}_net.motion."
            out += [(f"{prefix}weight_ih_{layer}", (1024, width)), (f"{prefix}weight_hh_{layer}", (1024, 256))]
            out += [(f"{prefix}bias_ih_{layer}", (1024,)), (f"{prefix}bias_hh_{layer}", (1024,))]
    for line in ("self_line", "left_line", "right_line"):
        out += _linear(f"lane_net.{line}", 128, 3)
    out += _linear("lane_net.speed_limit", 64, 1)
    out += [(f"lane_net.{table}.weight", (rows, 64)) for table, rows in TABLES.items()]
    out += _linear("lane_net.pointnet.0", 384, 512) + _linear("lane_net.pointnet.2", 256, 384)
    for layer, rows, columns in ((0, 64, 3), (2, 128, 64), (4, 256, 128)):
        out += _linear(f"crosswalk_net.point_net.{layer}", rows, columns)
    for element in ("lane", "crosswalk"):
        prefix = f"agent_map.{element}_attention."
        out += _attention(f"{prefix}cross_attention") + _feed_forward(f"{prefix}transformer")
    for mode in range(3):
        out += _attention(f"agent_map.map_attention.attention.{mode}")
    out += _feed_forward("agent_map.map_attention.ffn")
    for layer in range(2):
        prefix = f"agent_agent.interaction_net.layers.{layer}."
        out += _attention(f"{prefix}self_attn") + _linear(f"{prefix}linear1", 1024, 256) + _linear(f"{prefix}linear2", 256, 1024)
        out += _norm(f"{prefix}norm1") + _norm(f"{prefix}norm2")
    out += _linear("plan.control.1", 256, 512) + _linear("plan.control.3", 100, 256)
    out += _linear("plan.cost.0", 128, 1) + _linear("plan.cost.2", 9, 128)
    out += _linear("predict.decode.1", 256, 512) + _linear("predict.decode.3", 150, 256)
    out += _linear("score.reduce.1", 256, 512) + _linear("score.decode.1", 128, 512) + _linear("score.decode.3", 1, 128)
    return out


def uniform(name, count):
    """`count` numbers in [0, 1), a function of the name and the flat index alone."""
    state = 0xCBF29CE484222325
    for byte in name.encode():
        state = ((state ^ byte) * 0x100000001B3) % 2**64
    with np.errstate(over="ignore"):
        z = np.uint64(state) + np.arange(count, dtype=np.uint64) + np.uint64(0x9E3779B97F4A7C15)
        z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        z ^= z >> np.uint64(31)
    return (z >> np.uint64(40)).astype(np.float64) / 2.0**24


def _offset_and_scale(name, shape):
    if len(shape) == 1 and any(part in name for part in ("transformer.0.", "transformer.5.", "ffn.0.", "ffn.5.", "norm1.", "norm2.")):
        return (1.0 if name.endswith("weight") else 0.0), 0.25
    if name.startswith("lane_net.") and name.split(".")[1] in TABLES:
        return 0.0, 0.5
    if ".motion." in name:
        return 0.0, 1.0 / 16.0
    if len(shape) == 1:
        return 0.0, 0.1
    gain = 2.5 if name.endswith("in_proj_weight") else 1.75
    special = {
        "agent_map.crosswalk_attention.cross_attention.in_proj_weight": 4.0,
        "plan.control.3.weight": 0.75,
        "predict.decode.3.weight": 6.0,
        "score.decode.3.weight": 3.0,
    }
    return 0.0, special.get(name, gain) / np.sqrt(float(shape[-1]))


def formula_parameters(dtype):
    """Every parameter as a leaf tensor, filled by the formula, rounded to float32 first whatever `dtype` is."""
    out = {}
    for name, shape in shapes():
        offset, scale = _offset_and_scale(name, shape)
        values = (offset + scale * (2.0 * uniform(name, int(np.prod(shape))) - 1.0)).astype(np.float32).reshape(shape)
        if name.startswith("lane_net.") and name.split(".")[1] in PADDED_TABLES:
            values[0] = 0.0
        out[name] = torch.from_numpy(values.copy()).to(dtype).requires_grad_(True)
    return out
