"""Blocks of FMUs: equal to the graph that was exported, with states that can be kept."""

from __future__ import annotations

import os
import re
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import runtime
from blocks.core import ParameterError, Scalar
from blocks.limits import size
from runtime.errors import GraphError, SimulationError
from spikeblocks.fmu import FMU, description
from spikeblocks.fmu.description import described
from spikeblocks.fmu.export import export_fmu

pytest.importorskip("fmpy", reason="needs the extra fmu")
SIZES = (description.FMU, description.UNPACKED, description.TEXT)
COUNTS = (description.ENTRIES, description.ALL_NUMBERS)
REFERENCE = Path(os.environ.get("SPIKEBLOCKS_REFERENCE_FMUS", "missing"))
needs_reference = pytest.mark.skipif(
    not REFERENCE.is_dir(),
    reason="SPIKEBLOCKS_REFERENCE_FMUS names no folder with fmi2/*.fmu and fmi3/*.fmu",
)


def graph_of(block: dict[str, Any], wire: str = "", **run: Any) -> runtime.Graph:
    """A graph with the block ``fmu``, and a sine wired to it."""
    return runtime.load(
        {
            "graph": "imported",
            "run": {"dt": 0.01, "until": 1.0, **run},
            "blocks": {"fmu": block, "wave": {"type": "Sine", "frequency": 1.0, "amplitude": 2.0}},
            "wires": {"fmu": {"u": wire}} if wire else {},
            "probes": {"out": "fmu.out"},
        }
    )


@pytest.fixture(scope="module")
def lag(tmp_path_factory: pytest.TempPathFactory) -> tuple[runtime.Graph, dict[int, Path]]:
    """A noisy lag with an input as a graph, and as FMUs of both versions."""
    graph = runtime.load(
        {
            "graph": "lag",
            "run": {"dt": 0.01, "until": 1.0, "seed": 4},
            "inputs": {"push": {"type": "Scalar", "default": 0.0, "unit": "N"}},
            "outputs": {"place": "lag.out", "noisy": "sum.out"},
            "blocks": {
                "lag": {"type": "TransferFunction", "numerator": [1.0], "denominator": [0.2, 1.0]},
                "noise": {"type": "WhiteNoise", "density": 0.01, "dt": 0.02},
                "sum": {"type": "Sum"},
            },
            "wires": {"lag": {"input": "inputs.push"}, "sum": {"terms": ["lag.out", "noise.out"]}},
            "probes": {"place": "lag.out", "noisy": "sum.out"},
        }
    )
    folder = tmp_path_factory.mktemp("fmus")
    files = {}
    for fmi in (2, 3):
        made = export_fmu(graph, folder / str(fmi), fmi=fmi)
        files[fmi] = made.folder / made.files[0]
    return graph, files


Lag = tuple[runtime.Graph, dict[int, Path]]


@pytest.mark.parametrize("fmi", [2, 3])
def test_a_graph_that_was_exported_comes_back_with_the_same_bits(fmi: int, lag: Lag) -> None:
    graph, files = lag
    driven = graph_of({"type": "FMU", "file": str(files[fmi])}, "wave.out")
    assert driven.network.types["fmu", "out"].names == ("place", "noisy")
    found = driven.run(engine="python")
    session = graph.session()
    rows = []
    for k in range(100):
        session.write("push", float(2.0 * np.sin(2.0 * np.pi * (k * 0.01))))
        session.step()
        rows.append((session.read("lag.out"), session.read("sum.out")))
    # What a session reads after its step k is what the run computes at tick k + 1.
    np.testing.assert_allclose(found["out"][1:, 0], [row[0] for row in rows][:-1], atol=1e-14)


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("engine", ["python", "compiled"])
def test_a_snapshot_has_the_state_of_the_fmu(fmi: int, engine: str, lag: Lag) -> None:
    driven = graph_of({"type": "FMU", "file": str(lag[1][fmi])}, "wave.out", engine=engine)
    session = driven.session()
    session.run(0.3)
    saved, other = session.snapshot(), session.branch()
    session.run(0.3)
    first = session.read("fmu.out").copy()
    session.restore(saved)
    session.run(0.3)
    assert np.array_equal(session.read("fmu.out"), first)
    other.run(0.3)
    assert np.array_equal(other.read("fmu.out"), first)
    assert np.array_equal(driven.run()["out"][:60], session.result()["out"][:60])


