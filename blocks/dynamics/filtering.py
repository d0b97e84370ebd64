"""What Kalman filters share: measurements that come when they come, late ones included.

In: measurements, and a stamp with each, the time at which it was measured. Out: the estimate. A
measurement counts once, at the tick that is nearest to that time. One that arrives late goes there,
and what followed is computed again::

    tick         7       8       9      10         at tick 10 comes what was measured at 7: from
    measured                    y9     (y7)        the prediction of tick 7, correct with y7,
    ring       x P u   x P u   x P u               predict 8 and 9, correct with y9, predict 10

For a linear system this is the estimate of a filter that had got all measurements in time (Simon,
Optimal State Estimation, 2006, section 10.4, has cheaper forms for special cases).
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping

import numpy as np

from blocks.core import (
    Block,
    BlockContext,
    BlockState,
    FloatArray,
    Input,
    Output,
    ParameterError,
    Scalar,
    State,
    Vector,
    covariance_fault,
    param,
    rate_note,
    size_of,
)
from blocks.dynamics.covariances import corrected_covariance, kalman_gain
from blocks.dynamics.measurements import Measurement, Measurements
from blocks.messages import Message

# What is nearer than this to a whole number of steps, in steps, is whole.
WHOLE = 1e-6
NEVER = -1.0  # the stamp before the first measurement


class Filter(Block, ABC):
    """States that are predicted at each tick, and corrected by what was measured."""

    measurement = Input(
        Scalar,
        variadic=True,
        spread="measured",
        doc="y, numbers, records and vectors in order: those of the first measurement, and so on",
    )
    stamp = Input(
        Scalar,
        variadic=True,
        spread="stamped",
        doc="when each measurement without a dt was measured (s), as sensors say: what has the "
        "same stamp as before is not used again; without wires, each tick has a measurement",
    )
    estimate = Output(Vector("n"), doc="the corrected states")

    several: Measurements | None = param(
        None,
        name="measurements",
        doc="measurements by name, each with a model and covariance of its own, in place of those "
        "of one: {gps: {..., R: 1, dt: 0.2, delay: 0.1}, height: {..., R: 0.1}}",
    )
    q: FloatArray = param(
        shape=(None, None), name="Q", tunable=True, doc="covariance of the process noise"
    )
    r: FloatArray | None = param(
        None,
        shape=[(None, None), ()],
        name="R",
        tunable=True,
        doc="covariance of the measurement noise; or measurements, with an R each",
    )
    p0: FloatArray | None = param(
        None, shape=(None, None), name="P0", doc="its covariance; default the identity"
    )
    lag: float | None = param(
        None,
        unit="s",
        at_least=0.0,
        doc="age up to which a late measurement is used; default the longest delay",
    )

    x = State("n", name="x", doc="the prediction")
    p = State("n", "n", name="P", doc="its covariance")
    ring = State("rows", "width", ring="head", doc="per tick x, P, controls, y, and which are new")
    head = State(1, doc="ticks so far")
    seen = State("kinds", doc="the stamp of each measurement that was used last (s)")
    late = State("kinds", 2, doc="measurements older than lag: how many, and the greatest age (s)")

    # What the model of a single measurement is written in, for messages.
    model: str

    @abstractmethod
    def single(self) -> Measurement:
        """The measurement of parameters that describe a single one."""

    @property
    def own_r(self) -> FloatArray:
        """R of a single measurement, (p, p)."""
        r = np.ones(()) if self.r is None else self.r  # missing, which is reported
        return r.reshape(1, 1) if r.ndim == 0 else r

    @property
    @abstractmethod
    def order(self) -> int:
        """The number of states."""

    @property
    def kinds(self) -> tuple[Measurement, ...]:
        """All measurements in order."""
        return (self.single(),) if self.several is None else self.several.items

    @property
    def count(self) -> int:
        """How many numbers are measured."""
        return sum(kind.size for kind in self.kinds)

    def address(self, kind: Measurement, parameter: str) -> str:
        """The parameter of a measurement, as messages name it."""
        return parameter if self.several is None else f"measurements.{kind.name}.{parameter}"

    def covariance_problems(self) -> list[tuple[str, str]]:
        """What is wrong with covariances, and with what stands for measurements."""
        n = self.order
        problems: list[tuple[str, str]] = []
        if self.several is None and self.r is None:
            text = "missing; expected a covariance, or measurements"
            problems.append(("R", Message(text, "missing-value")))
        elif self.several is not None and (
            self.r is not None or self.value(self.model) is not None
        ):
            own = "R" if self.r is not None else self.model
            problems.append((own, "given with measurements, which have their own"))
        if self.several is None and not problems:
            problems += self.single().problems
        for name, matrix in (("Q", self.q), ("P0", self.p0)):
            if matrix is not None and matrix.shape != (n, n):
                problems.append((name, f"expected {n} x {n} numbers, got {size_of(matrix)}"))
            elif matrix is not None and (fault := covariance_fault(matrix)):
                problems.append((name, fault))
        return problems

    def sizes_in(self, context: BlockContext) -> dict[str, int]:
        n, kinds, oldest = self.order, len(self.kinds), self.oldest(context.dt)
        controls = self.controls(context)
        width = n + n * n + controls + self.count + kinds
        rows = oldest + 1 if oldest else 0
        return {"n": n, "kinds": kinds, "rows": rows, "width": width}

    @abstractmethod
    def controls(self, context: BlockContext) -> int:
        """How many numbers the prediction needs of each tick."""

    def oldest(self, dt: float) -> int:
        """The age, in ticks, up to which measurements are used."""
        lag = max(kind.delay for kind in self.kinds) if self.lag is None else self.lag
        return int(lag / dt + 0.5 + WHOLE)

    def validate_in(self, context: BlockContext) -> None:
        given, problems = context.count("measurement"), []
        if given != self.count:
            listed = ", ".join(f"{kind.name}: {kind.size}" for kind in self.kinds)
            parameter = "R" if self.several is None else "measurements"
            text = f"expected {self.count} number(s) in measurement ({listed}), got {given}"
            problems.append((parameter, text))
        names = [kind.name for kind in self.kinds if kind.dt is None]
        stamps = context.count("stamp")
        if stamps not in (0, len(names)):
            text = f"expected {len(names)} number(s) in stamp, one for each measurement without a "
            text += f"dt of its own ({', '.join(names) or 'none'}), got {stamps}"
            problems.append(("R" if self.several is None else "measurements", text))
        for kind in self.kinds:
            if kind.dt is not None and kind.dt < context.dt * (1.0 - WHOLE):
                text = f"expected at least the filter's own {context.dt:g} s, got {kind.dt:g}"
                problems.append((f"measurements.{kind.name}.dt", text))
            if kind.delay and self.lag is not None and self.lag < kind.delay * (1.0 - WHOLE):
                text = f"expected at least the delay of {kind.name}, {kind.delay:g} s, "
                problems.append(("lag", text + f"got {self.lag:g}"))
        if problems:
            raise ParameterError(problems)

    def notes(self, context: BlockContext, steps: Mapping[str, tuple[float, ...]]) -> Iterable[str]:
        at = 0
        for kind in self.kinds:
            new = max(steps["measurement"][at : at + kind.size])
            at += kind.size
            used = context.dt if kind.dt is None else kind.dt
            is_held = used * (1.0 + WHOLE) < new < math.inf
            if is_held and (kind.dt or not context.count("stamp")):
                way = f"write dt: {new:g} into measurements.{kind.name}"
                if self.several is None:
                    model = f"{self.model}: ..., R: ..., dt: {new:g}"
                    way = f"write measurements: {{{kind.name}: {{{model}}}}}"
                what = f"measurement '{kind.name}'"
                yield rate_note(what, new, used, f"{way}, or wire its sensor's stamp")

    def start(self, state: BlockState) -> None:
        n, kinds = self.order, self.kinds
        state.n, state.y, state.kinds = n, self.count, len(kinds)
        state.q, state.r = self.q.copy(), np.zeros((state.y, state.y))
        state.first, state.wrapped = np.zeros(len(kinds) + 1), np.zeros(state.y)
        state.period, state.offset, state.delay = np.zeros((3, len(kinds))).copy()
        state.place = np.full(len(kinds), -1.0)
        at, place = 0, 0
        for i, kind in enumerate(kinds):
            state.r[at : at + kind.size, at : at + kind.size] = kind.r
            for index in kind.angles:
                state.wrapped[at + int(index)] = 1.0
            state.period[i] = 0.0 if kind.dt is None else kind.dt
            state.offset[i], state.delay[i] = kind.offset, kind.delay
            if kind.dt is None and state.context.count("stamp"):
                state.place[i] = place
                place += 1
            at += kind.size
            state.first[i + 1] = at
        state.is_stamped = place > 0
        state.oldest, state.rows = self.oldest(state.dt), len(state.ring)
        state.u = self.controls(state.context)
        # Where a row of the ring has its parts: x, P, u, y, which are new.
        state.at_u = n + n * n
        state.at_y = state.at_u + state.u
        state.at_new = state.at_y + state.y
        state.seen[:] = NEVER
        state.P[:] = np.eye(n) if self.p0 is None else self.p0

    # Which measurements are new, and how old

    def ages(self, state: BlockState, t: float, stamp: tuple[float, ...]) -> FloatArray:
        """How old each measurement is (s); -1 where none is new."""
        age = np.full(state.kinds, -1.0)
        for i in range(state.kinds):
            if state.is_stamped and state.place[i] >= 0.0:
                own = stamp[int(state.place[i])]
                if own != state.seen[i] and own >= 0.0:
                    age[i] = max(t - own, 0.0)
            elif state.period[i] > 0.0:
                since = (t - state.offset[i]) / state.period[i] + WHOLE
                before = since - state.dt / state.period[i]
                # That one falls between the last tick and this one: into it, as it is rounded.
                if since >= 0.0 and (before < 0.0 or int(since) > int(before)):
                    age[i] = state.delay[i]
            else:
                age[i] = state.delay[i]
        return age

    def backs(self, state: BlockState, age: FloatArray) -> FloatArray:
        """The same in ticks; -1 also for what is older than lag, or than the run."""
        back = np.full(state.kinds, -1.0)
        for i in range(state.kinds):
            if age[i] >= 0.0:
                ticks = float(int(age[i] / state.dt + 0.5))
                if ticks <= state.oldest and ticks <= state.head[0]:
                    back[i] = ticks
        return back

    # The filter over the ticks from the oldest measurement to this one

    def filtered(
        self,
        state: BlockState,
        t: float,
        measurement: tuple[float, ...],
        back: FloatArray,
        ring: FloatArray,
        x: FloatArray,
        p: FloatArray,
    ) -> None:
        """Correct x and P of this tick, from the ring's row of the oldest new measurement on.

        The measurements are written into the ring, and the rows that follow are computed again.
        """
        n, head = state.n, int(state.head[0])
        at_u, at_y, at_new = state.at_u, state.at_y, state.at_new
        y, new = np.zeros(state.y), np.zeros(state.kinds)
        for k in range(state.y):
            y[k] = measurement[k]
        oldest = 0
        for i in range(state.kinds):
            if back[i] == 0.0:
                new[i] = 1.0
            elif back[i] > 0.0:
                oldest = max(oldest, int(back[i]))
                row = (head - int(back[i])) % state.rows
                ring[row, at_new + i] = 1.0
                for k in range(int(state.first[i]), int(state.first[i + 1])):
                    ring[row, at_y + k] = y[k]
        if oldest > 0:
            first = (head - oldest) % state.rows
            x[:] = ring[first, :n]
            for i in range(n):
                for j in range(n):
                    p[i, j] = ring[first, n + i * n + j]
        for ago in range(oldest, 0, -1):
            row, then = (head - ago) % state.rows, t - ago * state.dt
            self.keep(state, ring, row, x, p)
            was, fresh = ring[row, at_y:at_new].copy(), ring[row, at_new:].copy()
            self.correct(state, then, was, fresh, x, p)
            self.predict(state, then, ring[row, at_u:at_y].copy(), x, p)
        if state.rows > 0:
            row = head % state.rows
            self.keep(state, ring, row, x, p)
            ring[row, at_y:at_new] = y
            ring[row, at_new:] = new
        self.correct(state, t, y, new, x, p)

    def keep(
        self, state: BlockState, ring: FloatArray, row: int, x: FloatArray, p: FloatArray
    ) -> None:
        """Write the x and P that a tick began with into its row."""
        n = state.n
        ring[row, :n] = x
        ring[row, n : n + n * n] = p.reshape(n * n)

    def correct(
        self,
        state: BlockState,
        t: float,
        y: FloatArray,
        new: FloatArray,
        x: FloatArray,
        p: FloatArray,
    ) -> None:
        """Correct x and P with the new ones of all measurements y, together."""
        used, count = np.zeros(state.y), 0
        for i in range(state.kinds):
            if new[i] > 0.0:
                for k in range(int(state.first[i]), int(state.first[i + 1])):
                    used[count] = k
                    count += 1
        if count == 0:
            return
        rows = self.slopes(state, t, x)
        missed = self.errors(state, t, y, x)
        c = np.empty((count, state.n))
        r = np.empty((count, count))
        for a in range(count):
            k = int(used[a])
            for j in range(state.n):
                c[a, j] = rows[k, j]
            for b in range(count):
                r[a, b] = state.r[k, int(used[b])]
        weight = kalman_gain(p, c, r)
        for a in range(count):
            error = missed[int(used[a])]
            for i in range(state.n):
                x[i] += weight[i, a] * error
        p[...] = corrected_covariance(p, c, weight, r)

    @abstractmethod
    def slopes(self, state: BlockState, t: float, x: FloatArray) -> FloatArray:
        """C, or dh/dx at x, (p, n)."""

    @abstractmethod
    def errors(self, state: BlockState, t: float, y: FloatArray, x: FloatArray) -> FloatArray:
        """y less what is expected of x, (p,)."""

    @abstractmethod
    def predict(
        self, state: BlockState, t: float, u: FloatArray, x: FloatArray, p: FloatArray
    ) -> None:
        """Turn x and P of one tick into those of the next."""

    def output(
        self,
        state: BlockState,
        t: float,
        measurement: tuple[float, ...],
        stamp: tuple[float, ...] = (),
    ) -> FloatArray:
        # On copies: an output may be asked for again, so the correction is computed once more.
        x: FloatArray = state.x.copy()
        p, ring = state.P.copy(), state.ring.copy()
        back = self.backs(state, self.ages(state, t, stamp))
        self.filtered(state, t, measurement, back, ring, x, p)
        return x

    def step(
        self,
        state: BlockState,
        t: float,
        measurement: tuple[float, ...],
        stamp: tuple[float, ...],
        u: FloatArray,
    ) -> None:
        """The update of a tick with the controls u."""
        age = self.ages(state, t, stamp)
        back = self.backs(state, age)
        for i in range(state.kinds):
            if age[i] >= 0.0 and back[i] < 0.0 and age[i] < t + 0.5 * state.dt:
                state.late[i, 0] += 1.0
                state.late[i, 1] = max(state.late[i, 1], age[i])
            if state.is_stamped and state.place[i] >= 0.0:
                state.seen[i] = stamp[int(state.place[i])]
        self.filtered(state, t, measurement, back, state.ring, state.x, state.P)
        if state.rows > 0:
            row = int(state.head[0]) % state.rows
            for j in range(state.u):
                state.ring[row, state.at_u + j] = u[j]
        self.predict(state, t, u, state.x, state.P)
        state.head[0] += 1.0

    def diagnose(self, state: BlockState, ticks: int, watched: tuple[float, ...]) -> Iterable[str]:
        for kind, (count, age) in zip(self.kinds, state.late.tolist(), strict=True):
            if count:
                lag = self.oldest(state.dt) * state.dt
                yield (
                    f"{count:.0f} of measurement '{kind.name}' came later than lag = {lag:g} s and "
                    f"were not used, the latest {age:.3g} s after it was measured: set lag to "
                    "that, or more"
                )
