"""The texts of a new package: a block, a metric, their test, and the pyproject that offers both.

texts("my_blocks", "0.1")   # {"pyproject.toml": ..., "src/my_blocks/blocks.py": ..., ...}
"""

from __future__ import annotations

import keyword
import re
import sys

from runtime.errors import UsageError

TAKEN = ("blocks", "runtime", "spikeblocks", "graphs", "tests")

PYPROJECT = """\
[build-system]
requires = ["setuptools>=77"]
build-backend = "setuptools.build_meta"

[project]
name = "PACKAGE"
version = "0.1.0"
description = "A block and a metric for spikeblocks"
requires-python = ">=3.11"
dependencies = ["spikeblocks>=VERSION"]

[project.optional-dependencies]
test = ["pytest>=8"]

# What graphs can name: 'runtime plugins' lists it. Each is imported when a graph names it.
[project.entry-points."spikeblocks.blocks"]
Peak = "PACKAGE.blocks:Peak"

[project.entry-points."spikeblocks.metrics"]
crest_factor = "PACKAGE.metrics:CREST_FACTOR"

[tool.setuptools.packages.find]
where = ["src"]

[tool.pytest.ini_options]
testpaths = ["tests"]
"""

INIT = '''\
"""A block and a metric for spikeblocks; pyproject.toml says under which names."""
'''

BLOCKS = '''\
"""Blocks of PACKAGE."""

from blocks import Block, BlockState, Input, Output, Scalar, State, param


class Peak(Block):
    """The largest magnitude of a signal so far.

        input ─▶ [ Peak ] ─▶ out

    out_k = max(|input_0|, ..., |input_k|, least).
    """

    input = Input(Scalar)
    out = Output(Scalar)

    least: float = param(0.0, at_least=0.0, doc="value before anything larger, in its unit")

    largest = State()  # one number, which starts at 0

    def output(self, state: BlockState, t: float, input: float) -> float:
        return max(float(state.largest), abs(input), self.least)

    def update(self, state: BlockState, t: float, input: float) -> None:
        state.largest = max(float(state.largest), abs(input))
'''

METRICS = '''\
"""Metrics of PACKAGE."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from runtime.observation import MetricKind, Series


def crest_factor(series: Mapping[str, Series], options: Mapping[str, Any]) -> float | None:
    """Largest magnitude over root mean square; no value for a signal that is 0 throughout."""
    values = series["of"].values
    rms = float(np.sqrt(np.mean(values**2)))
    return float(np.abs(values).max()) / rms if rms > 0.0 else None


CREST_FACTOR = MetricKind(crest_factor, "largest magnitude over root mean square", unit="")
'''

TEST = '''\
"""The block keeps the rules, and both compute their closed form for a sine wave."""

import math

import pytest
import runtime
from PACKAGE.blocks import Peak
from runtime import check_block

GRAPH = {
    "graph": "wave",
    "run": {"dt": 0.001, "until": 1.0},
    "blocks": {
        "wave": {"type": "Function", "expression": "2 * sin(2 * pi * t)"},
        "peak": {"type": "Peak"},
    },
    "wires": {"peak": {"input": "wave.out"}},
    "probes": {"peak": "peak.out"},
    "metrics": {"crest": {"kind": "crest_factor", "of": "wave.out"}},
}


def test_the_block_keeps_the_rules() -> None:
    check_block(Peak(least=0.5))


def test_a_sine_of_amplitude_2() -> None:
    result = runtime.load(GRAPH).run()
    # sin(2 pi t) is sin(pi / 6) = 0.5 at 1/12 s, and largest at 1/4 s.
    assert result["peak"][:84].max() == pytest.approx(2 * math.sin(2 * math.pi * 0.083))
    assert result["peak"][250:] == pytest.approx(2.0)
    assert result.metrics["crest"] == pytest.approx(math.sqrt(2.0))
'''


# The package is in src/: beside a folder of its own name, which Python would take for a package
# without code, an editable installation would not be found from the folder that holds both.
def texts(name: str, version: str) -> dict[str, str]:
    """The files of a package of a name, by their path in its folder.

    Parameters
    ----------
    version : the oldest version of spikeblocks that it works with.

    Raises
    ------
    UsageError : the name cannot be that of a package.
    """
    _check(name)
    files = {
        "pyproject.toml": PYPROJECT,
        f"src/{name}/__init__.py": INIT,
        f"src/{name}/blocks.py": BLOCKS,
        f"src/{name}/metrics.py": METRICS,
        f"tests/test_{name}.py": TEST,
    }
    return {
        path: text.replace("PACKAGE", name).replace("VERSION", version)
        for path, text in files.items()
    }


def _check(name: str) -> None:
    if not re.fullmatch(r"[a-z][a-z0-9_]*", name) or keyword.iskeyword(name):
        reason = "expected lower-case letters, digits and _, as in my_blocks"
    elif name in TAKEN or name in sys.stdlib_module_names:
        reason = "Python or spikeblocks has a package of that name"
    else:
        return
    raise UsageError(f"--package {name}: {reason}")
