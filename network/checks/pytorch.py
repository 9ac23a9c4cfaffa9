"""Times PyTorch on the network: as the authors' modules run it, and rearranged as this crate does.

    python pytorch.py --features ../shared/dipp/feature-vectors --outputs ../shared/dipp/network-vectors [--cargo]

Both models are written from the architecture's description, get the formula's weights, and are held to the vectors before they
are timed: eight real frames at batch 1, and 32 of them (four times each) at once; one thread, the best of several. `--cargo` runs this
crate's bench first, on the same core. The rearranged model is given the distinct points of each frame for nothing: finding them is
not timed. Needs torch and numpy; no part of the tests.
"""

import argparse
import glob
import math
import os
import subprocess
import time

import numpy as np
import torch
from torch import nn
from torch.nn import functional as F

WIDTH = 256
M64 = (1 << 64) - 1


def formula(name, shape):
    """The formula's weights for a tensor."""
    h = 0xCBF29CE484222325
    for byte in name.encode():
        h = ((h ^ byte) * 0x100000001B3) & M64
    with np.errstate(over="ignore"):
        z = np.uint64(h) + np.arange(math.prod(shape), dtype=np.uint64) + np.uint64(0x9E3779B97F4A7C15)
        z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        z = z ^ (z >> np.uint64(31))
    u = (z >> np.uint64(40)).astype(np.float64) / 2**24
    embeddings = ["self_type", "left_type", "right_type", "traffic_light_type", "interpolating", "stop_sign", "stop_point"]
    offset = 0.0
    if any(part in name for part in ["transformer.0.", "transformer.5.", "ffn.0.", "ffn.5.", "norm1.", "norm2."]):
        offset, scale = float(name.endswith("weight")), 0.25
    elif name in [f"lane_net.{e}.weight" for e in embeddings]:
        scale = 0.5
    elif ".motion." in name:
        scale = 1 / 16
    elif len(shape) == 1:
        scale = 0.1
    else:
        gains = {
            "agent_map.crosswalk_attention.cross_attention.in_proj_weight": 4.0,
            "plan.control.3.weight": 0.75,
            "predict.decode.3.weight": 6.0,
            "score.decode.3.weight": 3.0,
        }
        scale = gains.get(name, 2.5 if name.endswith("in_proj_weight") else 1.75) / math.sqrt(shape[-1])
    values = (offset + scale * (2 * u - 1)).astype(np.float32).reshape(shape)
    if name in [f"lane_net.{e}.weight" for e in embeddings[:4]]:
        values[0] = 0
    return torch.from_numpy(values)


# As the authors' modules run it: everything for all agents and slots, masked afterwards.


class Motion(nn.Module):
    def __init__(self):
        super().__init__()
        self.motion = nn.LSTM(8, WIDTH, 2, batch_first=True)

    def forward(self, rows):
        return self.motion(rows[..., :8])[0][:, -1]


class LaneEncoder(nn.Module):
    CODES = [("self_type", 4, 10), ("left_type", 11, 11), ("right_type", 11, 12), ("traffic_light_type", 9, 13),
             ("interpolating", 2, 15), ("stop_sign", 2, 16), ("stop_point", 2, 14)]

    def __init__(self):
        super().__init__()
        self.self_line, self.left_line, self.right_line = nn.Linear(3, 128), nn.Linear(3, 128), nn.Linear(3, 128)
        self.speed_limit = nn.Linear(1, 64)
        for name, rows, _ in self.CODES:
            setattr(self, name, nn.Embedding(rows, 64))
        self.pointnet = nn.Sequential(nn.Linear(512, 384), nn.ReLU(), nn.Linear(384, 256), nn.ReLU())

    def forward(self, x):
        codes = sum(getattr(self, name)(x[..., column].int()) for name, _, column in self.CODES)
        parts = [self.self_line(x[..., :3]), self.left_line(x[..., 3:6]), self.right_line(x[..., 6:9])]
        return self.pointnet(torch.cat(parts + [self.speed_limit(x[..., 9:10]), codes], -1))


class CrosswalkEncoder(nn.Module):
    def __init__(self):
        super().__init__()
        layers = [nn.Linear(3, 64), nn.ReLU(), nn.Linear(64, 128), nn.ReLU(), nn.Linear(128, 256), nn.ReLU()]
        self.point_net = nn.Sequential(*layers)

    def forward(self, x):
        return self.point_net(x)


def feed_forward():
    return nn.Sequential(nn.LayerNorm(WIDTH), nn.Linear(WIDTH, 1024), nn.ReLU(), nn.Dropout(0.1), nn.Linear(1024, WIDTH),
                         nn.LayerNorm(WIDTH))


