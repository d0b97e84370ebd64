"""Optional packages, imported on first use; the error names the pip command."""

from __future__ import annotations

import importlib
from pathlib import Path
from types import ModuleType

ROOT = Path(__file__).resolve().parents[2]


class MissingPackageError(ImportError):
    """A package of an optional extra is not installed.

    feature : what needs the package. extra : the extra that installs it.
    """

    def __init__(self, feature: str, extra: str) -> None:
        self.feature, self.extra = feature, extra
        super().__init__(f"{feature} needs an optional extra: {pip_line(extra)}")


def pip_line(extra: str) -> str:
    """The command that installs an extra, from where this copy of the package came.

    A checkout is installed in place, a folder or an archive by its path, and what an index
    offered by its name.
    """
    import shlex

    if (ROOT / "pyproject.toml").is_file():
        folder = "." if Path.cwd() == ROOT else str(ROOT)
        return f"pip install -e {shlex.quote(f'{folder}[{extra}]')}"
    return f"pip install {shlex.quote(f'{_origin()}[{extra}]')}"


def _origin() -> str:
    """The folder or archive that pip installed the package from; its name if it was an index."""
    # Every start imports this module, and few need these.
    import json
    from importlib.metadata import PackageNotFoundError, distribution
    from urllib.parse import unquote, urlsplit

    try:
        written = distribution("spikeblocks").read_text("direct_url.json")
    except PackageNotFoundError:
        written = None
    url = urlsplit(str(json.loads(written or "{}").get("url", "")))
    return unquote(url.path) if url.scheme == "file" else "spikeblocks"


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
