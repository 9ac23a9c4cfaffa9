"""What makes PyTorch fast on a CPU without touching a line of the model: which library multiplies, and memory that is not handed back every step."""

import ctypes

import torch


def fastest_float32():
    """`medium` where it is the faster library's float32, else `highest`.

    `torch.set_float32_matmul_precision("medium")` allows oneDNN to multiply float32 matrices, with bfloat16 where the processor has matrix units for it. Where
    it has not, oneDNN computes plain float32, and on processors that MKL does not favour twice as fast as MKL. So: take it if the result is float32's.
    """
    generator = torch.Generator().manual_seed(0)
    left, right = torch.randn(256, 384, generator=generator), torch.randn(384, 256, generator=generator)
    exact = left.double() @ right.double()
    before = torch.get_float32_matmul_precision()
    torch.set_float32_matmul_precision("medium")
    errors = []
    for product in (left @ right, torch.bmm(left[None], right[None])[0], torch.addmm(torch.zeros(256), left, right), (right.t() @ left.t()).t()):
        errors.append(((product.double() - exact).abs().max() / exact.abs().max()).item())
    torch.set_float32_matmul_precision(before)
    return "medium" if max(errors) < 1e-5 else "highest"


def keep_heap():
    """Large blocks come from the heap, and the heap does not shrink: no fresh pages to be zeroed by the kernel each step (glibc)."""
    try:
        mallopt = ctypes.CDLL("libc.so.6").mallopt
    except OSError:
        return
    trim_threshold, mmap_max = -1, -4
    mallopt(mmap_max, 0)
    mallopt(trim_threshold, 2**31 - 1)