@pytest.mark.parametrize("fmi", [2, 3])
def test_the_block_follows_the_rules_for_blocks(fmi: int, lag: Lag) -> None:
    runtime.check_block(FMU(file=str(lag[1][fmi])), inputs={"u": Scalar})


def test_an_fmu_that_cannot_write_its_state_says_so_when_a_run_goes_back(
    lag: Lag, tmp_path: Path
) -> None:
    import zipfile

    file = tmp_path / "poor.fmu"
    with zipfile.ZipFile(lag[1][2]) as old, zipfile.ZipFile(file, "w") as new:
        for name in old.namelist():
            text = old.read(name)
            if name == "modelDescription.xml":
                text = text.replace(b'canSerializeFMUstate="true"', b"")
            new.writestr(name, text)
    driven = graph_of({"type": "FMU", "file": str(file)}, "wave.out", engine="python")
    assert np.array_equal(
        driven.run()["out"],
        graph_of({"type": "FMU", "file": str(lag[1][2])}, "wave.out").run(engine="python")["out"],
    )
    session = driven.session()
    session.run(0.3)
    saved = session.snapshot()
    session.run(0.1)
    session.restore(saved)
    with pytest.raises(SimulationError, match="cannot write its state"):
        session.run(0.1)


@pytest.mark.parametrize(
    ("block", "wire", "said"),
    [
        ({"file": "none.fmu"}, "", "none.fmu': No such file or directory"),
        ({"values": {"lag.taau": 1.0}}, "wave.out", "'lag.taau' is not a variable of the FMU"),
        ({}, "", "expected 1 components, push; got 0"),
        ({"type": "ModelExchangeFMU"}, "wave.out", "the FMU is for CoSimulation; use type: FMU"),
    ],
)
def test_what_is_wrong_with_an_fmu_is_said(
    block: dict[str, Any], wire: str, said: str, lag: Lag
) -> None:
    with pytest.raises(GraphError) as error:
        graph_of({"type": "FMU", "file": str(lag[1][2])} | block, wire).check()
    assert said in str(error.value)


def test_a_file_that_is_no_fmu(tmp_path: Path) -> None:
    file = tmp_path / "text.fmu"
    file.write_text("no archive")
    with pytest.raises(GraphError, match=r"'text.fmu' is not an FMU of FMI 2.0 or 3.0"):
        graph_of({"type": "FMU", "file": str(file)}).check()


