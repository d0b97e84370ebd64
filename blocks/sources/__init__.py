"""Sources: functions of time, tables over time, files, paths in space, noise, wind, trials."""

from __future__ import annotations

from typing import TYPE_CHECKING

from blocks.library.lazy import door

if TYPE_CHECKING:
    from blocks.sources.flight_paths import Lemniscate, MinimumSnap
    from blocks.sources.noise import PinkNoise, RandomWalk, WhiteNoise, WhiteSignal
    from blocks.sources.recorded import FromFile
    from blocks.sources.time_tables import Piecewise, Table
    from blocks.sources.trials import Trials, Vocabulary
    from blocks.sources.waveforms import Chirp, Clock, Pulse, Ramp, Sine, Step
    from blocks.sources.wind import DrydenWind
else:
    __getattr__ = door(__name__)

__all__ = [
    "Chirp",
    "Clock",
    "DrydenWind",
    "FromFile",
    "Lemniscate",
    "MinimumSnap",
    "Piecewise",
    "Pulse",
    "Ramp",
    "RandomWalk",
    "Sine",
]
__all__ += ["PinkNoise", "Step", "Table", "Trials", "Vocabulary", "WhiteNoise", "WhiteSignal"]
