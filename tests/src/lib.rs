//! Drives the built programs from outside; everything is in `tests/it`, and a planner that lies in `examples`.
