"""The printer of a plan as C for the engine: one call per block, cut where Python calls blocks.

In go a plan and the blocks that compile, out come the text and the structs of its values.
Blocks that do not compile cut a tick into parts: ``run(plan, places, ctx, first, last, low, high)``
runs the parts from ``low`` up to ``high``, and a Python loop (:mod:`.driver`) calls the blocks
between them. If all blocks compile, or on ticks on which none of the others is called, one call
runs several ticks.
``call gain.out: Scalar = gain.output(t, clock.time)`` with its test becomes::

    block_gain_output(ctx, places->fields_gain, t, plan->out_clock_time, &plan->out_gain_out);
    if (!isfinite(plan->out_gain_out)) {
        if (!(isfinite(plan->out_gain_out))) { ctx->at = 1; return 1; }
    }
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field

from blocks.core import SignalType
from runtime.compiler import Kernel, enclosed, written
from runtime.engine.compiled.driver import DriverText
from runtime.engine.compiled.plan_text import ATTEMPT, HELPERS, RUN, literal
from runtime.engine.compiled.signals import (
    NOT_INTEGRATED,
    STOPPED,
    UNSOLVED,
    SignalText,
    leaves,
)
from runtime.engine.compiled.solver_unit import SolverUnit, newton_unit, solver_unit
from runtime.engine.compiled.struct import Struct
from runtime.engine.naming import Names
from runtime.engine.python_text import CONDITIONS, EARLIER, row
from runtime.engine.rosenbrock import STRUCTURE
from runtime.plan import (
    Argument,
    Call,
    GuardSlot,
    Integrate,
    Operation,
    Plan,
    Port,
    Record,
    Restore,
    Signal,
    Slot,
    Solve,
    Source,
    Stop,
    Test,
    Zero,
    numbers_in,
)
from runtime.solvers import Method, method_of

INTEGRATE = -1


@dataclass
class PlanText:
    """The text of a plan, and how to call it.

    text : in C, without the support that every unit begins with.
    calls : by their number in ``at``.
    solvers : the units of the solver of a graph with continuous states, and of those of loops.
    inner : in a text for export, these units as parts of it.
    integrates : whether the integration is in C; the part INTEGRATE is nothing but that.
    driver : the Python loop around it, empty if nothing is called between its ``parts``; ``lines``
        maps its lines to the blocks that they call.
    """

    text: str
    struct: Struct
    calls: list[Call]
    solvers: list[SolverUnit] = field(default_factory=list)
    inner: list[str] = field(default_factory=list)
    driver: str = ""
    parts: int = 1
    integrates: bool = False
    lines: dict[int, str] = field(default_factory=dict)


def c_plan(
    plan: Plan, names: Names, kernels: Mapping[str, Kernel], outside: Collection[Port] | None = None
) -> PlanText:
    """The plan in C.

    Parameters
    ----------
    kernels : the blocks that are compiled, by name; the others are called from Python.
    outside : of a plan that is exported, the signals that it does not compute, but for constants.
    """
    parts, called = divided(plan, kernels)
    printer = EngineText(plan, names, kernels, outside or ())
    made = PlanText("", printer.struct, printer.calls, printer.used, parts=len(parts))
    for number, part in enumerate(parts):
        at = [i for i, each in enumerate(part) if isinstance(each, Integrate)]
        made.integrates |= bool(at)
        if len(parts) == 1 and not at:
            printer.operations(part)
            continue
        inside = f"low <= {number} && {number} < high"
        for i in at:
            with printer.block(f"if ({inside})"):
                printer.operations(part[:i])
            with printer.block(f"if (low == {INTEGRATE} || ({inside}))"):
                printer.operations(part[i : i + 1])
        with printer.block(f"if ({inside})"):
            printer.operations(part[at[-1] + 1 :] if at else part)
    if called:
        driver = DriverText(plan, names, printer.struct)
        made.driver, made.lines = driver.loop(called), driver.lines
    used = {each for kernel in kernels.values() for each in kernel.prototypes}
    used |= printer.own if outside is None else set()  # these are part of an exported unit
    prototypes = "\n".join(sorted(f"{prototype};" for prototype in used))
    run = RUN.replace("@dt@", repr(plan.dt)).replace("@body@", "\n".join(printer.lines))
    declared = printer.struct.text("plan", "places") if outside is None else ""
    if outside is not None:
        made.inner = [
            enclosed(solver.unit.text, f"solver_{i}") for i, solver in enumerate(printer.used)
        ]
    made.text = "\n".join([declared, prototypes, HELPERS + printer.functions + run])
    return made


def divided(
    plan: Plan, compiled: Collection[str]
) -> tuple[list[list[Operation]], list[list[Operation]]]:
    """The operations in C, cut into parts, and between each two what Python does."""
    parts: list[list[Operation]] = [[]]
    called: list[list[Operation]] = []
    in_python: set[str] = set()  # blocks of loops that Python solves, which tests these, too
    for each in plan.operations:
        if isinstance(each, Integrate):
            is_python = not (each.blocks | each.row.by_block.keys()) <= set(compiled)
        elif isinstance(each, Solve):
            is_python = not each.blocks <= set(compiled)
            in_python |= each.blocks if is_python else set()
        else:
            is_python = isinstance(each, (Call, Test, Zero)) and (
                each.block not in compiled or each.block in in_python
            )
        if not is_python:
            parts[-1].append(each)
        elif not each.gate.once:
            if isinstance(each, (Call, Solve, Integrate)):  # its tests follow
                parts.append([])
                called.append([])
            called[-1].append(each)
    return parts, called


class EngineText(SignalText):
    """Writes operations for the engine; ``struct`` has the values that they use."""

    def __init__(
        self,
        plan: Plan,
        names: Names,
        kernels: Mapping[str, Kernel],
        outside: Collection[Port] = (),
    ) -> None:
        super().__init__(plan, names, kernels, outside)
        self.used: list[SolverUnit] = []
        self.own: set[str] = set()
        self.functions = ""
        self.printers |= {
            Solve: self.solve,
            Record: self.record,
            Stop: self.stop_at_tick,
            Integrate: self.integrate,
        }

    # Values

    def place(self, source: Source) -> str:
        """The address of a signal or a state, or of the first number of a component."""
        if isinstance(source.whole, Signal):
            return self.address(source)
        first = int(source.component.partition(":")[0] or 0)
        return self.struct.state(source.whole) + (f" + {first}" if first else "")

    def absent(self, argument: Argument) -> list[str]:
        if argument.kind.form == "scalar":
            return [literal(argument.default)]
        return [self.struct.open_input(argument), *self.sizes(argument.kind)]

    def sizes(self, kind: SignalType) -> list[str]:
        return _unknown(kind.shape) if kind.form == "array" else []

    def rates(self, call: Call) -> list[str]:
        return [text for s in call.rates for text in (self.slope(s), *_unknown(s.shape))]

    def slope(self, slot: Slot) -> str:
        if isinstance(slot, GuardSlot):
            return f"{self.struct.array('guards')} + {slot.start}"
        return f"{self.solvers('slopes')} + (stage * {self.plan.row.size} + {slot.start})"

    def solvers(self, array: str) -> str:
        """One of the solver's arrays."""
        return self.struct.array(array, f"solver_{array}")

    # Calls

    def function(self, call: Call) -> tuple[str, list[str]]:
        kernel = self.kernels[call.block]
        if kernel.failures:  # a block that cannot fail leaves no number
            self.put(f"ctx->at = {len(self.calls)};")
        self.calls.append(call)
        return kernel.symbols[call.method], ["ctx", self.fields(call.block, kernel)]

    def fields(self, block: str, kernel: Kernel) -> str:
        """The address of a block's struct: of a block inside of the plan's unit, a member."""
        if not kernel.struct:
            return self.struct.fields(block)
        return self.struct.inner(block, kernel.struct, len(kernel.words))

    def uses(self, solver: SolverUnit) -> None:
        """Build a unit as well, and call its functions."""
        if solver not in self.used:
            self.used.append(solver)
            self.own |= set(solver.prototypes)

    def solve(self, solve: Solve) -> None:
        """Try values of the unknowns, until the calls compute the same."""
        self.tested()
        self.uses(newton_unit(solve.size))
        memory = self.struct.array(f"loop_{solve.number}")
        given = f"{memory}, {self.struct.array(f'loop_{solve.number}_control')}, &going"
        with self.block(""):
            self.put("double going = 0.0;", f"loop_begun_{solve.size}(ctx, NULL, {given});")
            self.put(leaves(UNSOLVED))
            with self.block("while (going > 0.0)"):
                for signal, start, stop in solve.slots:
                    place = self.place(Source(signal))
                    self.put(f"copy_numbers({place}, {memory} + {start}, {stop - start});")
                for call in solve.calls:
                    self.call(call)
                for signal, start, stop in solve.slots:
                    result = f"{memory} + {solve.size + start}"
                    self.put(
                        f"copy_numbers({result}, {self.place(Source(signal))}, {stop - start});"
                    )
                self.put(f"loop_newton_{solve.size}(ctx, NULL, {given});", leaves(UNSOLVED))
            self.put(f"if (going < 0.0) return {UNSOLVED};")

    # States and recordings

    def zero(self, zero: Zero) -> None:
        for target in zero.targets:
            if isinstance(target, Signal):
                self.put(f"set_zero({self.place(Source(target))}, {numbers_in(target.kind)});")
                continue
            place = self.slope(target) if isinstance(target, Slot) else self.struct.state(target)
            self.put(f"set_zero({place}, {target.size});")

    def restore(self, restore: Restore) -> None:
        for state in restore.states:
            place, initial = self.struct.state(state), self.struct.state(state, "initial")
            self.put(f"copy_numbers({place}, {initial}, {state.size});")

    def record(self, record: Record) -> None:
        """Record one row."""
        self.tested()
        array, width = self.struct.array(f"probe_{record.number}"), record.width
        columns, number = record.columns or slice(0, width), row(record).replace("//", "/")
        start = f"({number}) * {width}" if width != 1 else number
        target = f"{array} + {start}" + (f" + {columns.start}" if columns.start else "")
        source = self.place(record.source)
        self.put(f"copy_numbers({target}, {source}, {columns.stop - columns.start});")

    def stop_at_tick(self, stop: Stop) -> None:
        """End the run at a tick at which the condition holds."""
        self.tested()
        condition = CONDITIONS[stop.direction].replace(" and ", " && ").replace(" or ", " || ")
        with self.block(""):
            self.put(f"double *const stop = {self.struct.array('stop')};")
            self.put(f"const double beyond = {self.distance(stop)};")
            with self.block(f"if ({condition})"):
                self.put("stop[0] = 1.0, stop[2] = (double)k, stop[3] = t;")
                self.put(f"return {STOPPED};")
            self.put("stop[1] = beyond;")

    def distance(self, stop: Stop) -> str:
        """The distance of the signal that may end the run from the level."""
        return f"({self.place(stop.source)})[0] - {literal(stop.level)}"

    # The continuous part

    def integrate(self, part: Integrate) -> None:
        """Integrate to the next tick, or to the time in between at which the run stops."""
        self.tested()
        method = method_of(part.solver, part.colours)
        self.uses(solver_unit(part, method))
        if method.errors:
            self.attempts(part, method)
            self.put(f"({self.solvers('control')})[8] = (double)k * dt;")
        if part.ends_steps:
            with self.block(""):
                self.located(part, method)
        elif method.errors:
            self.put("double done = 0.0, h = 0.0;")
            with self.block("while (done < dt)"):
                self.run("substep", self.solvers("control"), "done", "dt", "&h")
                self.run("keep", self.solvers("start"), self.solvers("states"))
                self.attempt()
                self.accept(method, "dt", "done")
                self.operations(part.projections)
        else:
            self.run("keep", self.solvers("start"), self.solvers("states"))
            self.stages(part, method, "dt", "dt")
            self.operations(part.projections)
        self.put("t = (double)k * dt;")

    def run(self, function: str, *given: str) -> None:
        """Call a function of the solver's unit."""
        self.put(f"solver_{function}(ctx, NULL, {', '.join(given)});", leaves(NOT_INTEGRATED))

    def attempt(self, *undo: str) -> None:
        """Take a step, which may be too long."""
        self.put("const int64_t refusal = attempt(plan, places, ctx, k, done, h);")
        with self.block("if (refusal)"):
            self.put("double rejected = 0.0;", "const int64_t failure = ctx->failure;")
            self.put("ctx->failure = -1;")
            arrays = map(self.solvers, ("states", "start", "control"))
            self.run("reject_step", *arrays, "h", "&rejected")
            with self.block("if (rejected < 0.0)"):
                self.put("ctx->failure = failure;", "return refusal;")
            self.put(*undo, "continue;")

    def accept(self, method: Method, end: str, target: str) -> None:
        """Accept a step by its estimated error, or go back to its start."""
        arrays = map(self.solvers, ("states", "start", "slopes", "errors", "control"))
        self.run("accept_step", *arrays, repr(method.exponent), "done", "h", end, f"&{target}")
        self.put(f"if ({target} < 0.0) return {NOT_INTEGRATED};")

    def attempts(self, part: Integrate, method: Method) -> None:
        """``attempt``, a function that takes one step ``h``, and comes back where a block fails."""
        before, self.lines, depth, self.depth = self.lines, [], self.depth, 1
        self.stages(part, method, "h", "")
        self.functions = ATTEMPT.replace("@dt@", repr(self.plan.dt))
        self.functions = self.functions.replace("@body@", "\n".join(self.lines))
        self.lines, self.depth = before, depth

    def stages(self, part: Integrate, method: Method, h: str, span: str) -> None:
        """The stages of one step ``h`` of the solver, ``done`` after the tick if it has no span."""
        states, start, slopes, table = map(self.solvers, ("states", "start", "slopes", "table"))
        node = f"{table}[stage * {method.table.shape[1]} + {method.stages}]"
        since = f"{node} * {span}" if span else f"(done + {node} * h)"
        with self.block(f"for (int64_t stage = 0; stage < {method.stages}; stage++)"):
            time = f"(double)k * dt + {since}"
            if part.is_left:
                end = f"({self.struct.array('search')})[2]"
                time = f"fmin({time}, (double)k * dt + {end} - {EARLIER * self.plan.dt!r})"
            self.put(f"t = {time};  /* {part.solver} */")
            self.operations(part.stage)
            self.put("double bad = -1.0;")
            self.run("first_bad", slopes, "stage", "&bad")
            self.put(f"if (bad >= 0.0) return {NOT_INTEGRATED};")
            given = [states, start, slopes, table, "stage", h]
            given += map(self.solvers, STRUCTURE if method.is_implicit else ())
            self.run("move_states", *given)

    def located(self, part: Integrate, method: Method) -> None:
        """Integrate in steps that end at edges and events; see ``engine/events.py``."""
        sides, directions, guards, fired = map(
            self.struct.array, ("sides", "directions", "guards", "fired")
        )
        edges = [self.struct.array("edges"), str(len(part.edges))]
        self.put(f"double *const search = {self.struct.array('search')};")
        self.run("opened", "search", *edges, "(double)k * dt", "dt")
        with self.block("while (search[0] > 0.0)"):
            self.put("double h = 0.0, found = 0.0;", "const double done = search[1];")
            self.run("proposed", "search", sides, *edges, "(double)k * dt", "dt", "&h")
            with self.block("if (h > 0.0)"):
                self.ending_step(part, method)
            self.put("t = (double)k * dt + (done + h);")
            self.operations(part.watch)
            for crossing in part.crossings:
                if isinstance(crossing.guards, Stop):
                    distance = self.distance(crossing.guards)
                    self.put(f"({guards})[{crossing.start}] = {distance};")
                else:
                    self.operations([crossing.guards])
            self.run("decided", "search", sides, directions, guards, fired, "h", "dt", "&found")
            self.put("if (found == 1.0) continue;")
            self.put(f"if (found == 4.0) return {NOT_INTEGRATED};")
            self.operations(part.projections)
            with self.block("if (found > 1.0)"):
                self.happened(part, fired)
        if self.plan.can_stop:
            self.put(f"if (({self.struct.array('stop')})[0] > 0.0) return {STOPPED};")

    def ending_step(self, part: Integrate, method: Method) -> None:
        """A step, or a shorter one from the same start."""
        states, start = self.solvers("states"), self.solvers("start")
        with self.block("if (search[0] == 2.0)"):
            if method.errors:
                self.run("substep", self.solvers("control"), "done", "done + h", "&h")
            self.run("keep", start, states)
        with self.block("else"):
            self.run("keep", states, start)
        if not method.errors:
            self.stages(part, method, "h", "")
            return
        self.attempt("search[0] = 2.0;")
        with self.block("if (search[0] == 2.0)"):
            self.put("double reached = 0.0;")
            self.accept(method, "search[2]", "reached")
            self.put("if (reached == done) continue;")

    def happened(self, part: Integrate, fired: str) -> None:
        """What follows at the time of an event or an edge."""
        self.put("t = (double)k * dt + search[1];")
        if part.log:
            log, count = self.struct.array("log"), self.struct.array("count")
            self.run("noted", log, str(part.log), count, fired, "t")
        for crossing in part.crossings:
            if isinstance(crossing.guards, Stop):
                stop = f"({self.struct.array('stop')})"
                with self.block(f"if (({fired})[{crossing.start}] > 0.0)"):
                    self.put(f"{stop}[0] = 1.0, {stop}[2] = (double)k, {stop}[3] = t;")
                    self.put("search[0] = 0.0;")
            elif crossing.event is not None:
                count = str(len(crossing.directions))
                with (
                    self.block(f"for (int64_t which = 0; which < {count}; which++)"),
                    self.block(f"if (({fired})[{crossing.start} + which] > 0.0)"),
                ):
                    self.operations([crossing.event])
        self.operations(part.after)


def _unknown(shape: Sequence[int]) -> list[str]:
    """The sizes that no text tells, which follow an address."""
    known = zip(shape, written(tuple(shape)), strict=True)
    return [str(size) for size, each in known if each is None]
