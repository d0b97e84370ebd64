"""The README as a package index shows it: pictures and links with absolute addresses.

Everything else about the package is in pyproject.toml. A link of README.md such as
``![Errors](docs/images/errors.png)`` becomes ``![Errors](<repository>/raw/v<version>/docs/...)``.
"""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

from setuptools import setup

HERE = Path(__file__).parent
# "![text](docs/a.png)" and "[text](docs/a.md)", without addresses and places of the page itself.
LINK = re.compile(r"(!?)(\[[^]]*\])\((?!https?://|#)([^)\s]+)\)")


def on_index() -> str:
    """The text of README.md with absolute addresses."""
    project = tomllib.loads((HERE / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    repository, tag = project["urls"]["Repository"], f"v{project['version']}"

    def absolute(link: re.Match[str]) -> str:
        view = "raw" if link[1] else "blob"
        return f"{link[1]}{link[2]}({repository}/{view}/{tag}/{link[3]})"

    return LINK.sub(absolute, (HERE / "README.md").read_text(encoding="utf-8"))


setup(long_description=on_index(), long_description_content_type="text/markdown")
