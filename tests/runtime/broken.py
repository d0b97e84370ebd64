"""A small sound graph for tests, and ways to break it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import runtime

SOUND = """\
graph: g
run: {dt: 0.01, until: 0.1}
blocks:
  track: {type: LinePath}
  match: {type: MatchingPoint}
  error: {type: TrackingError}
  lqr: {type: LQR, q: [1, 1, 1], r: [1, 1]}
  total: {type: Sum}
  plant: {type: DifferentialDrive}
wires:
  match: {pose: plant.pose, path: track.path}
  error: {pose: plant.pose, reference: match.reference}
  lqr: {error: error.state, reference: match.reference}
  total: {terms: [lqr.command, match.feedforward]}
  plant: {command: total.out}
probes:
  pose: plant.pose
"""
PART = """\
graph: p
params: {k: 2.0}
inputs: {a: Twist, b: {type: Twist, optional: true}}
outputs: {out: s.out}
blocks: {s: {type: Sum}, g: {type: Gain, gain: $k}}
wires: {s: {terms: [g.out, inputs.b]}, g: {input: inputs.a}}
"""


def changed(text: str, *edits: tuple[str, str] | str) -> str:
    """A text with each first ``old`` replaced by ``new``; a bare text is added at the end."""
    for edit in edits:
        if isinstance(edit, str):
            text += edit
        else:
            assert edit[0] in text, edit[0]
            text = text.replace(*edit, 1)
    return text


def problems(folder: Path, files: Mapping[str, str | bytes], name: str = "g.yaml") -> list[str]:
    """What is wrong with a graph, line by line, with paths as seen from its folder."""
    for file, text in files.items():
        path = folder / file
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
    try:
        runtime.load(folder / name).check()
    except runtime.GraphError as error:
        return [str(problem).replace(f"{folder}/", "") for problem in error.problems]
    return []


def with_part(*edits: tuple[str, str] | str) -> str:
    """The sound graph with the part ``p`` between the sum and the plant."""
    return changed(
        SOUND,
        ("  plant: {type", "  p: {graph: p.yaml}\n  plant: {type"),
        ("wires:\n", "wires:\n  p: {a: total.out}\n"),
        ("command: total.out", "command: p.out"),
        *edits,
    )
