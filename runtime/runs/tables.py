"""A run as pandas' DataFrame and as xarray's Dataset (extra ``dataframes``)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from blocks.core import FloatArray
from runtime.dataframes import dataframe, package
from runtime.errors import UsageError
from runtime.observation import Recording, RunData

if TYPE_CHECKING:
    from pandas import DataFrame
    from xarray import Dataset


def run_dataframe(result: RunData, names: Sequence[str]) -> DataFrame:
    """Signals as columns over the time in seconds; see ``Result.to_dataframe``."""
    pandas = package("pandas", "to_dataframe()")
    frames: list[DataFrame] = []
    units: dict[str, str] = {}
    taken: set[str] = set()
    for found in _chosen(result, names):
        if found.values.ndim > 2:
            raise UsageError(f"'{found.name}' is a table in each row; to_xarray() has it")
        columns = {
            label: found.columns[:, i] for i, label in enumerate(found.labels) if label not in taken
        }
        units |= {
            label: unit for label, unit in zip(found.labels, found.units, strict=True) if unit
        }
        taken |= columns.keys()
        frame = dataframe(columns, {}, "to_dataframe()")
        frame.index = pandas.Index(found.t, name="t")
        frames.append(frame)
    if not frames:
        return dataframe({}, {}, "to_dataframe()")
    # Signals with other steps leave gaps, which are NaN.
    joined: DataFrame = pandas.concat(frames, axis=1).sort_index()
    joined.index.name = "t"
    joined.attrs["units"] = units
    return joined


def run_dataset(result: RunData) -> Dataset:
    """Each probe as an array with named dimensions; see ``Result.to_xarray``."""
    xarray = package("xarray", "to_xarray()")
    axes: dict[bytes, str] = {}
    arrays: dict[str, tuple[list[str], FloatArray, dict[str, str]]] = {}
    coordinates: dict[str, object] = {}
    for name, found in result.probes.items():
        axis = axes.setdefault(found.t.tobytes(), f"t_{name}" if axes else "t")
        coordinates[axis] = (axis, found.t, {"units": found.time_unit})
        inner = [f"{name}_row", f"{name}_column"][3 - found.values.ndim :]
        if inner and len(found.labels) == found.values.shape[-1]:
            coordinates[inner[-1]] = list(found.labels)
        units = dict.fromkeys(found.units)
        attributes = {"units": ", ".join(units)} if any(units) else {}
        arrays[name] = ([axis, *inner], found.values, attributes)
    described = {"title": result.title, "seed": result.manifest["seed"]}
    known = {name: value for name, value in result.metrics.items() if value is not None}
    dataset: Dataset = xarray.Dataset(arrays, coordinates, {**described, **known})
    return dataset


def _chosen(result: RunData, names: Sequence[str]) -> list[Recording]:
    """The recordings of some names; of everything that changes and fits a column, without names."""
    if not names:
        recorded = result.probes.values()
        return [found for found in recorded if found.values.ndim <= 2 and len(found.t) > 1]
    return [result.recording(name) for name in names]
