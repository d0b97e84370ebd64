"""Names of other tools lead to ours, and a constant infers the type of its value."""

from __future__ import annotations

import re

import numpy as np
import pytest

import runtime
from blocks.library.registry import BUILTIN
from runtime.network.other_names import _NAMES, ours_for


def message(kind: str) -> str:
    graph = {"run": {"dt": 0.1, "until": 1}, "blocks": {"b": {"type": kind}}}
    with pytest.raises(runtime.GraphError) as caught:
        runtime.load(graph).check()
    return str(caught.value)


@pytest.mark.parametrize(
    ("written", "ours"),
    [
        ("Saturation", "Clip"),
        ("Scope", "an entry of 'probes:'"),
        ("ZOH", "Hold"),
        ("Transfer Fcn", "TransferFunction"),
        ("FOPDT", "TransferFunction"),
        ("LTI_SISO", "TransferFunction"),
        ("Zero-Order Hold", "Hold"),
        ("ODE", "DynamicSystem"),
        ("SinusoidalSource", "Sine"),
        ("demux", "a slice on the wire"),
    ],
)
def test_a_block_of_another_tool_is_named_as_ours(written: str, ours: str) -> None:
    assert f"no block type '{written}'; here: {ours}" in message(written)


def test_what_is_suggested_exists_and_is_not_suggested_for_itself() -> None:
    for ours in _NAMES:
        if re.fullmatch(r"\w+", ours):
            assert ours in BUILTIN
    assert not ours_for("AdaptiveEnsemble")


def test_a_misspelt_type_of_ours_is_still_found() -> None:
    assert "did you mean 'Integrator'?" in message("Integratr")


def test_an_array_is_a_constant_vector() -> None:
    graph = {
        "run": {"dt": 0.1, "until": 0.2},
        "params": {"gains": [2, 3, 4]},
        "blocks": {
            "c": {"type": "Constant", "value": [1, 2, 3]},
            "g": {"type": "Gain", "gain": "$gains"},
        },
        "wires": {"g": {"input": "c.value"}},
        "probes": {"y": "g.out"},
    }
    found = runtime.load(graph).run()["y"]
    np.testing.assert_array_equal(np.asarray(found)[-1], [2.0, 6.0, 12.0])
