"""A run in Python: its data, with plotting and saving on request.

In: what a run recorded, or a run's folder. Out: a :class:`Result`::

    result = open_run("runs/my/latest")
    result["plant.pose"][:, 0]; result.metrics["converged_at"]; result.plot("trajectory")
"""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING

from blocks.core import hint
from runtime.errors import UsageError
from runtime.observation import RunData
from runtime.runs.draft import save
from runtime.runs.folder import read_run

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame
    from xarray import Dataset

    from runtime.runs.display import Figures


class Result(RunData):
    """A run: ``result["plant.pose"]`` is an array, ``result.metrics`` a dict."""

    def plot(self, name: str | None = None) -> Figure | Figures:
        """Draw one of the graph's plots, or all of them, as matplotlib figures.

        A notebook shows what is returned once: figures are not tied to pyplot.
        """
        from runtime.plots import draw
        from runtime.runs.display import Figures

        if name is None:
            return Figures({plot.name: draw(plot, self) for plot in self.plots})
        for plot in self.plots:
            if plot.name == name:
                return draw(plot, self)
        names = [plot.name for plot in self.plots]
        raise UsageError(f"there is no plot '{name}'{hint(name, names) or ': ' + ', '.join(names)}")

    def to_dataframe(self, *names: str) -> DataFrame:
        """Signals as columns over the time ``t`` in seconds, for pandas (extra ``dataframes``).

        Parameters
        ----------
        names : as in ``result[name]``; without names, all that changes in time and is not a table
            in each row. Signals with other steps leave NaN where they have no row.

        ``attrs["units"]`` of the frame has the units of its columns.

        Raises
        ------
        MissingExtraError : pandas is not installed.
        KeyError : a name was not recorded.
        """
        from runtime.runs.frames import run_dataframe

        return run_dataframe(self, names)

    def to_xarray(self) -> Dataset:
        """All probes, for xarray (extra ``dataframes``): dimensions named, units in ``attrs``.

        Probes with the same times share the dimension ``t``; others have their own, ``t_<probe>``.

        Raises
        ------
        MissingExtraError : xarray is not installed.
        """
        from runtime.runs.frames import run_dataset

        return run_dataset(self)

    def _repr_html_(self) -> str:
        """The run as a notebook shows it: what ran, its metrics and its figures."""
        from runtime.runs.display import notebook_html

        return notebook_html(self)

    def save(self, folder: str | Path) -> Path:
        """Write the run into a folder that must not exist yet; returns the folder."""
        return save(self, Path(folder))


def open_run(path: str | Path) -> Result:
    """Read a run.

    Parameters
    ----------
    path : the run's folder, a link to it, or its manifest.json.

    Raises
    ------
    UsageError : there is no run, or one of its files is missing, damaged, or of a newer version.
    """
    data = read_run(path)
    return Result(**{each.name: getattr(data, each.name) for each in fields(data)})
