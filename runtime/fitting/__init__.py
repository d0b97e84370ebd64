"""Parameters of a graph from recorded data, by least squares.

In: a graph, ranges of some of its numbers, and columns of files beside its signals. Out: the
numbers that reproduce the data best, with confidence intervals, and what the data cannot tell::

    runtime.fit("arm.yaml", {"arm.damping": "0..1"}, {"push.csv": {"angle": "arm.angle"}})
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from blocks.library.lazy import door

if TYPE_CHECKING:
    from runtime.fitting.fit_plots import fit_figures
    from runtime.fitting.from_python import fit, model_of
    from runtime.fitting.model import Model
    from runtime.fitting.output import as_plain, save_fit, summary
    from runtime.fitting.solving import Fit, Parameter, fit_model
else:
    __getattr__ = door(__name__)
