"""Losses, outputs and gradients of the port against those that are stored beside the batch."""

import os

import numpy as np
import torch

from . import batch, losses, network, parameters, speed

NAMES = [name for name, _ in parameters.shapes()]
TRUTHS = ("no_planner_f64.npz", "planner_mended_f64.npz", "planner_f64.npz")
IN_FLOAT64 = {"loss": 1e-6, "output": 1e-6, "gradient": 1e-5}
# Three times what the authors' own float32 deviates from their float64; two Gauss-Newton steps from a random plan are ill-conditioned.
IN_FLOAT32 = {"loss": 6e-7, "output": 1e-5, "gradient": 3.9e-6}
IN_FLOAT32_PLANNED = {"loss": 2.1e-5, "plan loss": 3e-4, "output": 3.6e-3, "gradient": 1.5e-3}


def _gradients(folder, dtype, with_planner, coupled):
    """One step on the eight windows, without dropout."""
    tensors = parameters.formula_parameters(dtype)
    joined = batch.collate(batch.read_windows(np.load(os.path.join(folder, "batch.npz"))), dtype)
    outputs = network.forward(tensors, joined, 0.0)
    result = losses.step_losses(outputs, joined, with_planner, coupled)
    result.total.backward()
    none = torch.zeros(1, dtype=dtype)
    return outputs, result, [none if tensors[name].grad is None else tensors[name].grad.double() for name in NAMES]


def _relative(ours, theirs):
    """Largest difference relative to the largest value."""
    ours, theirs = np.asarray(ours, dtype=np.float64).reshape(theirs.shape), np.asarray(theirs, dtype=np.float64)
    return float(np.abs(ours - theirs).max() / max(np.abs(theirs).max(), 1e-300))


def deviations(folder, truth, dtype):
    """Rows of kind, quantity and deviation."""
    with_planner = not truth.startswith("no_planner")
    outputs, result, grads = _gradients(folder, dtype, with_planner, truth == "planner_f64.npz")
    stored = np.load(os.path.join(folder, truth))
    if not np.array_equal(result.best_mode.numpy(), stored["best_mode"]):
        yield "loss", "best modes", float("inf")
    found = [("loss", "loss", result.total), ("loss", "mfma_loss", result.multi_future), ("loss", "score_loss", result.score)]
    found += [("output", name, getattr(outputs, name)) for name in ("plans", "predictions", "scores", "cost_weights")]
    if with_planner:
        found += [("plan loss", "plan_loss_terms", result.plan_terms), ("loss", "plan_cost", result.plan_cost)]
        found += [("output", "plan_final", result.controls), ("output", "planner_error", result.residuals)]
    for kind, name, ours in found:
        if name in stored:
            yield kind, name, _relative(ours.detach().numpy(), stored[name])
    largest = stored["grad_norm"].max()
    for name, grad, norm, direction in zip(NAMES, grads, stored["grad_norm"], stored["grad_dot"], strict=True):
        # Some are zero by theory, and hold rounding on either side; in float32 all are measured against the largest.
        size = max(norm, 1e-7) if dtype == torch.float64 else largest
        yield "gradient", f"norm of {name}", abs(grad.norm().item() - norm) / size
        dot = float(grad.numpy().ravel() @ (2.0 * parameters.uniform(f"{name}#dot", grad.numel()) - 1.0))
        yield "gradient", f"direction of {name}", abs(dot - direction) / (size * max(1.0, np.sqrt(grad.numel() / 3.0)))


def dropout_slope(folder, p=0.1, reach=1e-8):
    """Of the loss with the same masks each time, along a random direction: how far the gradients are from a difference quotient, relative."""
    tensors = parameters.formula_parameters(torch.float64)
    joined = batch.collate(batch.read_windows(np.load(os.path.join(folder, "batch.npz"))), torch.float64)
    generator = torch.Generator().manual_seed(1)
    direction = {name: torch.randn(tensor.shape, generator=generator, dtype=torch.float64) * tensor.detach().abs().mean() for name, tensor in tensors.items()}
    # The padded tables' first rows are no parameters; the score's loss is left out, for its head is detached from what lies before it.
    for table in parameters.PADDED_TABLES:
        direction[f"lane_net.{table}.weight"][0] = 0.0

    def loss(shift):
        torch.manual_seed(7)
        moved = {name: (tensor.detach() + shift * direction[name]).requires_grad_(True) for name, tensor in tensors.items()}
        result = losses.step_losses(network.forward(moved, joined, p), joined, False)
        return result.total - result.score, moved

    value, moved = loss(0.0)
    value.backward()
    slope = sum((tensor.grad * direction[name]).sum().item() for name, tensor in moved.items() if tensor.grad is not None)
    quotient = (loss(reach)[0].item() - loss(-reach)[0].item()) / (2.0 * reach)
    return abs(slope - quotient) / abs(quotient)


def run(folder, everything):
    """Prints the table; true when all is within tolerance."""
    slope = dropout_slope(folder)
    print(f"gradients under dropout against a difference quotient: {slope:8.1e} of 1e-05" + ("" if slope <= 1e-5 else "  OUT"))
    good = slope <= 1e-5
    for dtype, precision in ((torch.float64, "highest"), (torch.float32, "highest"), (torch.float32, speed.fastest_float32())):
        torch.set_float32_matmul_precision(precision)
        for truth in TRUTHS:
            in_float32 = IN_FLOAT32 if truth.startswith("no_planner") else IN_FLOAT32_PLANNED
            allowed = IN_FLOAT64 if dtype == torch.float64 else in_float32
            rows = [(name, value, allowed.get(kind, allowed["loss"]), kind) for kind, name, value in deviations(folder, truth, dtype)]
            print(f"{truth}: ours in {str(dtype)[6:]}" + (f", products '{precision}'" if dtype == torch.float32 else ""))
            gradients = [row for row in rows if row[3] == "gradient"]
            shown = rows if everything else [row for row in rows if row[3] != "gradient"]
            for name, value, most, _ in shown:
                print(f"  {name:<80} {value:8.1e} of {most:.0e}" + ("" if value <= most else "  OUT"))
            name, value, most, _ = max(gradients, key=lambda row: row[1])
            print(f"  worst of {len(gradients)} gradient figures: {name:<48} {value:8.1e} of {most:.0e}" + ("" if value <= most else "  OUT"))
            good &= all(value <= most for _, value, most, _ in rows)
    print("all within tolerance" if good else "out of tolerance")
    return good
