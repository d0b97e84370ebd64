"""Continuous blocks in discrete time, beside scipy, closed forms and the continuous loop."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import signal

import runtime

H = 0.02
U = np.random.default_rng(1).standard_normal(100)


def alone(entry: dict[str, Any], **run: Any) -> runtime.Graph:
    """A block whose input holds between the ticks of ``H``."""
    return runtime.load(
        {
            "run": {"dt": H, "until": 2.0, **run},
            "blocks": {
                "u": {
                    **{"type": "Piecewise", "method": "hold"},
                    **{"times": (H * np.arange(100)).tolist(), "values": U.tolist()},
                },
                "it": entry,
            },
            "wires": {"it": {"input": "u.out"}},
            "probes": {"y": "it.out"},
        }
    )


PLANTS = {
    "TransferFunction": ([3.0, 1.0], [2.0, 1.0, 5.0]),
    "SecondOrder": ([2 * 36.0], [1.0, 2 * 0.3 * 6.0, 36.0]),
    "Butterworth": signal.butter(6, 2 * np.pi * 3.0, analog=True),
    "Integrator": ([1.0], [1.0, 0.0]),
}
ENTRIES: dict[str, dict[str, Any]] = {
    "TransferFunction": {"numerator": [3.0, 1.0], "denominator": [2.0, 1.0, 5.0]},
    "SecondOrder": {"natural_frequency": 6.0, "damping": 0.3, "gain": 2.0},
    "Butterworth": {"order": 6, "cutoff": 3.0},
    "Integrator": {},
}


@pytest.mark.parametrize("method", ["tustin", "zoh"])
@pytest.mark.parametrize("kind", ENTRIES)
def test_a_sampled_block_is_scipys(kind: str, method: str) -> None:
    graph = alone({"type": kind, **ENTRIES[kind]}).discretized(method)
    assert not any(entry.cls.spec.continuous for entry in graph.network.entries.values())
    b, a, _ = signal.cont2discrete(PLANTS[kind], H, method=method)
    np.testing.assert_allclose(graph.run()["y"], signal.lfilter(b[0], a, U), atol=1e-8)
    assert graph.notes[0].startswith("'it' is now a Discrete")


def test_by_zoh_nothing_changes_for_an_input_that_holds() -> None:
    graph = alone(
        {
            "type": "StateSpace",
            **{
                "A": [[0.0, 1.0], [-4.0, -0.5]],
                "B": [0.0, 1.0],
                "C": [1.0, 0.5],
                "x0": [1.0, -1.0],
            },
        },
        **{"solver": "dopri5", "rtol": 1e-10, "atol": 1e-12},
    )
    np.testing.assert_allclose(graph.discretized("zoh").run()["y"], graph.run()["y"], atol=1e-8)


def test_by_tustin_an_initial_state_gives_the_same_output() -> None:
    """Without input, y = exp(A t) x0 up to H squared, from its very first value."""
    entry = {
        "type": "StateSpace",
        "A": [[0.0, 1.0], [-4.0, -0.5]],
        "B": [0.0, 0.0],
        "C": [1.0, 0.5],
    }
    graph = alone({**entry, "x0": [1.0, -1.0]}, solver="dopri5", rtol=1e-10)
    y = graph.run()["y"]
    found = graph.discretized("tustin").run()["y"]
    assert found[0] == pytest.approx(y[0], abs=1e-14)
    np.testing.assert_allclose(found, y, atol=1e-3)


@pytest.mark.parametrize(
    ("numerator", "denominator"),
    [
        ([2.0], [1.0, 3.0]),
        ([2.0, 1.0], [1.0, 3.0, 2.0]),
        ([4.0], [1.0, 0.4, 4.0]),
        ([1.0], [1, 1, 0]),
    ],
)
def test_matched_maps_poles_and_zeros(numerator: list[float], denominator: list[float]) -> None:
    entry = {"type": "TransferFunction", "numerator": numerator, "denominator": denominator}
    block = alone(entry).discretized("matched").network.entries["it"].block
    b, a = (block.value(key) for key in ("numerator", "denominator"))
    poles = np.exp(np.roots(denominator) * H)
    np.testing.assert_allclose(np.sort_complex(np.roots(a)), np.sort_complex(poles), atol=1e-7)
    zeros = [*np.exp(np.roots(numerator) * H), *[-1.0] * (len(denominator) - len(numerator) - 1)]
    np.testing.assert_allclose(np.sort(np.roots(b)), np.sort(np.real(zeros)), atol=1e-7)
    # Equal at low frequencies, an integrator's infinite gain included.
    w = 1e-3
    z = np.exp(1j * w * H)
    expected = np.polyval(numerator, 1j * w) / np.polyval(denominator, 1j * w)
    assert np.polyval(b, z) / np.polyval(a, z) == pytest.approx(expected, rel=1e-3)


LOOP = """
run: {dt: 0.001, until: 3.0}
blocks:
  r: {type: Step}
  e: {type: Sum, signs: [1, -1]}
  pid: {type: PID, structure: ideal, kp: 3.0, ki: 2.0, kd: 0.05, n: 50, lower: -2.0, upper: 2.0}
  plant: {type: SecondOrder, natural_frequency: 2.0, damping: 0.4}
wires:
  e: {terms: [r.out, plant.out]}
  pid: {error: e.out}
  plant: {input: pid.out}
probes: {y: plant.out}
"""


@pytest.mark.parametrize("method", ["tustin", "zoh"])
def test_a_sampled_pid_controls_as_the_continuous_one(tmp_path: Path, method: str) -> None:
    file = tmp_path / "loop.yaml"
    file.write_text(LOOP)
    graph = runtime.load(file)
    sampled = graph.discretized(method, 0.005, "pid").run()["y"]
    np.testing.assert_allclose(sampled, graph.run()["y"], atol=0.02)


def test_a_pid_is_exported_once_it_is_sampled(cli: Any, tmp_path: Path) -> None:
    file, folder = tmp_path / "loop.yaml", tmp_path / "c"
    file.write_text(LOOP)
    refused = cli("export", str(file), str(folder), "--block", "pid")
    assert refused.returncode == 2
    assert "--discretize tustin:pid makes of it" in refused.stderr
    change = ("--discretize", "tustin,0.01:pid")
    made = cli("export", str(file), str(folder), "--block", "pid", *change)
    assert made.returncode == 0, made.stderr
    assert (folder / "controller.c").exists()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("tustn", "there is no method 'tustn', did you mean 'tustin'?"),
        ("tustin:pidd", "there is no block 'pidd', did you mean 'pid'?"),
        ("tustin,x", "expected a step in s, as in tustin,0.01:pid"),
        ("matched:pid", "'pid' (PID) stays continuous: a PID has no matched form"),
        ("zoh:e", "'e' (Sum) has no form in discrete time"),
    ],
)
def test_changes_that_cannot_be(cli: Any, tmp_path: Path, change: str, message: str) -> None:
    file = tmp_path / "loop.yaml"
    file.write_text(LOOP)
    result = cli("validate", str(file), "--discretize", change)
    assert result.returncode == 2
    assert message in result.stderr + result.stdout
