"""Optional packages, imported on first use; the error names the pip command."""

from __future__ import annotations

import importlib
from types import ModuleType


class MissingPackageError(ImportError):
    """A package of an optional extra is not installed.

    feature : what needs the package. extra : the extra that installs it.
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
