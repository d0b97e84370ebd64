"""Packages that offer blocks: each is imported when it is needed, and a broken one is named."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest

from blocks.core import Block
from blocks.generic import Sum
from blocks.library.extensions import BrokenPackageError, Registry
from tests.conftest import Run

GROUP = "spikeblocks.blocks"
DOUBLE = """from blocks.core import Block, Input, Output, Scalar


class Twice(Block):
    "Doubles a number."

    x = Input(Scalar)
    out = Output(Scalar)

    def output(self, state, t, x):
        return 2.0 * x
"""


def package(folder: Path, name: str, offers: str, code: str | None = None) -> None:
    """Install a package of one module by hand, as pip leaves it."""
    metadata = folder / f"{name}-1.0.dist-info"
    metadata.mkdir(parents=True)
    (metadata / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    (metadata / "entry_points.txt").write_text(offers)
    if code is not None:
        (folder / f"{name}.py").write_text(code)


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder of packages: one that works, and one of each kind that does not."""
    folder, before = tmp_path / "site", set(sys.modules)
    head = f"[{GROUP}]\n"
    package(folder, "sb_good", f"{head}Twice = sb_good:Twice\n", DOUBLE)
    package(folder, "sb_raises", f"{head}Raises = sb_raises:A\n", "raise OSError('no license')")
    package(folder, "sb_exits", f"{head}Exits = sb_exits:A\n", "import sys\nsys.exit('bye')")
    package(folder, "sb_absent", f"{head}Absent = sb_absent:A\n")
    package(folder, "sb_empty", f"{head}Empty = sb_empty:A\n", "")
    package(folder, "sb_number", f"{head}Number = sb_number:A\n", "A = 3")
    package(folder, "sb_blank", f"{head}Blank =\n", "")
    package(folder, "sb_text", f"{head}no entry\n")
    package(folder, "sb_taken", f"{head}Sum = sb_taken:A\n", "raise RuntimeError('imported')")
    package(folder, "sb_again", f"{head}Raises = sb_again:A\n", "raise RuntimeError('imported')")
    package(folder, "sb_latin", f"{head}Latin = sb_latin:A\n")
    (folder / "sb_latin-1.0.dist-info/METADATA").write_bytes(b"\xff\xfe")
    (folder / "sb_text-1.0.dist-info/entry_points.txt").write_bytes(b"\xff\xfe[x")
    monkeypatch.syspath_prepend(str(folder))
    yield folder
    for name in set(sys.modules) - before:
        if name.startswith("sb_"):
            del sys.modules[name]


def offered() -> Registry[type[Block]]:
    return Registry("blocks", Block, "a subclass of Block", own={"Sum": Sum}, classes=True)


def test_each_package_is_imported_only_when_its_name_is_asked_for(site: Path) -> None:
    packages = offered()
    assert {"Twice", "Raises", "Exits", "Absent", "Empty", "Number"} <= set(packages.names())
    assert packages.find("Nobody") is None
    assert "sb_good" not in sys.modules
    found = packages.find("Twice")
    assert found is not None
    assert found.__name__ == "Twice"
    assert not {"sb_raises", "sb_exits", "sb_empty", "sb_number"} & set(sys.modules)


def test_what_was_found_keeps_its_name_when_the_path_changes(
    site: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    packages = offered()
    twice = packages["Twice"]
    package(tmp_path / "more", "sb_more", f"[{GROUP}]\nMore = sb_good:Twice\n")
    assert packages.get("More") is None
    monkeypatch.syspath_prepend(str(tmp_path / "more"))
    assert packages.get("More") is twice
    assert packages.name_of(twice) == "Twice"
    assert packages.name_of(Sum) == ""


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("Raises", "cannot be imported: OSError: no license"),
        ("Exits", "cannot be imported: SystemExit: bye"),
        ("Absent", "cannot be imported: ModuleNotFoundError: No module named 'sb_absent'"),
        ("Empty", "cannot be imported: AttributeError: module 'sb_empty' has no attribute 'A'"),
        ("Number", "is not a subclass of Block"),
    ],
)
def test_the_error_names_the_package_and_the_cause(site: Path, name: str, reason: str) -> None:
    packages = offered()
    with pytest.raises(BrokenPackageError) as caught:
        packages.find(name)
    # Of two packages that offer a name, the one that Python finds first is used.
    owner = next(p for p in ("sb_again", f"sb_{name.lower()}") if f"{p} " in str(caught.value))
    expected = "cannot be imported: RuntimeError: imported" if owner == "sb_again" else reason
    assert str(caught.value) == f"'{name}' of package {owner} 1.0: {owner}:A {expected}"


def test_broken_packages_are_lines_and_the_others_can_be_used(site: Path) -> None:
    packages = offered()
    assert packages.usable()["Twice"].__name__ == "Twice"
    lines = packages.broken()
    for name in ("raises", "again", "exits", "absent", "empty", "number", "blank", "text"):
        assert sum(f"package sb_{name} 1.0" in line for line in lines) == 1, lines
    assert sum(line.startswith(f"package in {site}: ") for line in lines) == 1
    assert "'Sum' of package sb_taken 1.0 is not used: the library has that name itself" in lines
    assert sum("has that name, too" in line for line in lines) == 1


GRAPH = """graph: g
run: {dt: 0.1, until: 0.2}
blocks:
  c: {type: Constant, value: 2}
  d: {type: TYPE}
wires: {d: {x: c.value}}
probes: {out: d.out}
"""


def test_the_command_line_goes_on_with_the_packages_that_work(
    cli: Run, site: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PYTHONPATH", str(site))

    def ran(kind: str) -> SimpleNamespace:
        (tmp_path / "g.yaml").write_text(GRAPH.replace("TYPE", kind))
        done = cli("run", "g.yaml", "--no-plots")
        assert "Traceback" not in done.stderr
        return SimpleNamespace(code=done.returncode, text=done.stderr)

    assert ran("Twice").code == 0
    assert ran("Exits").text.splitlines()[0] == (
        "g.yaml:5:13: blocks.d.type: 'Exits' of package sb_exits 1.0: sb_exits:A cannot be "
        "imported: SystemExit: bye"
    )
    typo = ran("Twicw")
    assert (typo.code, typo.text.splitlines()[0]) == (
        2,
        "g.yaml:5:13: blocks.d.type: no block type 'Twicw', did you mean 'Twice'?",
    )

    listed = cli("blocks")
    assert listed.returncode == 0
    assert "Doubles a number." in listed.stdout
    assert "note: 'Exits' of package sb_exits 1.0: sb_exits:A cannot be imported" in listed.stderr
    named = cli("blocks", "Number")
    assert (named.returncode, named.stderr.count("\n")) == (2, 1)
    assert "sb_number:A is not a subclass of Block" in named.stderr
