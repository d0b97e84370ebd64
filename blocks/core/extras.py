"""Packages that only some blocks need: imported on first use, missed with the pip line."""

from __future__ import annotations

import importlib
from types import ModuleType


class MissingPackageError(ImportError):
    """A block needs a package of an optional extra that is not there.

    feature : what needs it. extra : the extra's name in the project's packaging.
    """

    def __init__(self, feature: str, extra: str) -> None:
        self.feature, self.extra = feature, extra
        super().__init__(f"{feature} needs an optional extra: pip install 'spikeblocks[{extra}]'")


def require(module: str, feature: str, extra: str) -> ModuleType:
    """Import a module of an optional extra.

    Raises
    ------
    MissingPackageError : it is not installed.
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise MissingPackageError(feature, extra) from error
