"""Own compiled blocks beside their Python form: differences are found, Python's numbers count."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import blocks
import runtime
from runtime.engine import Engine, state
from runtime.engine.comparison import FIRST, compared
from runtime.engine.compiled import CompiledRunner, runner
from runtime.engine.compiled.kernels import make_kernels
from runtime.plan import building
from tests.compilers import needs_compiler
from tests.conftest import Run
from tests.runtime.engine.test_replay import NAMES, QUICK, assert_same, ran, short

pytestmark = needs_compiler

WRONG = ("nothing", "output", "state", "generator", "raises", "rounding")


class Own(blocks.Block):
    """Sums its input with noise; its compiled form is wrong in ``wrong`` from ``since`` on."""

    x = blocks.Input(blocks.Scalar, default=0.5)
    out = blocks.Output(blocks.Scalar)
    table = blocks.Output(blocks.Vector(3))
    total = blocks.State(3)
    wrong = blocks.param("nothing", choices=WRONG, doc="what is wrong")
    wrong: str
    since: float = blocks.param(0.0, unit="s", doc="from when on")

    def output(self, state, t, x):
        if self.wrong == "raises" and t >= self.since:
            raise ValueError("late")
        return float(state.total[1]) + x, 2.0 * state.total

    @blocks.kernel_of(output)
    def _output_kernel(self, state, t, x):
        by = 0.0
        if t >= self.since and self.wrong == "output":
            by = 1e-6
        if t >= self.since and self.wrong == "rounding":
            by = 1e-15
        return float(state.total[1]) + x + by, 2.0 * state.total

    def update(self, state, t, x):
        state.total[1] += 0.01 * x + state.rng.standard_normal()

    @blocks.kernel_of(update)
    def _update_kernel(self, state, t, x):
        state.total[1] += 0.01 * x + state.rng.standard_normal()
        if t >= self.since and self.wrong == "state":
            state.total[2] += 1e-3
        if t >= self.since and self.wrong == "generator":
            state.rng.standard_normal()


class Plain(blocks.Block):
    """Constants that a test changes in the C text; memory that it does not declare."""

    out = blocks.Output(blocks.Scalar)
    total = blocks.State(2)

    def start(self, state):
        state.apart = np.ones(2)

    def output(self, state, t):
        return 1.125 * t + float(state.total[0])

    def update(self, state, t):
        state.total[1] += 1.25
        state.apart[0] *= 1.375


class Spring(blocks.Block):
    """A mass on a spring, whose compiled form has another one."""

    angle = blocks.Output(blocks.Scalar)
    x = blocks.State(continuous=True)
    v = blocks.State(continuous=True)
    stiff: float = blocks.param(4.0, doc="of the compiled form")

    def start(self, state):
        state.x[...] = 1.0

    def output(self, state, t):
        return float(state.x)

    def derivative(self, state, t):
        return float(state.v), -4.0 * float(state.x)

    @blocks.kernel_of(derivative)
    def _derivative_kernel(self, state, t):
        return float(state.v), -self.stiff * float(state.x)


class Sign(blocks.Block):
    """The sign of a signal and its last one."""

    x = blocks.Input(blocks.Scalar)
    out = blocks.Output(blocks.Scalar)
    last = blocks.State()

    def output(self, state, t, x):
        return 1.0 if x > 0.0 else -1.0 + float(state.last)

    def update(self, state, t, x):
        state.last[...] = x


def own(until: float = 2.0, dt: float | None = None, **params: Any) -> runtime.Graph:
    graph = runtime.Graph("own", dt=0.01, until=until).add("own", Own(**params), dt=dt)
    return graph.probe("own.out").probe("own.table")


def both(graph: runtime.Graph) -> tuple[runtime.Result, runtime.Result, list[str]]:
    python, compiled = graph.run(engine="python"), graph.run(engine="compiled")
    return python, compiled, [text for text in compiled.notes if "Python engine" in text]


@pytest.mark.parametrize(
    ("wrong", "text"),
    [
        ("output", "block 'own': output 'out' is "),
        ("state", "block 'own': state 'total' is 0.001 compiled and 0.0 in Python"),
        ("generator", "block 'own': generator state.rng is at ..."),
    ],
)
@pytest.mark.parametrize("dt", [None, 0.05])
def test_a_difference_is_found_in_the_first_ticks(wrong: str, text: str, dt: float | None) -> None:
    python, compiled, notes = both(own(wrong=wrong, dt=dt))
    (note,) = notes
    tick = 1 if dt is None else 5
    assert note.startswith(text)
    assert note.endswith(
        f"; from t = {0.01 * tick:g} s (tick {tick}) on, the run is under the Python engine"
    )
    assert compiled.manifest["engine"] == f"compiled, then python from tick {tick}"
    for name in ("own.out", "own.table"):
        np.testing.assert_array_equal(compiled[name], python[name])


@pytest.mark.parametrize(
    ("number", "text"),
    [
        ("1.125", "block 'plain': output 'out' is 0.015 compiled and 0.01125 in Python; "),
        ("1.25", "block 'plain': state 'total' is 2.75 compiled and 2.5 in Python; "),
        ("1.375", "block 'plain': state.apart is 2.0625 compiled and 1.890625 in Python; "),
    ],
)
def test_a_wrong_translation_is_found(
    monkeypatch: pytest.MonkeyPatch, number: str, text: str
) -> None:
    def planted(*given: Any) -> Any:
        made = make_kernels(*given)
        kernel = made.compiled["plain"]
        assert number in kernel.text
        made.compiled["plain"] = replace(kernel, text=kernel.text.replace(number, "1.5"))
        return made

    monkeypatch.setattr(runner, "make_kernels", planted)
    graph = runtime.Graph("plain", dt=0.01, until=1.0).add("plain", Plain()).probe("plain.out")
    python, compiled, (note,) = both(graph)
    assert note.startswith(text)
    np.testing.assert_array_equal(compiled["plain.out"], python["plain.out"])


@pytest.mark.parametrize("wrong", ["output", "state", "generator"])
def test_a_late_difference_is_found_on_the_same_tick_each_time(wrong: str) -> None:
    graph = own(until=400.0, wrong=wrong, since=30.0)
    python, compiled, notes = both(graph)
    tick = ran(graph, CompiledRunner).python_from
    assert len(notes) == 1 and f"(tick {tick})" not in notes[0]  # another seed, another tick
    again = graph.run(engine="compiled")
    assert again.manifest["engine"] == compiled.manifest["engine"]
    np.testing.assert_array_equal(again["own.out"], compiled["own.out"])
    if wrong == "state":  # which no output reads from here on, but the table
        np.testing.assert_array_equal(compiled["own.out"], python["own.out"])
    np.testing.assert_array_equal(compiled["own.out"][:3000], python["own.out"][:3000])


@pytest.mark.parametrize("wrong", ["nothing", "rounding"])
def test_no_difference_is_no_note_and_changes_nothing(wrong: str) -> None:
    graph = own(until=400.0, wrong=wrong)
    _, _, notes = both(graph)

    def apart(engine: Engine) -> None:
        assert engine.exact is not None and engine.exact.comparison is not None
        engine.exact.comparison = None

    assert notes == []
    assert_same(ran(graph, CompiledRunner, apart), ran(graph, CompiledRunner))


def test_where_only_python_raises_the_error_is_pythons() -> None:
    texts = []
    for engine in ("python", "compiled"):
        with pytest.raises(runtime.SimulationError) as caught:
            own(wrong="raises", since=0.05).run(engine=engine)
        texts.append(str(caught.value))
    assert texts[0] == texts[1]
    assert texts[0].startswith("block 'own' at tick 5 (t = 0.05 s): ValueError: late")


@pytest.mark.parametrize("solver", ["euler", "rk4", "dopri5"])
@pytest.mark.parametrize("stiff", [4.0, 4.1])
def test_own_blocks_in_continuous_time_and_those_that_read_them(solver: str, stiff: float) -> None:
    graph = runtime.Graph("spring", dt=0.01, until=2.0).add("spring", Spring(stiff=stiff))
    graph = graph.set("run.solver", solver).add("sign", Sign()).connect("spring.angle", "sign.x")
    python, compiled, notes = both(graph.probe("sign.out").probe("spring.angle"))
    np.testing.assert_array_equal(compiled["sign.out"], python["sign.out"])
    np.testing.assert_array_equal(compiled["spring.angle"], python["spring.angle"])
    assert len(notes) == (stiff != 4.0)
    assert all(note.startswith("block 'spring': ") for note in notes)


def test_graphs_without_own_compiled_blocks_compare_nothing() -> None:
    engine = Engine(short("line_actuator_failure").program(), 1, CompiledRunner)
    engine.prepare()
    assert engine.exact is not None and engine.exact.comparison is None


def all_are_own(monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    compiled = ran(short(name), CompiledRunner)
    for module in (state, building):  # what is compared, and what the plan keeps for that
        monkeypatch.setattr(module, "is_built_in", lambda cls: False)
    found = ran(short(name), CompiledRunner)
    assert found.notes == []
    assert_same(compiled, found)


@pytest.mark.parametrize("name", QUICK)
def test_shipped_blocks_equal_their_python_form(monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    all_are_own(monkeypatch, name)


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_all_shipped_blocks_equal_their_python_form(
    monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    all_are_own(monkeypatch, name)


def test_compared_ticks_depend_on_the_graph_and_the_seed_and_become_sparse() -> None:
    program = own(until=1e4, dt=0.05).program()
    ticks = list(islice(compared(program, 1, ["own"]), 400))
    assert {5 * i for i in range(1, FIRST + 1)} <= set(ticks)
    assert all(tick % 5 == 0 for tick in ticks)
    assert ticks == sorted(islice(compared(program, 1, ["own"]), 400))
    assert ticks != list(islice(compared(program, 2, ["own"]), 400))
    # At most 0.01 of the time: a tick takes less than 1 us, comparing it 100 us or more.
    assert np.mean(np.diff(ticks[-100:])) > 5000.0


OWN_FILE = '''from blocks import Block, Output, Scalar, kernel_of


class Halves(Block):
    """Half of the time; its kernel computes a third."""

    out = Output(Scalar)

    def output(self, state, t):
        return t / 2.0

    @kernel_of(output)
    def _output_kernel(self, state, t):
        return t / 3.0
'''
OWN_GRAPH = """graph: halves
run: {dt: 0.01, until: 0.1, engine: compiled}
blocks: {half: {type: Halves, module: own.py}}
probes: {out: half.out}
metrics: {mean: {kind: mean_abs, of: out}}
"""


def test_a_run_and_a_sweep_say_so(cli: Run, tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text(OWN_FILE)
    (tmp_path / "halves.yaml").write_text(OWN_GRAPH)
    done = cli("run", "halves.yaml", "--no-plots", "--json")
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["engine"] == "compiled, then python from tick 1"
    assert found["metrics"]["mean"] == pytest.approx(0.0225)
    (note,) = found["notes"]
    assert note.startswith("block 'half': output 'out' is 0.00333")
    swept = cli("sweep", "halves.yaml", "--seeds", "0..1", "--no-plots", "-j", "1")
    assert swept.returncode == 0, swept.stderr
    assert f"2 x {note}" in swept.stderr
    with (tmp_path / "sweeps" / "halves" / "index.csv").open(newline="") as lines:
        rows = list(csv.DictReader(lines))
    assert [row["status"] for row in rows] == ["ok", "ok"]
    assert all(row["reason"] == note for row in rows)


class Lazy(blocks.Block):
    """Draws from 0.05 s on; called from Python, since it has a lambda."""

    out = blocks.Output(blocks.Scalar)
    drawn = blocks.State()

    def output(self, state, t):
        return float(state.drawn)

    def update(self, state, t):
        draw = lambda: state.rng.random()  # noqa: E731
        if t >= 0.05:
            state.drawn[...] = draw()


def test_a_block_called_from_python_draws_on_where_its_first_draw_is_compared() -> None:
    graph = own(until=0.2).add("lazy", Lazy()).probe("lazy.out")
    python, compiled, notes = both(graph)
    assert notes == []
    np.testing.assert_array_equal(compiled["lazy.out"], python["lazy.out"])
