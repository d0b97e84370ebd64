"""Whether a document is an experiment: by itself, since every graph that is checked is asked."""

from __future__ import annotations

from runtime.document import Node


def is_experiment(document: Node) -> bool:
    """Whether a document describes an experiment, not a graph."""
    keys = ("experiment", "vary", "variants", "training", "data", "contestants")
    return any(document.get(key) for key in keys)
