"""What learns its output online from an error signal, be it a network or an integrator."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable
from itertools import pairwise

from blocks.core import (
    Block,
    BlockState,
    FloatArray,
    Input,
    Output,
    ParameterError,
    Scalar,
    Vector,
    param,
)

LARGEST_STEP = 2.0
GROWING, GROWTH = 4, 1.5


class Learner(Block, ABC):
    """The ports and parameters by which one kind of learner can take another's place."""

    x = Input(Vector("d"), name="input", doc="what the neurons represent, the paper's a")
    error = Input(Vector("k"), doc="what learning descends; positive lowers the output")
    learn = Input(Scalar, default=1.0, doc="factor on the error: 0 pauses learning")

    learnt = Output(Vector("k"), name="output", doc="what was learnt")

    learning_rate: float = param(1e-4, at_least=0.0, doc="kappa of PES, as Nengo scales it")
    leak: float = param(0.0, unit="1/s", at_least=0.0, doc="rate at which what was learnt decays")
    limit: float = param(
        math.inf, above=0.0, finite=False, doc="largest size of each component of the output"
    )
    tau_rc: float = param(0.02, unit="s", above=0.0, doc="membrane time constant")
    tau_ref: float = param(0.002, unit="s", above=0.0, doc="refractory time; spikes: at least dt")
    max_rates: FloatArray = param(
        (200.0, 400.0), unit="Hz", above=0.0, shape=(2,), doc="range of the rates at input = radius"
    )
    intercepts: FloatArray = param(
        (-1.0, 0.9), below=1.0, shape=(2,), doc="range of the inputs where firing sets in"
    )

    def validate(self) -> None:
        problems = []
        for name in ("max_rates", "intercepts"):
            low, high = self.value(name)
            if low > high:
                problems.append((name, f"expected [low, high], got [{low:g}, {high:g}]"))
        fastest = 1.0 / self.tau_ref
        if self.max_rates[1] >= fastest:
            message = f"a refractory time of {self.tau_ref:g} s allows less than {fastest:g} Hz"
            problems.append(("max_rates", message))
        if problems:
            raise ParameterError(problems)

    def diagnose(self, state: BlockState, ticks: int, watched: tuple[float, ...]) -> Iterable[str]:
        """Steps that overshoot, and growth that does not end.

        With an error that is the output's own, one step of the rule multiplies it by 1 - g, where
        g is :meth:`gain_of_a_step`; above 2 it grows on each tick (Haykin, Adaptive Filter
        Theory: the bound on the step of LMS). Growth without bound is growth by half or more
        in each of the last four eighths of a run: faster than the cube of time.
        """
        gain = self.gain_of_a_step(state)
        if gain > LARGEST_STEP:
            yield (
                f"one step of learning changes the output by {gain:.3g} times the error; above "
                f"{LARGEST_STEP:g} it overshoots further each time; lower learning_rate"
            )
        last = watched[-GROWING - 1 :]
        grew = [b >= GROWTH * a > 0.0 for a, b in pairwise(last)]
        if len(grew) == GROWING and all(grew):
            yield (
                f"what it learnt grew {last[-1] / last[0]:.3g}-fold over the last half of the run, "
                "and ever faster: learning diverges; check the sign of the error, lower "
                "learning_rate or give it a leak or a limit"
            )

    @abstractmethod
    def gain_of_a_step(self, state: BlockState) -> float:
        """How much one update changes the output, as a multiple of the error."""

    @abstractmethod
    def output(self, state: BlockState, t: float) -> FloatArray:
        """What was learnt up to this tick, (k,), each component within +-limit."""
