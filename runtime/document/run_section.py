"""The ``run`` section of a graph: base step, length, seed, engine and solver.

In: a document. Out: a :class:`RunSection` with defaults for what is missing or wrong, so that the
rest of the graph can be checked as well::

    run: {dt: 0.001, until: 5, solver: dopri5, rtol: 1e-8}
    RunSection(dt=0.001, until=5.0, ..., solver="dopri5", rtol=1e-8, ...)

Its fields are the one declaration of the keys: reading, messages, editors, the schema, the
documentation and what a run stores of itself follow from them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

from runtime.document.node import Node
from runtime.document.run_keys import (
    BYTES,
    KEPT,
    MAX_TICKS,
    SEED,
    STOP,
    TIME,
    TOLERANCE,
    RunKey,
    Stop,
    one_of,
    run_key,
)
from runtime.document.sections import check_keys, section
from runtime.document.time_units import SECOND, TIME_UNITS
from runtime.errors import Problems
from runtime.solvers import ADAPTIVE, DEFAULT, SOLVERS, listed, solver_docs

ADAPTIVE_ONLY = ", ".join(ADAPTIVE)


@dataclass(frozen=True, kw_only=True)
class RunSection:
    """The section ``run`` with defaults: times in ``time_unit``, memory in bytes.

    A key that is read with the help of another one is declared below it.
    """

    dt: float = run_key(
        0.001,
        TIME,
        "base step, s",
        acts="runtime/plan/building.py",
        more="As all times, in `time_unit` if there is one",
        also="timestep time_step step step_size stepsize h delta_t sample_time fixed_step",
    )
    until: float = run_key(
        10.0,
        TIME,
        "length of the run, s",
        acts="runtime/network/network.py",
        more="Ticks are at t = 0, dt, ..., until - dt",
        also="duration length time t_end tend t_final tf tmax t_max end stop_time simtime",
    )
    seed: int = run_key(
        0,
        SEED,
        "of all noise and neurons",
        acts="runtime/graph/running.py",
        also="random_seed rng",
    )
    engine: str = run_key(
        "auto",
        one_of(("auto", "python", "compiled", "checked")),
        "python, compiled (needs a C compiler), or auto: compiled where that pays off; "
        "checked: compiled, and every index is checked",
        acts="runtime/engine/selection.py",
        more="The extra `compiler` brings a C compiler",
    )
    memory: int = run_key(
        1024**3,
        BYTES,
        "memory for recordings, as in 512M; larger ones are written to disk",
        acts="runtime/engine/program.py",
        shown="1G",
    )
    states: str = run_key(
        "small",
        one_of(("small", "all", "none")),
        "final states that the run folder keeps: small (up to 1 MB each), all, none",
        acts="runtime/engine/engine.py",
    )
    time_unit: str = run_key(
        SECOND,
        one_of(TIME_UNITS),
        "what the numbers of time in this graph are in, for axes and messages",
        acts="runtime/document/time_units.py",
        more=f"One of {listed((f'`{unit}`' for unit in TIME_UNITS), 'or')}. Nothing is converted: "
        "with `ns`, `dt: 0.01` is 0.01 ns, `m/s` of a block is m/ns, a frequency of 18.8 is "
        "18.8 GHz",
        also="unit units time_units",
    )
    events: str = run_key(
        "located",
        one_of(("located", "ticks")),
        "located: events and edges are at their times between ticks; ticks: at ticks alone",
        acts="runtime/plan/building.py",
        more="See [time.md](time.md#events)",
    )
    loops: str = run_key(
        "error",
        one_of(("error", "solve")),
        "algebraic loops: error, or solve, which solves them by Newton's method",
        acts="runtime/plan/building.py",
    )
    keep: float | None = run_key(
        None,
        KEPT,
        "how much of the recordings is kept, the last part, as in 60s; all by default",
        acts="runtime/engine/engine.py",
        shown="all",
        more="In memory, for a run or [session](sessions.md) of hours. Metrics and plots are of "
        "this part. Not with `--checkpoint`, which records all to disk",
    )
    stop: Stop | None = run_key(  # noqa: RUF009
        None,
        STOP,
        "ends the run early, as in {when: plant.contact, above: 0.5}; or below, or crosses",
        acts="runtime/observation/reader.py",
        shown="none",
        more="`when` is the address of a number that rises `above`, falls `below` or `crosses` a "
        "level, the last with a `direction` (`rising`, `falling`, `either`); one that begins "
        "beyond the level has to come back first. The status is then `stopped`, and the "
        "manifest's `stopped_at` and the metric `stop_time` give the time: of the tick, or "
        "between two ticks where the signal changes between them",
        also="stop_when until_when event",
    )
    solver: str = run_key(
        DEFAULT,
        one_of(SOLVERS),
        "how continuous states are integrated between two ticks",
        acts="runtime/plan/building.py",
        more=solver_docs(),
        also="method integrator ode scheme",
    )
    rtol: float = run_key(
        1e-6,
        TOLERANCE,
        f"{ADAPTIVE_ONLY}: largest error of a step, relative to the state",
        acts="runtime/engine/starting.py",
        shown="1e-6",
        more="The error of a step is at most `atol + rtol * abs(state)`",
    )
    atol: float = run_key(
        1e-9,
        TOLERANCE,
        f"{ADAPTIVE_ONLY}: largest error of a step of a state near 0",
        acts="runtime/engine/starting.py",
        shown="1e-9",
    )
    max_step: float = run_key(
        0.0,
        TOLERANCE,
        f"{ADAPTIVE_ONLY}: the largest step, s",
        acts="runtime/engine/starting.py",
        shown="one tick",
    )

    def run_entries(self) -> dict[str, Any]:
        """The entries of the section: the first four, and those that are not the default."""
        values = {key: getattr(self, key) for key in RUN_KEYS}
        return {
            key: value.entries() if isinstance(value, Stop) else value
            for key, value in values.items()
            if key in ALWAYS or value != RUN_KEYS[key].default
        }


RUN_KEYS: Mapping[str, RunKey] = {each.name: each.metadata["key"] for each in fields(RunSection)}
# What other tools call the keys.
_OTHER_NAMES = {name: key for key, declared in RUN_KEYS.items() for name in declared.also}
# Written in the graph that a run stores, whatever they are.
ALWAYS = ("dt", "until", "seed", "engine")


def read_run(document: Node, problems: Problems) -> RunSection:
    """Read the section; wrong values are reported and replaced by defaults."""
    written = section(document, "run", "run", problems)
    check_keys(document.get("run") or Node({}), RUN_KEYS, "run", problems, "key", _OTHER_NAMES)
    found: dict[str, Any] = {key: declared.default for key, declared in RUN_KEYS.items()}
    for key, declared in RUN_KEYS.items():
        if key in written:
            value = declared.form.read(written[key], key, found, problems)
            found[key] = declared.default if value is None else value
    dt, until, unit = found["dt"], found["until"], found["time_unit"]
    if not 1 <= until / dt <= MAX_TICKS:
        node = written.get("until") or written.get("dt")
        where = document.where if node is None else node.where
        message = f"{until:g} {unit} are {until / dt:.3g} ticks of dt = {dt:g} {unit}"
        message += "; expected one or more" if until < dt else f"; at most {MAX_TICKS:.0e} can run"
        problems.add(where, "run.until", message)
        # One tick: what follows needs a length, and the problem is reported.
        found["until"] = dt
    return RunSection(**found)
