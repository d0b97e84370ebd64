"""Every graph of the gallery gives the same under both engines: spikes exactly, else to 1e-12."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import runtime
from tests.compilers import needs_compiler

GALLERY = Path(runtime.__file__).parents[1] / "graphs" / "gallery"
TICKS = 100

pytestmark = needs_compiler


def graphs() -> list[object]:
    """Graphs of populations take long to start, under either engine."""
    names = [path.relative_to(GALLERY.parent).with_suffix("") for path in GALLERY.rglob("*.yaml")]
    return [
        pytest.param(str(name), marks=[pytest.mark.slow] if len(name.parts) > 2 else [])
        for name in sorted(names)
    ]


@pytest.mark.parametrize("name", graphs())
def test_both_engines_agree(name: str) -> None:
    graph = runtime.load(GALLERY.parent / f"{name}.yaml")
    graph = graph.set("run.until", min(graph.network.until, TICKS * graph.network.dt))
    python, compiled = (graph.run(engine=engine) for engine in ("python", "compiled"))
    for probe, recording in python.probes.items():
        given, found = recording.values, compiled.probes[probe].values
        if "Spikes" in recording.kinds:
            np.testing.assert_array_equal(found, given, err_msg=probe)
        np.testing.assert_allclose(found, given, 1e-12, 1e-12, err_msg=probe)
