"""Sources: signals that are functions of time, tables over time, files, noise, and trials."""

from __future__ import annotations

from typing import TYPE_CHECKING

from blocks.lazy import door

if TYPE_CHECKING:
    from blocks.sources.noise import PinkNoise, RandomWalk, WhiteNoise, WhiteSignal
    from blocks.sources.recorded import FromFile
    from blocks.sources.time_tables import Piecewise
    from blocks.sources.trials import Trials, Vocabulary
    from blocks.sources.waveforms import Chirp, Clock, Pulse, Ramp, Sine, Step
else:
    __getattr__ = door(__name__)

__all__ = ["Chirp", "Clock", "FromFile", "Piecewise", "Pulse", "Ramp", "RandomWalk", "Sine"]
__all__ += ["PinkNoise", "Step", "Trials", "Vocabulary", "WhiteNoise", "WhiteSignal"]
