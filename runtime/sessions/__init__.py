"""Sessions: a run that is stepped, read, written to, changed, copied and repeated.

In: a graph. Out: a :class:`Session`, whose changes are logged with their ticks::

    s = graph.session(seed=3)
    s.run(0.5)
    s.set("fault.gain", [1, 0.5])
    s.run(0.5)
    s.result()                  # as of a run: probes, metrics, plots
    s.save("sessions/a")        # runtime replay sessions/a computes the same bits
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from blocks.library.lazy import door

if TYPE_CHECKING:
    from runtime.sessions.kept import Became, SessionSnapshot
    from runtime.sessions.log import changes_of
    from runtime.sessions.saving import CHANGES, GRAPH, RUN, SESSION, VERSION
    from runtime.sessions.session import CALLS, Session
else:
    __getattr__ = door(__name__)
