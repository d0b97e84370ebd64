"""FMUs that bring their own solver."""

from __future__ import annotations

from blocks.core import BlockState
from spikeblocks.fmu.imported import ImportedFMU
from spikeblocks.fmu.instance import Instance


class FMU(ImportedFMU):
    """An FMU for co-simulation: a model of another tool with its own solver.

        u ─▶ [ FMU ] ─▶ out

    At each tick of the block the FMU goes on by ``dt``, with the inputs of the tick held. ``out``
    has its outputs by name, with their units: ``tank.out.level``. Its state is the block's
    ``memory`` if it can write it (canSerializeFMUstate); otherwise a run with it cannot go back, be
    copied, or go on from a checkpoint. Needs the extra ``fmu``.
    """

    kind = "CoSimulation"
    other = "ModelExchangeFMU"

    def ready(self, state: BlockState, t: float, u: tuple[float, ...]) -> Instance:
        model = self.at(state)
        if u:
            model.set(state.sources, u)
        return model

    def update(self, state: BlockState, t: float, u: tuple[float, ...]) -> None:
        self.ready(state, t, u).step(t, state.dt)
        state.steps[0] += 1.0
        self.keep(state)
