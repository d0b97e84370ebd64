"""Nengo's own tests with our Simulator: which fail, and why, is ``own_tests.json``.

``python -m tests.bridges.nengo.test_nengos_tests`` runs them and writes the file anew, with the
reasons that it has; docs/coming-from-nengo.md shows it.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import venv
from collections import Counter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
FAILURES = Path(__file__).with_name("own_tests.json")
PAGE = ROOT / "docs" / "coming-from-nengo.md"
BEGIN, END = "<!-- begin: Nengo's tests -->\n", "<!-- end: Nengo's tests -->\n"
MODULES = (
    *("connection", "ensemble", "learning_rules", "neurons"),
    *("node", "probe", "processes", "simulator"),
)
WANTED = 330
# Nengo's fixtures come from plugins that pytest 9 cannot load.
NEEDED = ("pytest>=8,<9", "pytest-rng", "pytest-allclose", "pytest-plt")
PLUGIN = """
import json

import pytest


def pytest_collection_modifyitems(config, items):
    items[:] = [item for item in items if "Simulator" in item.fixturenames]


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport(item, call):
    outcome = yield
    report = outcome.get_result()
    if report.when == "call" or report.outcome != "passed":
        row = [item.module.__name__.rpartition("test_")[2], item.name, report.outcome]
        with open("results.jsonl", "a") as stream:
            stream.write(json.dumps(row) + "\\n")
"""


def environment(folder: Path) -> Path | None:
    """Python of an environment with what Nengo's tests need; None if it cannot be installed."""
    venv.create(folder, with_pip=True)
    python = folder / ("Scripts" if os.name == "nt" else "bin") / "python"
    install = [str(python), "-m", "pip", "install", "-q", *NEEDED]
    if subprocess.run(install, capture_output=True, check=False).returncode:
        return None
    site = next(folder.glob("lib/python*/site-packages"), folder / "Lib" / "site-packages")
    # Nengo itself, and what we need, as they are here.
    here = [path for path in sys.path if path.endswith("site-packages")]
    (site / "shared.pth").write_text("\n".join(here) + "\n", encoding="utf-8")
    return python


def results(folder: Path) -> dict[str, str] | None:
    """The outcome of each of Nengo's tests that uses a simulator, by module and name."""
    python = environment(folder / "env")
    if python is None:
        return None
    ini = "[pytest]\nnengo_simulator = spikeblocks.nengo.Simulator\n"
    (folder / "pytest.ini").write_text(ini, encoding="utf-8")
    (folder / "only_simulators.py").write_text(PLUGIN, encoding="utf-8")
    names = [f"nengo.tests.test_{module}" for module in MODULES]
    command = [str(python), "-m", "pytest", "-p", "only_simulators", "-p", "no:cacheprovider"]
    subprocess.run(
        [*command, "-W", "ignore", "--tb=no", "-q", "--pyargs", *names],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), str(folder)])},
        capture_output=True,
        check=False,
    )
    rows = map(json.loads, (folder / "results.jsonl").read_text(encoding="utf-8").splitlines())
    return {f"{module}: {name}": outcome for module, name, outcome in rows}


def page(counts: dict[str, list[int]], failures: dict[str, str]) -> str:
    """The section of the page, of the counts of each module and the reasons of failures."""
    passed, total = (sum(each[i] for each in counts.values()) for i in (0, 1))
    text = f"{passed} of {total} pass.\n\n| module | pass | of |\n|---|---|---|\n"
    text += "".join(f"| {module} | {each[0]} | {each[1]} |\n" for module, each in counts.items())
    text += "\n| fails | because |\n|---|---|\n"
    return text + "".join(f"| {name} | {reason} |\n" for name, reason in failures.items())


def written() -> str:
    """The section that the page has."""
    return PAGE.read_text(encoding="utf-8").partition(BEGIN)[2].partition(END)[0]


def test_the_page_shows_the_file() -> None:
    known = json.loads(FAILURES.read_text(encoding="utf-8"))
    assert written() == page(known["counts"], known["failures"])
    assert all(known["failures"].values()), "each failure has a reason"
    assert sum(passed for passed, _ in known["counts"].values()) >= WANTED


@pytest.mark.slow
@pytest.mark.timeout(3600)
def test_nengos_tests_pass_with_our_simulator_but_for_those_listed(tmp_path: Path) -> None:
    pytest.importorskip("nengo")
    found = results(tmp_path)
    if found is None:
        pytest.skip(f"pip cannot install {', '.join(NEEDED)}")
    failed = {name for name, outcome in found.items() if outcome == "failed"}
    known = json.loads(FAILURES.read_text(encoding="utf-8"))
    assert failed <= set(known["failures"])
    assert Counter(found.values())["passed"] >= WANTED


def main() -> None:
    """Run them, and write the file and the page; a failure without a reason has ''."""
    with tempfile.TemporaryDirectory() as folder:
        found = results(Path(folder))
    if found is None:
        raise SystemExit(f"pip cannot install {', '.join(NEEDED)}")
    save(found)


def save(found: dict[str, str]) -> None:
    """Write what was found, with the reasons that are known."""
    known = (
        json.loads(FAILURES.read_text(encoding="utf-8"))["failures"] if FAILURES.exists() else {}
    )
    failures = {n: known.get(n, "") for n, o in sorted(found.items()) if o == "failed"}
    counts = {
        module: [
            sum(n.startswith(f"{module}: ") and o == "passed" for n, o in found.items()),
            sum(n.startswith(f"{module}: ") for n in found),
        ]
        for module in MODULES
    }
    text = json.dumps({"counts": counts, "failures": failures}, indent=1) + "\n"
    FAILURES.write_text(text, encoding="utf-8")
    before, _, rest = PAGE.read_text(encoding="utf-8").partition(BEGIN)
    after = rest.partition(END)[2]
    PAGE.write_text(before + BEGIN + page(counts, failures) + END + after, encoding="utf-8")


if __name__ == "__main__":
    main()
