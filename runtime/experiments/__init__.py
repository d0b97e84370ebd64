"""Experiments over graphs: sweeps of knobs and ablations of blocks, in parallel and resumable."""
