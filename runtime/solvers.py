"""Solvers of the continuous states: Runge-Kutta methods as their coefficients.

In: a name of :data:`SOLVERS`. Out: a :class:`Method`, which is the one declaration of a solver: the
printers of plans take the stages from it, the control of steps its exponent, and the checks, notes,
the schema and the documentation its name and what it is::

    SOLVERS["heun"].terms       (((0, 1.0),), ((0, 0.5), (1, 0.5)))
                                x + h f_0 is where f_1 is computed, x + h (f_0 + f_1) / 2 the end
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from blocks.core import FloatArray

# The share of the step after which an implicit method estimates the derivative by time.
SHIFT = 1e-5
# The rows of the slopes after those of the stages and of the matrix's columns: which of its rows
# were exchanged, and its band.
SPARE = 2


@dataclass(frozen=True)
class Method:
    """An explicit Runge-Kutta method (Hairer, Norsett, Wanner, Solving ODEs I, section II.1), or
    a linearly implicit one.

    name : what ``run.solver`` calls it.
    doc : what it is, in a few words.
    order : the error of a whole run is proportional to this power of the step.
    nodes : the time of each stage as a share of the step.
    rows : how the slopes of the stages so far are weighted to reach the next stage; the last row
        gives the end of the step. For an implicit method see ``engine/rosenbrock.py``.
    errors : weights of the slopes in the estimated error of a step, or of the last one; none for a
        fixed step.
    error_order : the estimated error is proportional to this power of the step: 1 more than the
        lower one of the orders of an embedded pair. 0 for a fixed step.
    is_implicit : whether ``engine/rosenbrock.py`` moves the states from stage to stage.

    Raises
    ------
    ValueError : an estimated error without its order, or the other way round.
    """

    name: str
    doc: str
    order: int
    nodes: tuple[float, ...]
    rows: tuple[tuple[float, ...], ...]
    errors: tuple[float, ...] = ()
    error_order: float = 0.0
    is_implicit: bool = False

    def __post_init__(self) -> None:
        if bool(self.errors) != (self.error_order > 0.0):
            message = "the weights of an estimated error and its order go together"
            raise ValueError(f"solver '{self.name}': {message}")

    @property
    def is_adaptive(self) -> bool:
        """Whether it chooses its own steps."""
        return bool(self.errors)

    @property
    def exponent(self) -> float:
        """The step is proportional to this power of the tolerance."""
        return 1.0 / self.error_order

    @property
    def stages(self) -> int:
        return len(self.nodes)

    def slope_rows(self, size: int) -> int:
        """The rows of the slopes: one for each stage, and what an implicit method keeps."""
        return self.stages + (size + SPARE if self.is_implicit else 0)

    @property
    def terms(self) -> tuple[tuple[tuple[int, float], ...], ...]:
        """The rows as (stage, weight) where the weight is not zero."""
        return tuple(tuple((j, w) for j, w in enumerate(row) if w) for row in self.rows)

    @property
    def table(self) -> FloatArray:
        """The rows as an array, at least one per stage; the last column holds the nodes."""
        table = np.zeros((max(self.stages, len(self.rows)), self.stages + 1))
        for i, row in enumerate(self.rows):
            table[i, : len(row)] = row
        table[: self.stages, -1] = self.nodes
        return table


# Dormand and Prince, A family of embedded Runge-Kutta formulae (1980): table 2.
_DOPRI5 = (35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84)
# RODAS (Hairer and Wanner, Solving ODEs II, 1996, section IV.7): for each implicit stage how the
# increments so far are weighted to reach the next one, how they enter its equation, the weight of
# the derivative by time there, and its node.
_FIFTH = (1.221224509226641, 6.019134481288629, 12.53708332932087, -0.6878860361058950, 1.0)
_REACH = (
    (1.544,),
    (0.9466785280815826, 0.2557011698983284),
    (3.314825187068521, 2.896124015972201, 0.9986419139977817),
    _FIFTH[:4],
    _FIFTH,
    (*_FIFTH, 1.0),
)
_ENTER: tuple[tuple[float, ...], ...] = (
    (),
    (-5.6688,),
    (-2.430093356833875, -0.2063599157091915),
    (-0.1073529058151375, -9.594562251023355, -20.47028614809616),
    (7.496443313967647, -10.24680431464352, -33.99990352819905, 11.70890893206160),
    (
        *(8.083246795921522, -7.981132988064893, -31.52159432874371, 16.31930543123136),
        -6.058818238834054,
    ),
)
_BY_TIME = (0.25, -0.1043, 0.1035, -0.03620000000000023, 0.0, 0.0)
_NODES = (0.0, 0.386, 0.21, 0.63, 1.0, 1.0)
# Where nothing is stiff, its estimate is proportional to the fourth power of a step. The control
# assumes the fifth, so that steps change with more caution: that of a stiff component is no power.
_RODAS4 = Method(
    "rodas4",
    "linearly implicit, for stiff systems",
    order=4,
    nodes=(SHIFT, *_NODES[1:]),
    rows=(
        *_REACH,
        *((*e, *[0.0] * (5 - len(e)), d) for e, d in zip(_ENTER, _BY_TIME, strict=True)),
    ),
    errors=(1.0,),
    error_order=5,
    is_implicit=True,
)
_ALL = (
    Method("euler", "one slope", order=1, nodes=(0.0,), rows=((1.0,),)),
    Method("heun", "two slopes", order=2, nodes=(0.0, 1.0), rows=((1.0,), (0.5, 0.5))),
    Method(
        "rk4",
        "the classical method",
        order=4,
        nodes=(0.0, 0.5, 0.5, 1.0),
        rows=((0.5,), (0.0, 0.5), (0.0, 0.0, 1.0), (1 / 6, 1 / 3, 1 / 3, 1 / 6)),
    ),
    Method(
        "dopri5",
        "Dormand and Prince's pair",
        order=5,
        nodes=(0.0, 1 / 5, 3 / 10, 4 / 5, 8 / 9, 1.0, 1.0),
        rows=(
            (1 / 5,),
            (3 / 40, 9 / 40),
            (44 / 45, -56 / 15, 32 / 9),
            (19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729),
            (9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656),
            _DOPRI5,
            _DOPRI5,
        ),
        errors=(71 / 57600, 0.0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40),
        error_order=5,
    ),
    _RODAS4,
)
SOLVERS = {method.name: method for method in _ALL}
DEFAULT = "rk4"


def method_of(name: str, colours: int = 0) -> Method:
    """The method of a name; an implicit one has a stage for each colour of the Jacobian, too."""
    method = SOLVERS[name]
    if not method.is_implicit:
        return method
    before = colours + 1
    return replace(method, nodes=(0.0,) * before + method.nodes, rows=((),) * before + method.rows)


# The solvers that choose their own steps.
ADAPTIVE = tuple(name for name, method in SOLVERS.items() if method.is_adaptive)


def listed(names: Iterable[str], last: str = "and") -> str:
    """Names in a sentence: "dopri5 and rodas4"."""
    *first, end = names
    return f"{', '.join(first)} {last} {end}" if first else end


def solver_docs() -> str:
    """The solvers in a sentence, for the documentation of ``run.solver``."""
    fixed = [m for m in SOLVERS.values() if not m.is_adaptive]
    adaptive = [m for m in SOLVERS.values() if m.is_adaptive]
    one, many = (
        listed((f"`{m.name}` ({m.doc}, order {m.order})" for m in methods), "or")
        for methods in (fixed, adaptive)
    )
    return f"{one} in one step; {many} in as many steps as their tolerances need"
