"""The texts of a new package: a block, metric, plot and verb, their test, and the pyproject.

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
description = "A block, a metric, a plot and a verb for spikeblocks"
requires-python = ">=3.11"
dependencies = ["spikeblocks>=VERSION"]

[project.optional-dependencies]
test = ["pytest>=8"]

# What graphs can name: 'runtime plugins' lists it. Each is imported when a graph names it.
[project.entry-points."spikeblocks.blocks"]
Peak = "PACKAGE.blocks:Peak"

[project.entry-points."spikeblocks.metrics"]
crest_factor = "PACKAGE.metrics:CREST_FACTOR"

[project.entry-points."spikeblocks.plots"]
histogram = "PACKAGE.plots:HISTOGRAM"

[project.entry-points."spikeblocks.verbs"]
wiring = "PACKAGE.wiring"

[tool.setuptools.packages.find]
where = ["src"]

[tool.pytest.ini_options]
testpaths = ["tests"]
"""

INIT = '''\
"""A block, a metric, a plot and a verb for spikeblocks; pyproject.toml says under which names."""
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

PLOTS = '''\
"""Plots of PACKAGE."""

from collections.abc import Mapping, Sequence
from typing import Any

from runtime.observation import PlotKind, Recording


def draw(figure: Any, recordings: Sequence[Recording], end: float) -> Any:
    """How often each value of the columns was recorded; returns the top axes."""
    axes = figure.subplots()
    for recording in recordings:
        for label, values in zip(recording.labels, recording.columns.T, strict=True):
            axes.hist(values, bins=50, histtype="step", label=label)
    return name_axes(axes, recordings[0])


def overlay(figure: Any, plot: Any, runs: Mapping[str, Any]) -> Any:
    """The first column in each run, for `runtime compare` and `--vs`."""
    axes, name = figure.subplots(), plot.of[0]
    shown = {label: run.probes[name] for label, run in runs.items() if name in run.probes}
    for label, recording in shown.items():
        axes.hist(recording.columns[:, 0], bins=50, histtype="step", label=label)
    return name_axes(axes, next(iter(shown.values())))


def name_axes(axes: Any, recording: Recording) -> Any:
    unit = f" [{recording.units[0]}]" if recording.units[0] else ""
    axes.set(xlabel=f"{recording.labels[0]}{unit}", ylabel="rows")
    axes.legend()
    return axes


HISTOGRAM = PlotKind("how often each value was recorded", draw, overlay)
'''

VERB = '''\
"""``runtime wiring``: how many wires each block of a graph has."""

from argparse import ArgumentParser, Namespace

HELP = "how many wires each block of a graph has"
EXAMPLES = """
runtime wiring my.yaml
"""


def add(parser: ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("graph", help="a graph file")


def run(options: Namespace) -> int:
    """Print a line for each block; returns the exit code."""
    import runtime  # it loads NumPy, which --help does without

    graph = runtime.load(options.graph)
    for name, block in graph.blocks.items():
        into = sum(wire.target.startswith(f"{name}.") for wire in graph.wires)
        out = sum(wire.source.startswith(f"{name}.") for wire in graph.wires)
        print(f"{name} ({block.type}): {into} in, {out} out")
    return 0
'''

TEST = '''\
"""The block keeps the rules, and all compute their closed form for a sine wave."""

import math
from pathlib import Path

import pytest
import runtime
from PACKAGE.blocks import Peak
from runtime import check_block
from runtime.cli import run

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
    "plots": {"values": {"kind": "histogram", "of": "wave.out"}},
}


def test_the_block_keeps_the_rules() -> None:
    check_block(Peak(least=0.5))


def test_a_sine_of_amplitude_2() -> None:
    result = runtime.load(GRAPH).run()
    # sin(2 pi t) is sin(pi / 6) = 0.5 at 1/12 s, and largest at 1/4 s.
    assert result["peak"][:84].max() == pytest.approx(2 * math.sin(2 * math.pi * 0.083))
    assert result["peak"][250:] == pytest.approx(2.0)
    assert result.metrics["crest"] == pytest.approx(math.sqrt(2.0))


def test_the_plot_shows_every_row(tmp_path: Path) -> None:
    result = runtime.load(GRAPH).run()
    (axes,) = result.plot("values").axes
    assert axes.get_ylabel() == "rows"
    # The outline of a histogram; each of the 1000 rows is in one of its bins.
    heights = axes.patches[0].get_xy()[1:-1:2, 1]
    assert heights.sum() == 1000


def test_the_verb_counts_wires(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "wave.yaml"
    runtime.load(GRAPH).save(path)
    assert run(["wiring", str(path)]) == 0
    shown = capsys.readouterr().out
    assert "wave (Function): 0 in, 1 out" in shown and "peak (Peak): 1 in, 0 out" in shown
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
        f"src/{name}/plots.py": PLOTS,
        f"src/{name}/wiring.py": VERB,
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
