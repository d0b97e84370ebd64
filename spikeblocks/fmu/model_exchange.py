"""FMUs that say how their states change, which the run's solver integrates."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from blocks.core import BlockContext, BlockState, FloatArray, ParameterError, State
from spikeblocks.fmu.imported import ImportedFMU
from spikeblocks.fmu.instance import Instance


class ModelExchangeFMU(ImportedFMU):
    """An FMU for model exchange: equations of another tool, integrated by the run's solver.

        u ─▶ [ ModelExchangeFMU ] ─▶ out

    Its continuous states are integrated with those of all other blocks. Its event indicators and
    the times that it announces are located between ticks, as other events are; with ``run: {events:
    ticks}``, they act at the next tick. Needs the extra ``fmu``.
    """

    kind = "ModelExchange"
    other = "FMU"

    x = State("states", name="x", continuous=True, doc="the continuous states")
    due = State(1, name="due", unit="s", doc="when the FMU announced an event; inf for none")
    was = State("signs", name="was", doc="the event indicators on the last tick")

    def sizes(self) -> dict[str, int]:
        if "path" not in self.__dict__:
            return {}
        return {"states": self.description.states, "signs": self.description.indicators}

    def validate_in(self, context: BlockContext) -> None:
        super().validate_in(context)
        if context.located and not self.description.states:
            message = "an FMU without continuous states is not integrated, so that no event of it "
            message += "is located; write run: {events: ticks}"
            raise ParameterError([("file", message)])

    def begun(self) -> Instance:
        model = super().begun()
        _, model.due = model.events()
        return model

    def start(self, state: BlockState) -> None:
        super().start(state)
        state.x[:] = state.model.numbers("getContinuousStates", len(state.x))
        state.due[0] = state.model.due
        state.was[...] = math.nan
        rates = "getContinuousStateDerivatives" if state.model.is_three else "getDerivatives"
        state.rates = rates

    def ready(self, state: BlockState, t: float, u: tuple[float, ...]) -> Instance:
        model = self.at(state)
        model.place(t, state.x)
        if u:
            model.set(state.sources, u)
        return model

    def derivative(self, state: BlockState, t: float, u: tuple[float, ...]) -> FloatArray:
        found: FloatArray = self.ready(state, t, u).numbers(state.rates, len(state.x))
        return found

    def crossings(self, context: BlockContext) -> Sequence[str]:
        return [*["either"] * self.description.indicators, "rising"]

    def guards(self, state: BlockState, t: float, u: tuple[float, ...]) -> FloatArray:
        signs = self.ready(state, t, u).numbers("getEventIndicators", len(state.was))
        due = float(state.due[0])
        return np.append(signs, t - due if math.isfinite(due) else -1.0)

    def event(self, state: BlockState, t: float, which: float, u: tuple[float, ...]) -> None:
        model = self.ready(state, t, u)
        model.call(model.fmu.enterEventMode)
        changed, state.due[0] = model.events()
        if changed:
            state.x[:] = model.numbers("getContinuousStates", len(state.x))
        state.steps[0] += 1.0
        self.keep(state)

    def update(self, state: BlockState, t: float, u: tuple[float, ...]) -> None:
        signs = self.ready(state, t, u).numbers("getEventIndicators", len(state.was))
        crossed = bool(np.any((signs > 0.0) != (state.was > 0.0))) and not math.isnan(
            float(np.sum(state.was))
        )
        state.was[:] = signs
        wants, ends = state.model.call(state.model.fmu.completedIntegratorStep)
        if ends:
            raise ArithmeticError(f"'{self.description.name}' ends the simulation")
        on_ticks = not state.context.located and (crossed or t >= state.due[0])
        if wants or on_ticks:
            self.event(state, t, 0.0, u)
        # Without continuous states nothing is integrated, and no event located, until then.
        while not len(state.x) and state.due[0] <= t + state.dt * (1.0 + 1e-9):
            self.event(state, float(state.due[0]), 0.0, u)
