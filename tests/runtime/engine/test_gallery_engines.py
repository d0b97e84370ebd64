"""Every graph of the gallery gives the same under both engines: spikes exactly, else to 1e-12."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import runtime
from tests.compilers import needs_compiler

GALLERY = Path(runtime.__file__).parents[1] / "graphs" / "gallery"
TICKS = 100
# One of each kind; the others, and graphs of populations, take long to start, under either engine.
QUICK = {
    *("adaptive_arm", "beacons", "bouncing_ball", "cascade", "drive_to_line", "noise_filter"),
    *("recorded_push", "thermostat", "worn_actuator"),
}

pytestmark = needs_compiler


def graphs() -> list[object]:
    names = [path.relative_to(GALLERY.parent).with_suffix("") for path in GALLERY.rglob("*.yaml")]
    return [
        pytest.param(str(name), marks=[] if name.name in QUICK else [pytest.mark.slow])
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