@needs_reference
@pytest.mark.parametrize("fmi", [2, 3])
class TestReference:
    """The FMUs with which the authors of the standard test importers."""

    def block(self, fmi: int, name: str, kind: str) -> dict[str, Any]:
        return {"type": kind, "file": str(REFERENCE / f"fmi{fmi}" / f"{name}.fmu")}

    def test_decay_by_its_own_steps(self, fmi: int) -> None:
        graph = graph_of(self.block(fmi, "Dahlquist", "FMU"), dt=0.1)
        expected = 0.9 ** np.arange(10)  # forward Euler of x' = -x, with its step of 0.1 s
        np.testing.assert_allclose(graph.run(engine="python")["out"], expected, rtol=1e-12)

    def test_decay_by_our_solver(self, fmi: int) -> None:
        graph = graph_of(self.block(fmi, "Dahlquist", "ModelExchangeFMU"), solver="rk4")
        result = graph.run(engine="python")
        np.testing.assert_allclose(result["out"], np.exp(-result.time("out")), rtol=1e-9)

    def test_an_oscillator_is_that_of_the_same_equations(self, fmi: int) -> None:
        graph = graph_of(self.block(fmi, "VanDerPol", "ModelExchangeFMU"), solver="rk4", until=5.0)
        equations = {
            "type": "DynamicSystem",
            "states": ["x0", "x1"],
            "initial": [2.0, 0.0],
            "derivative": ["x1", "(1 - x0**2)*x1 - x0"],
        }
        own = graph_of(equations, solver="rk4", until=5.0)
        np.testing.assert_allclose(
            graph.run(engine="python")["out"], own.run(engine="python")["out"], atol=1e-12
        )

    def test_a_bounce_is_located(self, fmi: int) -> None:
        graph = graph_of(self.block(fmi, "BouncingBall", "ModelExchangeFMU"), solver="rk4")
        result = graph.run(engine="python")
        t, height = result.time("out"), result["out"][:, 0]
        first = np.sqrt(2.0 / 9.81)  # falls from 1 m, and bounces with 0.7 of its speed
        after = (t > first) & (t < first + 0.5)
        since = t[after] - first
        expected = 0.7 * 9.81 * first * since - 0.5 * 9.81 * since**2
        np.testing.assert_allclose(height[after], expected, atol=1e-7)
        session = graph.session()
        session.run(0.3)
        saved = session.snapshot()
        session.run(0.4)
        last = session.read("fmu.out").copy()
        session.restore(saved)
        session.run(0.4)
        assert np.array_equal(session.read("fmu.out"), last)

    def test_announced_times_are_events(self, fmi: int) -> None:
        kind = "ModelExchangeFMU"
        result = graph_of(
            self.block(fmi, "Stair", kind), until=4.5, solver="rk4", events="ticks"
        ).run(engine="python")
        expected = 1.0 + np.floor(result.time("out") + 1e-9)
        assert np.array_equal(result["out"], expected)


@pytest.mark.parametrize("kind", ["FMU", "ModelExchangeFMU"])
def test_no_modules_loads_no_library(kind: str, tmp_path: Path) -> None:
    # Refused by its type: the file is not even looked for.
    source = {"run": {"dt": 0.1, "until": 1}, "blocks": {"f": {"type": kind, "file": "no.fmu"}}}
    with pytest.raises(GraphError, match="executes the library in the FMU, which is refused"):
        runtime.load(source, modules=False).check()


def described_by(tmp_path: Path, text: bytes) -> Path:
    with zipfile.ZipFile(tmp_path / "a.fmu", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("modelDescription.xml", text)
    return tmp_path / "a.fmu"


@pytest.mark.parametrize(
    ("inner", "reason"),
    [
        ('<Dimension start="1000000000"/>', "more than 1,000,000 numbers"),
        ('<Dimension start="-1"/>', "more than 1,000,000 numbers"),
        ("<a/>" * 1_000_001, "more than 1,000,000 elements and attributes"),
    ],
)
def test_a_description_that_asks_for_much_is_refused(
    tmp_path: Path, inner: str, reason: str
) -> None:
    text = '<fmiModelDescription fmiVersion="3.0"><ModelVariables>'
    text += f'<Float64 name="a" valueReference="1" causality="output">{inner}</Float64>'
    text += "</ModelVariables></fmiModelDescription>"
    with pytest.raises(ParameterError, match=reason):
        described(str(described_by(tmp_path, text.encode())))


def test_the_limits_are_those_of_the_page() -> None:
    page = Path(__file__).parents[3].joinpath("docs", "fmu.md").read_text(encoding="utf-8")
    limits = page.partition("## Limits")[2]
    assert re.findall(r"\d+ [MG]iB", limits) == [size(n) for n in SIZES]
    assert re.findall(r"\d,[\d,]+", limits) == [f"{n:,}" for n in COUNTS]


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
def test_entities_are_refused_in_any_encoding(tmp_path: Path, encoding: str) -> None:
    text = f'<?xml version="1.0" encoding="{encoding}"?>'
    text += '<!DOCTYPE a [<!ENTITY b "b">]><fmiModelDescription fmiVersion="3.0"/>'
    with pytest.raises(ParameterError, match="has a document type"):
        described(str(described_by(tmp_path, text.encode(encoding))))
