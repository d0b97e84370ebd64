"""Run the contest and write docs/comparison.md: ``python -m tests.studies.contest``.

A run that was interrupted continues; what is complete is not run again.
"""

from __future__ import annotations

import argparse
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path

from runtime.cli import run
from tests.studies.contest import one_setting, weaknesses
from tests.studies.contest.contestants import (
    FRONT,
    FRONTS,
    LIMITS,
    TASKS,
    TRIALS,
    file_of,
    name_of,
    write,
)
from tests.studies.contest.page import page
from tests.studies.contest.picture import draw
from tests.studies.contest.results import DOUBLED, Contest

DOCS = Path(__file__).parents[3] / "docs"
PARTS = ("limits", "doubled", "fronts", "one_setting", "weaknesses")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("parts", nargs="*", default=PARTS, help=f"of {', '.join(PARTS)}; all")
    parser.add_argument("-j", "--jobs", type=int, default=1)
    parser.add_argument("--out", type=Path, default=Path("tunings/contest"))
    parser.add_argument("--only", nargs="*", help="these contestants")
    parser.add_argument("--limits", nargs="*", default=LIMITS, choices=LIMITS)
    parser.add_argument("--files", action="store_true", help="write the experiment files only")
    parser.add_argument("--page", action="store_true", help="write the page from what is there")
    options = parser.parse_args()
    write()
    if options.files:
        return 0
    if not options.page:
        for title, arguments in _tunings(options):
            print(f"== {title}", flush=True)
            code = run(["tune", *arguments, "-j", str(options.jobs), *QUIETLY])
            if code not in (0, 3):
                return code
        if "one_setting" in options.parts:
            one_setting.tuned(options.out, options.jobs)
        if "weaknesses" in options.parts:
            weaknesses.measure(options.out)
    contest = Contest(options.out)
    text = page(contest)
    draw(text, DOCS / "images" / "comparison.png")
    (DOCS / "comparison.md").write_text(text, encoding="utf-8")
    return 0


QUIETLY = ("--resume", "--no-plots", "-q")


def _tunings(options: argparse.Namespace) -> Iterator[tuple[str, list[str]]]:
    """A title and the arguments of each tuning that was asked for."""
    pairs = [
        (limit, name)
        for limit in options.limits
        for name in TASKS[limit].contestants
        if options.only is None or name in options.only
    ]
    if "limits" in options.parts:
        for limit, name in pairs:
            yield f"{limit}: {name}", _arguments(name, limit, options.out)
    if "doubled" in options.parts:
        for limit, name in pairs:
            own = f"{limit}_{name_of(name)}"
            if not (options.out / own).exists():
                continue
            if not (options.out / DOUBLED / own).exists():
                shutil.copytree(options.out / own, options.out / DOUBLED / own)
            yield f"{limit}, doubled: {name}", _arguments(name, limit, options.out / DOUBLED, 2)
    if "fronts" in options.parts:
        for name in FRONTS:
            if options.only is None or name in options.only:
                yield f"front: {name}", _arguments(name, FRONT, options.out)


def _arguments(name: str, limit: str, out: Path, times: int = 1) -> list[str]:
    return [str(file_of(name, limit)), "--trials", str(times * TRIALS), "--out", str(out)]


if __name__ == "__main__":
    sys.exit(main())
