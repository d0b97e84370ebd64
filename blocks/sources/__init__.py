"""Sources: signals that are functions of time, tables over time, files, and noise."""

from blocks.sources.noise import PinkNoise, RandomWalk, WhiteNoise, WhiteSignal
from blocks.sources.recorded import FromFile
from blocks.sources.time_tables import Piecewise
from blocks.sources.waveforms import Chirp, Clock, Pulse, Ramp, Sine, Step

__all__ = ["Chirp", "Clock", "FromFile", "Piecewise", "Pulse", "Ramp", "RandomWalk", "Sine"]
__all__ += ["PinkNoise", "Step", "WhiteNoise", "WhiteSignal"]
