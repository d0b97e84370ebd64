"""Whether a document is an experiment: by itself, since every graph that is checked is asked.

In: a document. Out: True of ``{graph: my.yaml, vary: {pid.kp: [1, 2]}}``.
"""

from __future__ import annotations

from runtime.document import Node


def is_experiment(document: Node) -> bool:
    """Whether a document describes an experiment, not a graph."""
    keys = ("experiment", "vary", "variants", "training", "data", "contestants")
    return any(document.get(key) for key in keys)
