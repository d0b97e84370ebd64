"""The outputs of a block by name."""

from __future__ import annotations

from types import SimpleNamespace

from blocks import Block, BlockState


def outputs(block: Block, state: BlockState, t: float = 0.0) -> SimpleNamespace:
    """The outputs of a block without feedthrough, from one call."""
    (evaluation,) = block.spec.evaluations
    values = getattr(block, evaluation.method)(state, t)
    return SimpleNamespace(**dict(zip(evaluation.outputs, values, strict=True)))