class PointAttention(nn.Module):
    def __init__(self):
        super().__init__()
        self.cross_attention = nn.MultiheadAttention(WIDTH, 8, 0.1, batch_first=True)
        self.transformer = feed_forward()

    def forward(self, query, points):
        return self.transformer(self.cross_attention(query, points, points)[0])


class ModeAttention(nn.Module):
    def __init__(self):
        super().__init__()
        self.attention = nn.ModuleList([nn.MultiheadAttention(WIDTH, 4, 0.1, batch_first=True) for _ in range(3)])
        self.ffn = feed_forward()

    def forward(self, query, slots, mask):
        return torch.stack([self.ffn(a(query, slots, slots, key_padding_mask=mask)[0]) for a in self.attention], 1)


class AgentMap(nn.Module):
    def __init__(self):
        super().__init__()
        self.lane_attention, self.crosswalk_attention = PointAttention(), PointAttention()
        self.map_attention = ModeAttention()

    def forward(self, agent, lanes, crosswalks, mask):
        query = agent.unsqueeze(1)
        slots = [self.lane_attention(query, lanes[:, i]) for i in range(lanes.shape[1])]
        slots += [self.crosswalk_attention(query, crosswalks[:, i]) for i in range(crosswalks.shape[1])]
        slots = torch.cat(slots, 1)
        return slots, self.map_attention(query, slots, mask).squeeze(2)


class Interaction(nn.Module):
    """Two post-norm encoder layers, without the fast path of newer PyTorch, which gives zeros for masked rows."""

    def __init__(self):
        super().__init__()
        layer = nn.TransformerEncoderLayer(WIDTH, 8, 1024, 0.1, batch_first=True)
        self.interaction_net = nn.TransformerEncoder(layer, 2, enable_nested_tensor=False)

    def forward(self, agents, mask):
        for layer in self.interaction_net.layers:
            answer = layer.self_attn(agents, agents, agents, key_padding_mask=mask)[0]
            agents = layer.norm1(agents + answer)
            agents = layer.norm2(agents + layer.linear2(torch.relu(layer.linear1(agents))))
        return agents


class Plan(nn.Module):
    def __init__(self):
        super().__init__()
        self.control = nn.Sequential(nn.Dropout(0.1), nn.Linear(512, 256), nn.ELU(), nn.Linear(256, 100))
        self.cost = nn.Sequential(nn.Linear(1, 128), nn.ReLU(), nn.Linear(128, 9), nn.Softmax(-1))


class Predict(nn.Module):
    def __init__(self):
        super().__init__()
        self.decode = nn.Sequential(nn.Dropout(0.1), nn.Linear(512, 256), nn.ELU(), nn.Linear(256, 150))


class Score(nn.Module):
    def __init__(self):
        super().__init__()
        self.reduce = nn.Sequential(nn.Dropout(0.1), nn.Linear(512, 256), nn.ELU())
        self.decode = nn.Sequential(nn.Dropout(0.1), nn.Linear(512, 128), nn.ELU(), nn.Linear(128, 1))


class Network(nn.Module):
    def __init__(self):
        super().__init__()
        self.vehicle_net, self.pedestrian_net, self.cyclist_net = Motion(), Motion(), Motion()
        self.lane_net, self.crosswalk_net = LaneEncoder(), CrosswalkEncoder()
        self.agent_map, self.agent_agent = AgentMap(), Interaction()
        self.plan, self.predict, self.score = Plan(), Predict(), Score()
        with torch.no_grad():
            for name, tensor in self.named_parameters():
                tensor.copy_(formula(name, tuple(tensor.shape)))

    def heads(self, agents, slots, modes, now):
        """agents [b, 11, d], slots [b, 11, 10, d], modes [b, 3, 11, d]"""
        feature = torch.cat([modes, agents.unsqueeze(1).expand_as(modes)], -1)
        b = agents.shape[0]
        plans = self.plan.control(feature[:, :, 0]).view(b, 3, 50, 2)
        offsets = self.predict.decode(feature[:, :, 1:]).view(b, 3, 10, 50, 3)
        pooled = torch.cat([slots.amax((1, 2)), agents.amax(1)], -1)
        reduced = self.score.reduce(pooled).unsqueeze(1).expand(-1, 3, -1)
        scores = self.score.decode(torch.cat([reduced, modes.amax(2)], -1)).squeeze(-1)
        self.plan.cost(torch.ones(1, 1))
        return plans, offsets + now[:, None, :, None, :3], scores

    def masks(self, frame):
        ego, neighbors, lanes, crosswalks = frame
        agents = torch.cat([ego[:, -1:, 7], neighbors[:, :, -1, 7]], 1) == 0
        slots = torch.cat([lanes[..., 0, 0], crosswalks[..., 0, 0]], -1) == 0
        slots[:, :, 0] = False
        return agents, slots


