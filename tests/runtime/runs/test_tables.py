"""A run as pandas' and xarray's tables holds what was recorded."""

from __future__ import annotations

import re
import sys

import numpy as np
import pytest

import runtime
from blocks.core import pip_line
from runtime.runs import Result


@pytest.fixture(scope="module")
def result() -> Result:
    graph = runtime.load("starters/adaptive").set("run.until", 0.5)
    return graph.probe("track.path").run()


def test_a_dataframe_has_every_row_with_its_time_and_unit(result: Result) -> None:
    frame = result.to_dataframe("errors")
    assert list(frame.columns) == ["error.position", "error.heading"]
    assert np.array_equal(frame.to_numpy(), result["errors"])
    assert np.array_equal(frame.index.to_numpy(), result.time("errors"))
    assert frame.attrs["units"] == {"error.position": "m", "error.heading": "rad"}


def test_signals_with_other_steps_leave_gaps(result: Result) -> None:
    frame = result.to_dataframe("plant.pose", "errors")
    assert len(frame) == len(result.time("plant.pose"))
    assert frame.index.is_monotonic_increasing
    known = frame["error.position"].dropna()
    assert np.array_equal(known.to_numpy(), result["error.position"])
    assert np.array_equal(known.index.to_numpy(), result.time("errors"))
    assert np.array_equal(frame["plant.pose.x"].to_numpy(), result["plant.pose"][:, 0])


def test_a_dataframe_of_everything_leaves_out_constants(result: Result) -> None:
    columns = set(result.to_dataframe().columns)
    assert {"error.position", "total.out.omega", "plant.pose.theta"} <= columns
    assert not any(name.startswith("track.path") for name in columns)
    with pytest.raises(KeyError, match="was not recorded"):
        result.to_dataframe("nothing")


def test_xarray_has_every_probe(result: Result) -> None:
    data = result.to_xarray()
    for name, found in result.probes.items():
        assert np.array_equal(data[name].to_numpy(), found.values, equal_nan=True)
        assert np.array_equal(data[name][data[name].dims[0]].to_numpy(), found.t)
    assert data["errors"].dims[0] == data["turn"].dims[0]
    theta = data["plant_pose" if "plant_pose" in data else "plant.pose"]
    assert theta.attrs["units"] == "m, rad"
    x = theta.sel({theta.dims[1]: "plant.pose.x"})
    assert np.array_equal(x.to_numpy(), result["plant.pose"][:, 0])
    assert data.attrs["seed"] == 7


@pytest.mark.parametrize("package", ["pandas", "xarray"])
def test_a_missing_package_is_named_with_the_pip_line(
    result: Result, package: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(runtime.MissingExtraError, match=re.escape(pip_line("dataframes"))):
        (result.to_dataframe if package == "pandas" else result.to_xarray)()
