"""The continuous part of the compiled plan: the solver's own functions, and its loops in C."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from runtime.codegen import FLOAT, INT, Array, Entry, Type, Writer
from runtime.engine.compiled.entries import written
from runtime.engine.compiled.translate import translate_functions
from runtime.engine.continuous import Continuous, Slot
from runtime.engine.solvers import Method, first_bad, judged, keep, moved, substep
from runtime.toolchain import Unit

ROWS = ("states", "start")
TITLE = "The solver of the continuous states."


def solver_unit(part: Continuous, method: Method) -> tuple[Unit, list[str]]:
    """The functions that a solver calls, as a C unit with their declarations."""
    row = Array("float", (part.size,))
    slopes = Array("float", (method.stages, part.size))
    table = Array("float", method.table.shape)
    rows: list[tuple[str, Type]] = [(name, row) for name in ROWS]
    errors, control = Array("float", (len(method.errors),)), Array("float", (7,))
    numbers: list[tuple[str, Type]] = [("done", FLOAT), ("h", FLOAT), ("dt", FLOAT)]
    entries = [
        Entry("solver_keep", "keep", [("start", row), ("states", row)]),
        Entry("solver_first_bad", "first_bad", [("slopes", slopes), ("stage", INT)], [FLOAT]),
        Entry(
            "solver_moved",
            "moved",
            [*rows, ("slopes", slopes), ("table", table), ("stage", INT), ("h", FLOAT)],
        ),
    ]
    functions: list[Any] = [keep, first_bad, moved]
    if method.errors:
        taken: list[tuple[str, Type]] = [("control", control), ("done", FLOAT), ("dt", FLOAT)]
        entries.append(Entry("solver_substep", "substep", taken, [FLOAT]))
        given = [*rows, ("slopes", slopes), ("errors", errors), ("control", control), *numbers]
        entries.append(Entry("solver_judged", "judged", given, [FLOAT]))
        functions += [substep, judged]
    made = Writer(translate_functions(functions)).unit(entries, TITLE)
    return Unit("the solver", made.text), made.prototypes


def before_stage(
    part: Continuous, method: Method, arrays: Sequence[str], name: str
) -> Iterator[str]:
    """The lines before the calls of a stage; ``arrays`` are the C texts of the solver's arrays."""
    states, start, _, table = arrays[:4]
    since = f"{table}[stage * {method.table.shape[1]} + {method.stages}]"
    if method.errors:
        yield "double done = 0.0, h = 0.0;"
        yield "while (done < dt) {"
        yield f"    solver_substep(ctx, NULL, {arrays[5]}, done, dt, &h);"
    yield f"    solver_keep(ctx, NULL, {start}, {states});"
    yield f"    for (int64_t stage = 0; stage < {method.stages}; stage++) {{  /* {name} */"
    moment = f"(done + {since} * h)" if method.errors else f"{since} * dt"
    yield f"        const double t = (double)k * dt + {moment};"
    yield "        (void)t;"


def after_stage(
    part: Continuous, method: Method, arrays: Sequence[str], codes: Sequence[int]
) -> list[str]:
    """The lines after the calls of a stage; ``codes`` are what ``run`` returns on failure."""
    states, start, slopes, table = arrays[:4]
    h = "h" if method.errors else "dt"
    lines = [
        "        double bad = -1.0;",
        f"        solver_first_bad(ctx, NULL, {slopes}, stage, &bad);",
        "        if (bad >= 0.0) {",
        "            plan->report[0] = (double)stage;",
        "            plan->report[1] = t;",
        f"            return {codes[0]};",
        "        }",
        f"        solver_moved(ctx, NULL, {states}, {start}, {slopes}, {table}, stage, {h});",
        "    }",
    ]
    if method.errors:
        given = ", ".join([*arrays[:3], arrays[4], arrays[5], "done, h, dt, &done"])
        lines += [
            f"    solver_judged(ctx, NULL, {given});",
            "    if (done < 0.0) {",
            "        plan->report[0] = done;",
            "        plan->report[1] = t;",
            f"        return {codes[1]};",
            "    }",
        ]
    return lines


def rates(slots: Sequence[Slot], slopes: str, size: int) -> list[str]:
    """Where a derivative writes the rates of change of each of its states."""
    found = []
    for slot in slots:
        found.append(f"{slopes} + (stage * {size} + {slot.start})")
        known = zip(slot.shape, written(slot.shape), strict=True)
        found += [str(length) for length, each in known if each is None]
    return found


__all__ = ["after_stage", "before_stage", "rates", "solver_unit"]