class Eager(Network):
    def forward(self, frame):
        ego, neighbors, lanes, crosswalks = frame
        absent, masked = self.masks(frame)
        actors = [self.vehicle_net(ego)]
        kinds = neighbors[:, :, -1, 8].int()
        for i in range(10):
            rows, kind = neighbors[:, i], kinds[:, i, None]
            pedestrian, cyclist = self.pedestrian_net(rows), self.cyclist_net(rows)
            actors.append(torch.where(kind == 2, pedestrian, torch.where(kind == 3, cyclist, self.vehicle_net(rows))))
        agents = self.agent_agent(torch.stack(actors, 1), absent)
        encoded, outlines = self.lane_net(lanes), self.crosswalk_net(crosswalks)
        slots, modes = [], []
        for i in range(11):
            own = self.agent_map(agents[:, i], encoded[:, i], outlines[:, i], masked[:, i])
            slots.append(own[0])
            modes.append(own[1])
        return self.heads(agents, torch.stack(slots, 1), torch.stack(modes, 2), neighbors[:, :, -1])


# Rearranged: folded layers, distinct points, one query without keys, only what is there.


def distinct(points):
    """Distinct rows over all frames, and the place of each slot's points; slots of zeros left out."""
    slots = points.reshape(-1, *points.shape[-2:])
    present = (slots != 0).flatten(1).any(1).nonzero().squeeze(1)
    frames = present // (slots.shape[0] // points.shape[0])
    tagged = torch.cat([frames[:, None, None].expand(-1, 100, 1).float(), slots[present]], -1)
    rows, places = torch.unique(tagged.reshape(-1, tagged.shape[-1]), dim=0, return_inverse=True)
    return rows[:, 1:].contiguous(), places.view(-1, 100), present


class Folded(Network):
    def prepare(self):
        """What depends on the weights alone."""
        net = self.lane_net
        first = net.pointnet[0]
        blocks = first.weight.split([128, 128, 128, 64, 64], 1)
        layers = [net.self_line, net.left_line, net.right_line, net.speed_limit]
        self.numbers = torch.cat([block @ layer.weight for block, layer in zip(blocks, layers)], 1).T.contiguous()
        self.bias = first.bias + sum(block @ layer.bias for block, layer in zip(blocks, layers))
        self.tables = [(getattr(net, name).weight @ blocks[4].T, column) for name, _, column in net.CODES]
        zero = torch.zeros(1, 17), torch.zeros(1, 3)
        self.still = self.vehicle_net(torch.zeros(1, 20, 8))
        query = torch.zeros(1, WIDTH)
        self.empty_lane = self.look(self.agent_map.lane_attention, query, self.lane_points(zero[0]),
                                    torch.zeros(1, 100, dtype=torch.long))
        self.empty_crosswalk = self.look(self.agent_map.crosswalk_attention, query, self.crosswalk_net(zero[1]),
                                         torch.zeros(1, 100, dtype=torch.long))

    def lane_points(self, points):
        hidden = torch.addmm(self.bias, points[:, :10], self.numbers)
        for table, column in self.tables:
            hidden += table[points[:, column].long()]
        return F.relu_(self.lane_net.pointnet[2](F.relu_(hidden)))

    @staticmethod
    def fold(attention, queries, heads):
        """What each head multiplies rows with: [n, heads, d]."""
        size = WIDTH // heads
        w, b = attention.in_proj_weight, attention.in_proj_bias
        q = F.linear(queries, w[:WIDTH], b[:WIDTH]).view(-1, heads, size) / math.sqrt(size)
        return torch.einsum("nhj,hjd->nhd", q, w[WIDTH:2 * WIDTH].view(heads, size, WIDTH))

    @staticmethod
    def answer(attention, pooled, heads):
        size = WIDTH // heads
        w, b = attention.in_proj_weight, attention.in_proj_bias
        values = torch.einsum("nhd,hjd->nhj", pooled, w[2 * WIDTH:].view(heads, size, WIDTH)) + b[2 * WIDTH:].view(heads, size)
        return attention.out_proj(values.reshape(-1, WIDTH))

    def look(self, module, queries, encoded, places, agents=None):
        folded = self.fold(module.cross_attention, queries, 8)
        folded = folded if agents is None else folded[agents]
        points = encoded[places]
        shares = torch.softmax(torch.bmm(folded, points.transpose(1, 2)), -1)
        return module.transformer(self.answer(module.cross_attention, torch.bmm(shares, points), 8))

    def forward(self, frame, points):
        ego, neighbors, _, _ = frame
        absent, masked = self.masks(frame)
        b = ego.shape[0]
        rows = torch.cat([ego.unsqueeze(1), neighbors[..., :8]], 1).reshape(-1, 20, 8)
        kinds = torch.cat([torch.ones(b, 1), neighbors[:, :, -1, 8]], 1).reshape(-1)
        here = (rows != 0).flatten(1).any(1)
        actors = self.still.repeat(b * 11, 1)
        for net, kind in [(self.pedestrian_net, kinds == 2), (self.cyclist_net, kinds == 3),
                          (self.vehicle_net, (kinds != 2) & (kinds != 3) & here)]:
            places = kind.nonzero().squeeze(1)
            if len(places):
                actors[places] = net(rows[places])
        agents = self.agent_agent(actors.view(b, 11, WIDTH), absent)
        flat = agents.reshape(-1, WIDTH)
        slots = torch.cat([self.empty_lane.expand(b * 11, 6, -1), self.empty_crosswalk.expand(b * 11, 4, -1)], 1)
        lanes, crosswalks = points
        for module, (rows, places, present), encode, first, count in [
            (self.agent_map.lane_attention, lanes, self.lane_points, 0, 6),
            (self.agent_map.crosswalk_attention, crosswalks, self.crosswalk_net, 6, 4),
        ]:
            if len(present):
                agent = present // count
                slots[agent, first + present % count] = self.look(module, flat, encode(rows), places, agent)
        mask = masked.view(-1, 1, 10)
        modes = []
        for attention in self.agent_map.map_attention.attention:
            scores = torch.bmm(self.fold(attention, flat, 4), slots.transpose(1, 2))
            shares = torch.softmax(scores.masked_fill(mask, -math.inf), -1)
            modes.append(self.answer(attention, torch.bmm(shares, slots), 4))
        modes = self.agent_map.map_attention.ffn(torch.stack(modes, 0)).view(3, b, 11, WIDTH).transpose(0, 1)
        return self.heads(agents, slots.view(b, 11, 10, WIDTH), modes, neighbors[:, :, -1])


