"""The functions that a solver calls in compiled code, written from those of the Python engine.

In go the method and the states, out comes a unit of C, once for all graphs alike. ``growth`` of
``steps`` becomes ``static double growth(struct context *ctx, ...)``, so that the length of a step
has the same bits under both engines.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from inspect import signature
from typing import Any

from runtime import engine
from runtime.codegen import FLOAT, INT, Array, Entry, Type, Unit
from runtime.compiler import salt
from runtime.engine import loops
from runtime.engine.events import (
    MEMORY,
    SEARCH,
    accept,
    beyond,
    came_back,
    decided,
    followed,
    following,
    guess,
    met,
    narrowed,
    nearness,
    next_end,
    noted,
    opened,
    proposed,
    settled,
)
from runtime.engine.rosenbrock import (
    difference,
    factor_loops,
    fill,
    implicit_loops,
    solve_loops,
)
from runtime.engine.steps import (
    CONTROLS,
    accept_step,
    crawls,
    first_bad,
    first_step,
    growth,
    has_failed,
    keep,
    move_states,
    reject_step,
    substep,
)
from runtime.plan import Integrate
from runtime.solvers import Method
from runtime.toolchain import TranslationUnit, digest, read_record, write_record

ROWS = ("states", "start")
IMPLICIT: list[Any] = [difference, fill, factor_loops, solve_loops, implicit_loops]
TITLE = "The solver of the continuous states."


@dataclass(frozen=True)
class SolverUnit:
    """Functions that a solver calls, as a C unit.

    functions : of the Python engine. entries : those of them that the plan calls.
    """

    name: str
    title: str
    entries: list[Entry]
    functions: list[Any]

    def write(self) -> Unit:
        """Write the unit."""
        # Imported where something is written: most starts find everything in the cache.
        from runtime.codegen import Writer
        from runtime.compiler import translate_functions

        return Writer(translate_functions(self.functions)).unit(self.entries, self.title)

    @cached_property
    def _record(self) -> Any:
        key = f"solver_{digest(salt(engine), repr(self.entries))}.json"
        record = read_record(key)
        if record is None:
            made = self.write()
            record = {"text": made.text, "prototypes": made.prototypes}
            write_record(key, record)
        return record

    @property
    def unit(self) -> TranslationUnit:
        """The unit for the C compiler, from the cache if it is there."""
        return TranslationUnit(self.name, self._record["text"])

    @property
    def prototypes(self) -> list[str]:
        """The declarations of its entries."""
        return list(self._record["prototypes"])


def solver_unit(part: Integrate, method: Method) -> SolverUnit:
    """The functions that a solver calls."""
    size = part.row.size
    row = Array("float", (size,))
    slopes = Array("float", (method.slope_rows(size), size))
    table = Array("float", method.table.shape)
    rows: list[tuple[str, Type]] = [(name, row) for name in ROWS]
    errors, control = Array("float", (len(method.errors),)), Array("float", (CONTROLS,))
    numbers: list[tuple[str, Type]] = [("done", FLOAT), ("h", FLOAT), ("dt", FLOAT)]
    entries = [
        Entry("solver_keep", "keep", [("start", row), ("states", row)]),
        Entry("solver_first_bad", "first_bad", [("slopes", slopes), ("stage", INT)], [FLOAT]),
    ]
    moves: list[tuple[str, Type]] = [*rows, ("slopes", slopes), ("table", table)]
    moves += [("stage", INT), ("h", FLOAT)]
    if part.coupling is not None:
        moves.append(("colours", row))
        moves.append(("pattern", Array("float", part.coupling.pattern.shape)))
        moves.append(("places", row))
    name = "implicit_loops" if method.is_implicit else "move_states"
    entries.append(Entry("solver_move_states", name, moves))
    functions: list[Any] = [keep, first_bad]
    functions += IMPLICIT if method.is_implicit else [move_states]
    if method.errors:
        taken: list[tuple[str, Type]] = [("control", control), ("done", FLOAT), ("dt", FLOAT)]
        entries.append(Entry("solver_substep", "substep", taken, [FLOAT]))
        given = [*rows, ("slopes", slopes), ("errors", errors), ("control", control)]
        given += [("exponent", FLOAT), *numbers]
        entries.append(Entry("solver_accept_step", "accept_step", given, [FLOAT]))
        again: list[tuple[str, Type]] = [*rows, ("control", control), ("h", FLOAT)]
        entries.append(Entry("solver_reject_step", "reject_step", again, [FLOAT]))
        functions += [substep, growth, first_step, crawls, has_failed, accept_step, reject_step]
    if part.ends_steps:
        entries += located(len(part.directions))
        functions += [next_end, opened, proposed, beyond, nearness, met, accept]
        functions += [following, came_back, settled, followed, narrowed, decided, guess, noted]
    return SolverUnit("the solver", TITLE, entries, functions)


def newton_unit(size: int) -> SolverUnit:
    """The functions that solve an algebraic loop with so many unknowns."""
    memory, control = Array("float", (loops.SLOPES + size, size)), Array("float", (4,))
    taken: list[tuple[str, Type]] = [("memory", memory), ("control", control)]
    entries = [
        Entry(f"loop_{each.__name__}_{size}", each.__name__, taken, [FLOAT])
        for each in (loops.begun, loops.newton)
    ]
    functions = [loops.begun, loops.newton, loops.column, loops.shift, loops.move]
    functions += [loops.shorter, loops.linear]
    title = "Newton's method for an algebraic loop."
    return SolverUnit(f"Newton's method for {size}", title, entries, functions)


def located(guards: int) -> list[Entry]:
    """The functions of steps that end at events and edges."""
    types: dict[str, Type] = dict.fromkeys(("t", "h", "dt"), FLOAT)
    types |= dict.fromkeys(("directions", "guards", "fired"), Array("float", (guards,)))
    types |= {"sides": Array("float", (MEMORY, guards))}
    types |= {"search": Array("float", (SEARCH,)), "edges": Array("float", (None,))}
    types |= {"log": Array("float", (None, 2)), "count": Array("float", (1,))}

    def entry(function: Any, *results: Type) -> Entry:
        arguments = [(name, types[name]) for name in signature(function).parameters]
        return Entry(f"solver_{function.__name__}", function.__name__, arguments, list(results))

    return [entry(opened), entry(proposed, FLOAT), entry(decided, FLOAT), entry(noted)]
