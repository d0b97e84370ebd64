"""Runs: simulating a prepared graph once, its result, and the run folder on disk.

In: a :class:`PreparedRun`. Out: a :class:`Result` in memory, and a folder of files::

    result = simulate(prepared)          # or Graph.run
    result["plant.pose"]                 # (rows, 3)
    open_run(result.save("runs/a"))      # the same again, from its files

``simulation`` runs a graph, ``result`` is the run in Python, ``folder`` writes and reads the format
of a run folder, ``draft`` creates run folders in one step and recovers those of killed runs.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from blocks.library.lazy import door

if TYPE_CHECKING:
    from runtime.runs.checkpoint import BEFORE, Checkpoints, Source, read_checkpoint
    from runtime.runs.commit import git_commit
    from runtime.runs.display import Figures, compared_metrics, metrics_table
    from runtime.runs.draft import (
        RECORDING,
        Draft,
        leftovers,
        link_latest,
        new_folder,
        recover,
        remove,
        root_of,
        save,
        save_elsewhere,
    )
    from runtime.runs.equilibrium import Trim, trim
    from runtime.runs.fingerprint import Program, check_same_program, program, program_of, versions
    from runtime.runs.folder import (
        CHECKPOINT,
        DIAGRAM,
        MANIFEST,
        METRICS,
        PROBES,
        RESOLVED,
        WRITTEN,
        contents,
        portable,
        read_run,
        run_folder,
    )
    from runtime.runs.linearization import Linearization, linearize
    from runtime.runs.operating_point import output_at
    from runtime.runs.pacing import OVERRUNS, UNITS, Pacing, pacing_text
    from runtime.runs.result import Result, open_run
    from runtime.runs.simulation import (
        PreparedRun,
        at_start,
        chosen_runner,
        result_of,
        simulate,
    )
    from runtime.runs.stability import Margins, margins, step_info
else:
    __getattr__ = door(__name__)
