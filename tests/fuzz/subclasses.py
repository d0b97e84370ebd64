"""Subclasses of shipped blocks with a random method overridden do the same under both engines."""

from __future__ import annotations

import atexit
import copy
import hashlib
import shutil
import tempfile
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from hypothesis import strategies as st

from blocks.core.block import Block, Evaluation
from blocks.core.signals import PortType, Same
from blocks.library.index import TYPES
from blocks.library.registry import BUILTIN
from tests.fuzz import engines
from tests.fuzz.campaign import Record, campaign

TITLE = "Subclasses under both engines"
WHAT = (
    "Subclasses of shipped blocks that override one method each (negate an output, hold it at a "
    "function of time, skip an update, or halve the states after it), in random graphs under both "
    "engines for 200 ticks."
)
HOLDS = "As above: the override counts under either engine."


@dataclass(frozen=True)
class Case:
    """A graph in which some blocks are of a class ``Own``, and that class's text."""

    text: str
    case: engines.Case

    def __repr__(self) -> str:
        return f"{self.text}\n{self.case!r}"


@cache
def folder() -> Path:
    """Where the classes' modules go."""
    made = Path(tempfile.mkdtemp(prefix="spikeblocks-fuzz-"))
    atexit.register(shutil.rmtree, made, ignore_errors=True)
    return made


def targets() -> list[tuple[str, Evaluation]]:
    """Every method that a plan calls, of every shipped block that works in a tick."""
    found = []
    for kind in sorted(TYPES.keys() - set(engines.SWITCHES)):
        spec = BUILTIN[kind].spec
        calls = [call for call in spec.evaluations if not spec.is_constant(call)]
        calls += [spec.update] if spec.update is not None else []
        found += [(kind, call) for call in calls]
    return found


def override(cls: type[Block], call: Evaluation, how: str) -> str:
    """The text of a class that overrides one method."""
    needs = "".join(f", {name}" for name in call.needs)
    above = f"super().{call.method}(state, t{needs})"
    if call.method == "update":
        states = [name for name, declared in cls.spec.states.items() if not declared.cached]
        halved = [f"state.{name}[...] = 0.5 * state.{name}" for name in states]
        lines = ["pass"] if how == "skip" or not halved else [above, *halved]
    else:
        names = [f"found_{port}" for port in call.outputs]
        kinds = [cls.spec.outputs[port].type for port in call.outputs]
        changed = [_changed(name, kind, how) for name, kind in zip(names, kinds, strict=True)]
        lines = [f"{', '.join(names)} = {above}", f"return {', '.join(changed)}"]
    body = "\n".join(f"        {line}" for line in lines)
    return (
        f'import blocks\n\n\nclass Own(blocks.{cls.__name__}):\n    """Ours."""\n\n'
        f"    def {call.method}(self, state, t{needs}):\n{body}\n"
    )


def _changed(name: str, kind: PortType, how: str) -> str:
    """An expression for what an output becomes."""
    if isinstance(kind, Same):
        return name  # of any form: the call through super() is the test
    if kind.form == "scalar":
        return f"-{name}" if how == "negate" else "0.25 * t"
    if kind.form == "array":
        return f"-{name}" if how == "negate" else name
    first = f"-{name}[0]" if how == "negate" else "0.25 * t"
    return f"({', '.join([first, *(f'{name}[{i}]' for i in range(1, len(kind.components)))])})"


@st.composite
def cases(draw: st.DrawFn) -> Case:
    """A graph around one overridden method."""
    kind, call = draw(st.sampled_from(targets()))
    cls = BUILTIN[kind]
    how = draw(st.sampled_from(["skip", "halve"] if call.method == "update" else ["negate", "t"]))
    made = draw(engines.graphs(most=1, kinds=(kind,)))
    return Case(override(cls, call, how), _with(made, kind))


def _with(case: engines.Case, kind: str) -> engines.Case:
    graph: dict[str, Any] = copy.deepcopy(case.graph)
    for entry in graph["blocks"].values():
        if entry["type"] == kind:
            entry["type"] = "Own"
    return engines.Case(graph, case.seed)


def check(case: Case) -> str:
    """Write the class and run the graph under both engines."""
    name = hashlib.sha256(case.text.encode()).hexdigest()[:12]
    file = folder() / f"own_{name}.py"
    file.write_text(case.text)
    graph = copy.deepcopy(case.case.graph)
    for entry in graph["blocks"].values():
        if entry["type"] == "Own":
            entry["module"] = str(file)
    return engines.check(engines.Case(graph, case.case.seed))


def run(examples: int, seed: int) -> Record:
    """Try overrides; shrinking would compile hundreds more."""
    return campaign("subclasses", cases(), check, examples, seed, shrink=False)
