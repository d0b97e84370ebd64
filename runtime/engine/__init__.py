"""The engine: orders a network's evaluations, runs them tick by tick, and records probes.

``program`` is all that runs of a graph share: the plan, which ``python_text`` prints as Python.
``engine`` runs it, ``recorder`` stores rows, and ``compiled`` is the runner that compiles the plan.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from blocks.library.lazy import door

if TYPE_CHECKING:
    from runtime.engine.engine import Engine, Outcome
    from runtime.engine.interrupts import BetweenTicks, Interrupts, is_within, stoppable
    from runtime.engine.point import Offsets, Point, Watched, labels
    from runtime.engine.profile import Profile, profile_text
    from runtime.engine.program import Program
    from runtime.engine.reading import Reader
    from runtime.engine.recorder import Saved, recording_file, row_times
    from runtime.engine.repeating import begin_again
    from runtime.engine.runners import MakeRunner, silent
    from runtime.engine.selection import python_seconds, take_compiled
    from runtime.engine.transfer import (
        Carried,
        adopt,
        adopt_changed,
        carried,
        with_rows,
        without_rows,
    )
else:
    __getattr__ = door(__name__)
