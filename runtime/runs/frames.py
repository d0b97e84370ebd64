"""A run as pandas' DataFrame and as xarray's Dataset (extra ``dataframes``).

In: a run. Out: columns as ``plant.pose.x`` over the time in seconds, or one array per probe. A
probe at 100 Hz beside one at 1 kHz leaves NaN in nine rows of ten; xarray gives it a time of its
own.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from blocks.core import FloatArray
from runtime.errors import UsageError
from runtime.observation import Recording, RunData
from runtime.tables import dataframe, package

if TYPE_CHECKING:
    from pandas import DataFrame
    from xarray import Dataset


def run_dataframe(result: RunData, names: Sequence[str]) -> DataFrame:
    """Signals as columns over the time in seconds; see ``Result.to_dataframe``."""
    pandas = package("pandas", "to_dataframe()")
    frames: list[DataFrame] = []
    units: dict[str, str] = {}
    labels: set[str] = set()
    for recording in _recordings(result, names):
        if recording.values.ndim > 2:
            raise UsageError(f"'{recording.name}' is a table in each row; to_xarray() has it")
        columns = {
            label: recording.columns[:, i]
            for i, label in enumerate(recording.labels)
            if label not in labels
        }
        units |= {
            label: unit
            for label, unit in zip(recording.labels, recording.units, strict=True)
            if unit
        }
        labels |= columns.keys()
        frame = dataframe(columns, {}, "to_dataframe()")
        frame.index = pandas.Index(recording.t, name="t")
        frames.append(frame)
    if not frames:
        return dataframe({}, {}, "to_dataframe()")
    # Signals with other steps leave gaps, which are NaN.
    table: DataFrame = pandas.concat(frames, axis=1).sort_index()
    table.index.name = "t"
    table.attrs["units"] = units
    return table


def run_dataset(result: RunData) -> Dataset:
    """Each probe as an array with named dimensions; see ``Result.to_xarray``."""
    xarray = package("xarray", "to_xarray()")
    axes: dict[bytes, str] = {}
    arrays: dict[str, tuple[list[str], FloatArray, dict[str, str]]] = {}
    coordinates: dict[str, object] = {}
    for name, recording in result.probes.items():
        # By content and not by rate: probes of one rate can begin at different times.
        axis = axes.setdefault(recording.t.tobytes(), f"t_{name}" if axes else "t")
        coordinates[axis] = (axis, recording.t, {"units": recording.time_unit})
        inner = [f"{name}_row", f"{name}_column"][3 - recording.values.ndim :]
        if inner and len(recording.labels) == recording.values.shape[-1]:
            coordinates[inner[-1]] = list(recording.labels)
        units = dict.fromkeys(recording.units)
        attributes = {"units": ", ".join(units)} if any(units) else {}
        arrays[name] = ([axis, *inner], recording.values, attributes)
    facts = {"title": result.title, "seed": result.manifest["seed"]}
    metrics = {name: value for name, value in result.metrics.items() if value is not None}
    dataset: Dataset = xarray.Dataset(arrays, coordinates, {**facts, **metrics})
    return dataset


def _recordings(result: RunData, names: Sequence[str]) -> list[Recording]:
    """The recordings of some names; of everything that changes and fits a column, without names."""
    if not names:
        probes = result.probes.values()
        return [
            recording for recording in probes if recording.values.ndim <= 2 and len(recording.t) > 1
        ]
    return [result.recording(name) for name in names]
