"""The three places where autograd's own way costs most: dropout masks, LSTMs, and points that are encoded and then attended to.

Each is an `autograd.Function` over plain matrix products; everything else in the port is ordinary PyTorch.
"""

import torch
from torch.nn import functional as F

# The masks' bits come sixteen at a time: four times as fast as `bernoulli_` on a CPU, and the probability is exact to 2^-16.
_LEVELS = 1 << 16


def keep_mask(shape, p, like):
    """1 / (1 - p) where kept, 0 where dropped."""
    count = 1
    for size in shape:
        count *= size
    bits = torch.empty((count + 3) // 4, dtype=torch.int64).random_(-(2**63), None).view(torch.int16)[:count]
    return (bits >= round(p * _LEVELS) - _LEVELS // 2).to(like.dtype).mul_(1.0 / (1.0 - p)).view(shape)


def dropout(x, p):
    """Inverted dropout."""
    return x if p == 0.0 else x * keep_mask(x.shape, p, x)


class _LstmLayer:
    """One layer over all steps; gates are kept for the way back. Gate order i, f, g, o."""

    def __init__(self, inputs, weight_ih, weight_hh, bias):
        steps, rows, _ = inputs.shape
        # tanh(x) = 2 sigmoid(2x) - 1, with g's rows doubled once: one sigmoid for all four gates, and sigmoid is ten times as fast as tanh.
        double = torch.ones(4, 256, 1, dtype=inputs.dtype)
        double[2] = 2.0
        double = double.view(1024, 1)
        self.inputs, self.weight_ih, self.weight_hh = inputs, weight_ih, weight_hh
        self.gates = torch.addmm(bias * double[:, 0], inputs.view(steps * rows, -1), (weight_ih * double).t()).view(steps, rows, 1024)
        recurrent = (weight_hh * double).t()
        self.cells = torch.empty(steps, rows, 256, dtype=inputs.dtype)
        self.squashed = torch.empty_like(self.cells)
        self.outputs = torch.empty_like(self.cells)
        scratch = torch.empty(rows, 256, dtype=inputs.dtype)
        for t in range(steps):
            gates = self.gates[t]
            if t:
                gates.addmm_(self.outputs[t - 1], recurrent)
            gates.sigmoid_()
            i, f, g, o = gates.split(256, 1)
            g.mul_(2.0).sub_(1.0)
            cell = torch.mul(i, g, out=self.cells[t])
            if t:
                cell.addcmul_(f, self.cells[t - 1])
            squashed = torch.sigmoid(torch.mul(cell, 2.0, out=scratch), out=self.squashed[t]).mul_(2.0).sub_(1.0)
            torch.mul(o, squashed, out=self.outputs[t])

    def backward(self, grad_outputs, grad_last, wants_inputs):
        """`grad_outputs` may be none; `grad_last` is added at the last step. Overwrites the gates."""
        steps, rows, _ = self.gates.shape
        grad_h, grad_c = grad_last, None
        slope = torch.empty(rows, 256, dtype=self.gates.dtype)
        for t in reversed(range(steps)):
            i, f, g, o = self.gates[t].split(256, 1)
            squashed = self.squashed[t]
            if grad_outputs is not None:
                grad_h = grad_outputs[t] if grad_h is None else grad_h.add_(grad_outputs[t])
            through = grad_h * o
            torch.mul(squashed, squashed, out=slope)
            through.addcmul_(through, slope, value=-1.0)
            grad_c = through if grad_c is None else grad_c.add_(through)
            grad_i, grad_g = grad_c * g, grad_c * i
            grad_f = grad_c * self.cells[t - 1] if t else None
            grad_o = grad_h * squashed
            grad_c = grad_c.mul_(f)
            # From here the gates' memory holds the gradients before the squashing.
            torch.mul(i, i, out=slope)
            i.sub_(slope).mul_(grad_i)
            torch.mul(g, g, out=slope)
            torch.addcmul(grad_g, grad_g, slope, value=-1.0, out=g)
            torch.mul(o, o, out=slope)
            o.sub_(slope).mul_(grad_o)
            if t:
                torch.mul(f, f, out=slope)
                f.sub_(slope).mul_(grad_f)
                grad_h = self.gates[t] @ self.weight_hh
            else:
                f.zero_()
        flat = self.gates.view(steps * rows, 1024)
        grad_ih = flat.t() @ self.inputs.reshape(steps * rows, -1)
        grad_hh = flat[rows:].t() @ self.outputs.view(steps * rows, 256)[:-rows]
        grad_inputs = (flat @ self.weight_ih).view(steps, rows, -1) if wants_inputs else None
        return grad_ih, grad_hh, flat.sum(0), grad_inputs


class Lstm(torch.autograd.Function):
    """Two layers, steps x rows x 8 to the top layer's last output; no gradient to the inputs."""

    @staticmethod
    def forward(ctx, inputs, ih0, hh0, bias0, ih1, hh1, bias1):
        lower = _LstmLayer(inputs, ih0, hh0, bias0)
        upper = _LstmLayer(lower.outputs, ih1, hh1, bias1)
        ctx.layers = lower, upper
        return upper.outputs[-1].clone()

    @staticmethod
    def backward(ctx, grad):
        lower, upper = ctx.layers
        del ctx.layers
        ih1, hh1, bias1, grad_outputs = upper.backward(None, grad.clone(), True)
        ih0, hh0, bias0, _ = lower.backward(grad_outputs, None, False)
        return None, ih0, hh0, bias0, ih1, hh1, bias1


class PointSlots(torch.autograd.Function):
    """Encodes points by a stack of Linear + ReLU, and lets every slot attend to its hundred points with one query of eight heads.

    Window by window, so that points, their gathered copies and their gradients stay in the cache and never exist for a whole batch.
    Returns the points pooled by each head (slots x 8 x 256) and the sums of the weights (slots x 8; 1 but for dropout).
    """

    @staticmethod
    def forward(ctx, slots, p, queries, *layers):
        features = slots.features
        weights, biases = layers[0::2], layers[1::2]
        count = len(slots.agent)
        encoded = [torch.empty(len(features), len(bias), dtype=features.dtype) for bias in biases[1:]]
        attention = torch.empty(count, 8, 100, dtype=features.dtype)
        kept = None if p == 0.0 else keep_mask(attention.shape, p, attention)
        pooled = torch.empty(count, 8, 256, dtype=features.dtype)
        own = queries.index_select(0, slots.agent)
        for chunk in slots.chunks:
            x = torch.addmm(biases[0], features[chunk.points], weights[0].t()).relu_()
            for weight, bias, out in zip(weights[1:], biases[1:], encoded, strict=True):
                x = torch.addmm(bias, x, weight.t(), out=out[chunk.points]).relu_()
            walked = x.index_select(0, chunk.walks).view(-1, 100, 256)
            share = torch.softmax(torch.bmm(own[chunk.slots], walked.transpose(1, 2)), -1, out=attention[chunk.slots])
            if kept is not None:
                share = share * kept[chunk.slots]
            torch.bmm(share, walked, out=pooled[chunk.slots])
        ctx.slots, ctx.own, ctx.attention, ctx.kept, ctx.encoded = slots, own, attention, kept, encoded
        ctx.save_for_backward(queries, *layers)
        sums = attention.sum(-1) if kept is None else (attention * kept).sum(-1)
        return pooled, sums

    @staticmethod
    def backward(ctx, grad_pooled, grad_sums):
        slots, kept, encoded = ctx.slots, ctx.kept, ctx.encoded
        queries, *layers = ctx.saved_tensors
        weights, biases = layers[0::2], layers[1::2]
        grads = [torch.zeros_like(tensor) for tensor in layers]
        grad_own = torch.empty_like(ctx.own)
        for chunk in slots.chunks:
            share, own, pooled = ctx.attention[chunk.slots], ctx.own[chunk.slots], grad_pooled[chunk.slots]
            top = encoded[-1][chunk.points]
            walked = top.index_select(0, chunk.walks).view(-1, 100, 256)
            grad_share = torch.bmm(pooled, walked.transpose(1, 2)).add_(grad_sums[chunk.slots].unsqueeze(-1))
            used = share
            if kept is not None:
                grad_share.mul_(kept[chunk.slots])
                used = share * kept[chunk.slots]
            grad_score = torch._softmax_backward_data(grad_share, share, -1, share.dtype)
            torch.bmm(grad_score, walked, out=grad_own[chunk.slots])
            both = torch.bmm(torch.cat([used, grad_score], 1).transpose(1, 2), torch.cat([pooled, own], 1))
            grad = torch.zeros_like(top).index_add_(0, chunk.walks, both.view(-1, 256))
            first = torch.addmm(biases[0], slots.features[chunk.points], weights[0].t()).relu_()
            inputs = [slots.features[chunk.points], first] + [layer[chunk.points] for layer in encoded]
            for layer in reversed(range(len(weights))):
                torch.ops.aten.threshold_backward.grad_input(grad, inputs[layer + 1], 0, grad_input=grad)
                grads[2 * layer].addmm_(grad.t(), inputs[layer])
                grads[2 * layer + 1].add_(grad.sum(0))
                if layer:
                    grad = grad @ weights[layer]
        del ctx.slots, ctx.own, ctx.attention, ctx.kept, ctx.encoded
        return None, None, torch.zeros_like(queries).index_add_(0, slots.agent, grad_own), *grads


def feed_forward(x, parameters, prefix, p):
    """Norm, Linear, ReLU, dropout, Linear, norm; no residual."""
    get = lambda name: parameters[f"{prefix}.{name}"]
    x = F.layer_norm(x, (256,), get("0.weight"), get("0.bias"))
    x = dropout(F.linear(x, get("1.weight"), get("1.bias")).relu_(), p)
    x = F.linear(x, get("4.weight"), get("4.bias"))
    return F.layer_norm(x, (256,), get("5.weight"), get("5.bias"))
