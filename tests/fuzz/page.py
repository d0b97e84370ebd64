"""docs/reliability.md, from the recorded results of campaigns."""

from __future__ import annotations

import importlib
import json
import pkgutil
from pathlib import Path
from types import ModuleType
from typing import Any

import tests.fuzz
from tests.fuzz.campaign import Record
from tests.fuzz.known import KNOWN

RESULTS = Path(__file__).with_name("results.json")
PAGE = Path(__file__).parents[2] / "docs" / "reliability.md"
HEAD = """# Reliability

What was tried on spikeblocks with random input, how often, and what came out. This page is written
by `python -m tests.fuzz --page` from the results in `tests/fuzz/results.json`; no figure is typed.
The test suite tries a smaller number of each on every run. A campaign is repeated, with the same
examples, by the command under its heading; `--record` puts its result here.

"Failures" counts different faults that were found, each with the smallest example that shows it.
"""


def subjects() -> dict[str, ModuleType]:
    """Every module of this package that has a function ``run(examples, seed)``, by name."""
    names = [found.name for found in pkgutil.iter_modules(tests.fuzz.__path__)]
    skipped = ("__main__", "test_")
    modules = {
        name: importlib.import_module(f"tests.fuzz.{name}")
        for name in names
        if not name.startswith(skipped)
    }
    return {name: module for name, module in modules.items() if hasattr(module, "run")}


def remember(record: Record) -> None:
    """Put a campaign's result in the place of the subject's last one."""
    results = recorded()
    results[record.subject] = {
        "examples": record.examples,
        "seed": record.seed,
        "outcomes": dict(sorted(record.outcomes.items())),
        "failures": len(record.failures),
    }
    text = json.dumps(results, indent=2, sort_keys=True) + "\n"
    RESULTS.write_text(text, encoding="utf-8")


def recorded() -> dict[str, Any]:
    """The last result of each subject."""
    found: dict[str, Any] = json.loads(RESULTS.read_text(encoding="utf-8"))
    return found


def page() -> str:
    """The page's text."""
    results = recorded()
    rows = ["| subject | examples | failures |", "|---|---:|---:|"]
    sections = []
    for name, module in subjects().items():
        title = getattr(module, "TITLE", name.replace("_", " ").capitalize())
        result = results.get(name)
        if result is None:
            rows.append(f"| {title} | none recorded | |")
        else:
            rows.append(f"| {title} | {result['examples']:,} | {result['failures']} |")
        sections.append(_section(name, title, module, result))
    if KNOWN:
        sections += ["## Not tried yet", "", "Faults that are known are kept away from:", ""]
        sections += [*(f"* {text}" for text in KNOWN.values()), ""]
    return "\n".join([HEAD, *rows, "", *sections])


def _section(name: str, title: str, module: ModuleType, result: dict[str, Any] | None) -> str:
    what = getattr(module, "WHAT", (module.__doc__ or "").strip().splitlines()[0])
    lines = [f"## {title}", "", f"Tried: {what}", ""]
    if hasattr(module, "HOLDS"):
        lines += [f"What must hold: {module.HOLDS}", ""]
    if result is None:
        return "\n".join([*lines, f"    python -m tests.fuzz {name}", ""])
    command = f"python -m tests.fuzz {name} --examples {result['examples']} --seed {result['seed']}"
    lines += [f"    {command}", "", "| outcome | times |", "|---|---:|"]
    lines += [f"| {outcome} | {count:,} |" for outcome, count in result["outcomes"].items()]
    return "\n".join([*lines, f"| different failures | {result['failures']} |", ""])
