"""The continuous part of the compiled plan: the solver's own functions, and its loops in C."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from runtime import engine
from runtime.codegen import BOOL, FLOAT, INT, Array, Entry, Type
from runtime.compiler import salt, written
from runtime.engine.continuous import Continuous, Slot
from runtime.engine.rosenbrock import factor_loops, implicit_loops, solve_loops
from runtime.engine.schedule import CONDITIONS
from runtime.engine.solvers import (
    Method,
    first_bad,
    judged,
    keep,
    moved,
    narrowed,
    substep,
)
from runtime.toolchain import TranslationUnit, digest, read_record, write_record

ROWS = ("states", "start")
IMPLICIT: list[Any] = [factor_loops, solve_loops, implicit_loops]
TITLE = "The solver of the continuous states."


def solver_unit(
    part: Continuous, method: Method, searched: bool
) -> tuple[TranslationUnit, list[str]]:
    """The functions that a solver calls, as a C unit with their declarations.

    Parameters
    ----------
    searched : whether the run may stop between two ticks.
    """
    row = Array("float", (part.size,))
    slopes = Array("float", (method.slope_rows, part.size))
    table = Array("float", method.table.shape)
    rows: list[tuple[str, Type]] = [(name, row) for name in ROWS]
    errors, control = Array("float", (len(method.errors),)), Array("float", (7,))
    numbers: list[tuple[str, Type]] = [("done", FLOAT), ("h", FLOAT), ("dt", FLOAT)]
    entries = [
        Entry("solver_keep", "keep", [("start", row), ("states", row)]),
        Entry("solver_first_bad", "first_bad", [("slopes", slopes), ("stage", INT)], [FLOAT]),
        Entry(
            "solver_moved",
            "implicit_loops" if method.is_implicit else "moved",
            [*rows, ("slopes", slopes), ("table", table), ("stage", INT), ("h", FLOAT)],
        ),
    ]
    functions: list[Any] = [keep, first_bad]
    functions += IMPLICIT if method.is_implicit else [moved]
    if method.errors:
        taken: list[tuple[str, Type]] = [("control", control), ("done", FLOAT), ("dt", FLOAT)]
        entries.append(Entry("solver_substep", "substep", taken, [FLOAT]))
        given = [*rows, ("slopes", slopes), ("errors", errors), ("control", control), *numbers]
        entries.append(Entry("solver_judged", "judged", given, [FLOAT]))
        functions += [substep, judged]
    if searched:
        search: list[tuple[str, Type]] = [("stop", Array("float", (6,))), ("met", BOOL)]
        search += [("span", FLOAT), ("dt", FLOAT)]
        entries.append(Entry("solver_narrowed", "narrowed", search, [FLOAT]))
        functions.append(narrowed)
    key = f"solver_{digest(salt(engine), repr(entries))}.json"
    record = read_record(key)
    if record is None:
        # Imported where something is written: most starts find everything in the cache.
        from runtime.codegen import Writer
        from runtime.compiler import translate_functions

        made = Writer(translate_functions(functions)).unit(entries, TITLE)
        record = {"text": made.text, "prototypes": made.prototypes}
        write_record(key, record)
    return TranslationUnit("the solver", record["text"]), record["prototypes"]


def before_stage(method: Method, arrays: Sequence[str], name: str, span: str) -> Iterator[str]:
    """The lines before the calls of a stage.

    Parameters
    ----------
    arrays : the C texts of the solver's arrays.
    span : the C text of the time (s) from the tick to the end of the integration.
    """
    states, start, _, table = arrays[:4]
    since = f"{table}[stage * {method.table.shape[1]} + {method.stages}]"
    if method.errors:
        yield "double done = 0.0, h = 0.0;"
        yield f"while (done < {span}) {{"
        yield f"    solver_substep(ctx, NULL, {arrays[5]}, done, {span}, &h);"
    yield f"    solver_keep(ctx, NULL, {start}, {states});"
    yield f"    for (int64_t stage = 0; stage < {method.stages}; stage++) {{  /* {name} */"
    moment = f"(done + {since} * h)" if method.errors else f"{since} * {span}"
    yield f"        const double t = (double)k * dt + {moment};"
    yield "        (void)t;"


def after_stage(method: Method, arrays: Sequence[str], code: int, span: str) -> list[str]:
    """The lines after the calls of a stage; ``code`` is what ``run`` returns on failure."""
    states, start, slopes, table = arrays[:4]
    h = "h" if method.errors else span
    lines = [
        "        double bad = -1.0;",
        f"        solver_first_bad(ctx, NULL, {slopes}, stage, &bad);",
        f"        if (bad >= 0.0) return {code};",
        f"        solver_moved(ctx, NULL, {states}, {start}, {slopes}, {table}, stage, {h});",
        "    }",
    ]
    if method.errors:
        given = ", ".join([*arrays[:3], arrays[4], arrays[5], f"done, h, {span}, &done"])
        lines += [
            f"    solver_judged(ctx, NULL, {given});",
            f"    if (done < 0.0) return {code};",
        ]
    return lines


def around_search(states: str, origin: str, stop: str, code: int) -> tuple[list[str], list[str]]:
    """The lines before and after the integration in the search for the time of a stop.

    Parameters
    ----------
    states, origin, stop : the C texts of arrays.
    code : what ``run`` returns at a stop.
    """
    before = [
        "{",
        f"    double *const stop = {stop};",
        "    double span = dt, beyond = 0.0;",
        f"    solver_keep(ctx, NULL, {origin}, {states});",
        "    stop[0] = 0.0, stop[1] = dt;",
        "    while (span > 0.0) {",
        f"        solver_keep(ctx, NULL, {states}, {origin});",
    ]
    after = [
        "    }",
        "    if (stop[2] > 0.0) {",
        "        stop[4] = (double)k, stop[5] = (double)k * dt + stop[1];",
        f"        return {code};",
        "    }",
        "}",
    ]
    return before, after


def condition(kind: str) -> str:
    """The condition of ``run.stop`` in C."""
    return CONDITIONS[kind].replace(" and ", " && ").replace(" or ", " || ")


def rates(slots: Sequence[Slot], slopes: str, size: int) -> list[str]:
    """Where a derivative writes the rates of change of each of its states."""
    found = []
    for slot in slots:
        found.append(f"{slopes} + (stage * {size} + {slot.start})")
        known = zip(slot.shape, written(slot.shape), strict=True)
        found += [str(length) for length, each in known if each is None]
    return found
