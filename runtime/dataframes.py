"""Tables of other packages, which are optional: pandas' DataFrame, xarray's Dataset."""

from __future__ import annotations

from collections.abc import Mapping
from types import ModuleType
from typing import TYPE_CHECKING

from blocks.core import FloatArray, MissingPackageError, require
from runtime.errors import MissingExtraError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pandas import DataFrame

EXTRA = "dataframes"


def package(name: str, feature: str) -> ModuleType:
    """An optional package of tables.

    Raises
    ------
    MissingExtraError : it is not installed.
    """
    try:
        return require(name, feature, EXTRA)
    except MissingPackageError as error:
        raise MissingExtraError(error.feature, error.extra) from None


def dataframe(
    columns: Mapping[str, Sequence[object] | FloatArray], units: Mapping[str, str], feature: str
) -> DataFrame:
    """A table of columns; ``attrs["units"]`` has the units of those that have one.

    Raises
    ------
    MissingExtraError : pandas is not installed.
    """
    frame: DataFrame = package("pandas", feature).DataFrame(dict(columns))
    frame.attrs["units"] = dict(units)
    return frame
