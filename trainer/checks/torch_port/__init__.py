"""Our own PyTorch port of DIPP's training step: the peer that `trainer` is measured against (see torch_step.py)."""
