"""What a package index gets: versions that agree, addresses that work there, and every file."""

from __future__ import annotations

import re
import runpy
import shutil
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("blocks", "graphs", "runtime", "spikeblocks")


def content(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


PROJECT: dict[str, Any] = tomllib.loads(content("pyproject.toml"))["project"]


def test_every_file_that_names_the_version_names_the_same() -> None:
    first = re.findall(r"^## (\S+)", content("CHANGELOG.md"), re.M)[0]
    (cited,) = re.findall(r"^version: (.*)", content("CITATION.cff"), re.M)
    assert first == cited == PROJECT["version"]


def test_the_address_of_the_project_stands_in_one_place() -> None:
    owner = PROJECT["urls"]["Repository"].removesuffix("/spikeblocks")
    assert all(address.startswith(f"{owner}/") for address in PROJECT["urls"].values())
    pages = ["CITATION.cff", *(str(path.relative_to(ROOT)) for path in ROOT.glob("**/*.md"))]
    assert [page for page in pages if page[0] != "." and owner in content(page)] == []


def test_links_of_the_index_page_have_addresses(monkeypatch: pytest.MonkeyPatch) -> None:
    setuptools = pytest.importorskip("setuptools")
    given: dict[str, str] = {}
    monkeypatch.setattr(setuptools, "setup", lambda **arguments: given.update(arguments))
    runpy.run_path(str(ROOT / "setup.py"))
    of_files = re.findall(r"\]\((?!https:|#)([^)]*)\)", content("README.md"))
    on_index = re.findall(r"\]\(([^)]*)\)", given["long_description"])
    repository, tag = PROJECT["urls"]["Repository"], f"v{PROJECT['version']}"
    for path in of_files:
        assert (ROOT / path).is_file()
        view = "raw" if path.endswith((".gif", ".png", ".svg")) else "blob"
        assert f"{repository}/{view}/{tag}/{path}" in on_index
    assert all(address.startswith(("https://", "#")) for address in on_index)
    assert len(of_files) > 20


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("git") is None, reason="needs git")
def test_a_build_has_every_file(tmp_path: Path) -> None:
    pytest.importorskip("build")
    git = ["git", "-C", str(ROOT), "ls-files"]
    tracked = set(subprocess.check_output(git, text=True).splitlines())
    for name in tracked:
        (tmp_path / "checkout" / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(ROOT / name, tmp_path / "checkout" / name)
    command = [sys.executable, "-m", "build", "--outdir", str(tmp_path / "dist"), "checkout"]
    subprocess.run(command, cwd=tmp_path, check=True, stdout=subprocess.DEVNULL)
    with tarfile.open(next((tmp_path / "dist").glob("*.tar.gz"))) as file:
        in_source = {name.partition("/")[2] for name in file.getnames()}
    assert tracked - in_source == {
        *(".gitignore", ".pre-commit-config.yaml", ".github/workflows/release.yml"),
    }
    with zipfile.ZipFile(next((tmp_path / "dist").glob("*.whl"))) as file:
        in_wheel = {name for name in file.namelist() if ".dist-info/" not in name}
    packaged = {name for name in tracked if name.partition("/")[0] in PACKAGES}
    assert in_wheel == packaged | {"spikeblocks_command.py"}