def frame_of(path):
    arrays = np.load(path)
    return tuple(torch.from_numpy(arrays[name])[None] for name in ["ego", "neighbors", "map_lanes", "map_crosswalks"])


def best(run, seconds=3.0):
    run()
    fastest, times, start = math.inf, 0, time.perf_counter()
    while times < 3 or time.perf_counter() - start < seconds:
        begin = time.perf_counter()
        run()
        fastest = min(fastest, time.perf_counter() - begin)
        times += 1
    return fastest


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--features", required=True)
    parser.add_argument("--outputs", required=True)
    parser.add_argument("--cargo", action="store_true")
    arguments = parser.parse_args()
    if arguments.cargo:
        subprocess.run(["cargo", "bench", "-p", "network", "--bench", "forward", "--", "none"], check=True)
    torch.set_num_threads(1)
    torch.set_grad_enabled(False)
    eager, folded = Eager().eval(), Folded().eval()
    folded.prepare()
    paths = sorted(glob.glob(os.path.join(arguments.features, "*.npz")))
    frames = {os.path.basename(path): frame_of(path) for path in paths}
    worst = [0.0, 0.0]
    for name, frame in frames.items():
        wanted = np.load(os.path.join(arguments.outputs, name))
        points = distinct(frame[2]), distinct(frame[3])
        for index, got in enumerate([eager(frame), folded(frame, points)]):
            for tensor, array in zip(got, ["plans_f64", "predictions_f64", "scores_f64"]):
                off = np.abs(tensor[0].double().numpy() - wanted[array]).max()
                worst[index] = max(worst[index], off)
    print(f"torch {torch.__version__}; worst output: authors' {worst[0]:.1e}, rearranged {worst[1]:.1e}")
    assert max(worst) < 1e-4, "not the same network"

    real = [frame for name, frame in frames.items() if not name.startswith("synthetic")]
    one = [[], []]
    for frame in real:
        points = distinct(frame[2]), distinct(frame[3])
        one[0].append(best(lambda: eager(frame)))
        one[1].append(best(lambda: folded(frame, points), 1.0))
    batch = tuple(torch.cat(tensors * 4) for tensors in zip(*real))
    points = distinct(batch[2]), distinct(batch[3])
    many = best(lambda: eager(batch)) / len(batch[0]), best(lambda: folded(batch, points)) / len(batch[0])
    for name, index in [("the authors' modules", 0), ("rearranged", 1)]:
        print(f"{name}: batch 1 {1e3 * np.median(one[index]):.1f} ms, batch {len(batch[0])} {1e3 * many[index]:.1f} ms a frame")


if __name__ == "__main__":
    main()
