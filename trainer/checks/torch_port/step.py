"""Training steps of one configuration, timed in this process."""

import os
import resource
import time

import numpy as np
import safetensors.torch
import torch

from . import batch, losses, network, parameters, speed


def run(settings):
    """Wall and CPU seconds of each step after the warm-up, and the process's peak memory (MB)."""
    imported = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    torch.set_num_threads(settings.threads)
    torch.set_float32_matmul_precision(speed.fastest_float32() if settings.products == "fastest" else "highest")
    if settings.keep_heap:
        speed.keep_heap()
    torch.manual_seed(42)
    windows = batch.read_windows(np.load(os.path.join(settings.vectors, "batch.npz")))
    repeated = [windows[i % len(windows)] for i in range(settings.batch)]
    started = time.perf_counter()
    joined = batch.collate(repeated, torch.float32)
    joining = time.perf_counter() - started
    tensors = parameters.formula_parameters(torch.float32)
    if settings.weights:
        given = safetensors.torch.load_file(settings.weights)
        with torch.no_grad():
            for name, tensor in tensors.items():
                tensor.copy_(given[name].reshape(tensor.shape))
    learned = list(tensors.values())
    optimiser = torch.optim.Adam(learned, lr=2e-4, fused=True)
    wall, cpu, values = [], [], []
    for step in range(settings.warm_up + settings.steps):
        started, burnt = time.perf_counter(), time.process_time()
        optimiser.zero_grad(set_to_none=True)
        result = losses.step_losses(network.forward(tensors, joined, settings.dropout), joined, not settings.no_planner, settings.coupled)
        result.total.backward()
        torch.nn.utils.clip_grad_norm_(learned, 5.0)
        optimiser.step()
        values.append(result.total.item())
        del result
        if step >= settings.warm_up:
            wall.append(time.perf_counter() - started)
            cpu.append(time.process_time() - burnt)
    return {
        "wall": wall,
        "cpu": cpu,
        "joining": joining,
        "losses": values,
        "peak": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
        "imported": imported,
        "torch": torch.__version__,
        "precision": torch.get_float32_matmul_precision(),
    }
