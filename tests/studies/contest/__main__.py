"""Run the contest and write docs/comparison.md: ``python -m tests.studies.contest --trials 40``.

A run that was interrupted continues; contestants that are complete are not run again.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from runtime.cli import run
from tests.studies.contest import one_setting
from tests.studies.contest.contestants import CONTESTANTS, LIMITS, file_of, write
from tests.studies.contest.page import draw, page
from tests.studies.contest.results import read

DOCS = Path(__file__).parents[3] / "docs"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trials", type=int, default=40, help="of each contestant (40)")
    parser.add_argument("-j", "--jobs", type=int, default=1)
    parser.add_argument("--out", type=Path, default=Path("tunings/contest"))
    parser.add_argument("--only", nargs="*", default=list(CONTESTANTS), help="these contestants")
    parser.add_argument("--limits", nargs="*", default=list(LIMITS), choices=LIMITS)
    parser.add_argument("--files", action="store_true", help="write the experiment files only")
    parser.add_argument("--page", action="store_true", help="write the page from what is there")
    options = parser.parse_args()
    write()
    if options.files:
        return 0
    if not options.page:
        for limit in options.limits:
            for name in options.only:
                print(f"== {limit}: {name}", flush=True)
                code = _tune(name, limit, options)
                if code not in (0, 3):
                    return code
    found = {limit: read(options.out, limit) for limit in LIMITS}
    draw(found, DOCS / "images" / "comparison.png")
    if not options.page:
        one_setting.tuned(options.out, options.jobs)
    text = page(found, one_setting.section(options.out))
    (DOCS / "comparison.md").write_text(text, encoding="utf-8")
    return 0


def _tune(name: str, limit: str, options: argparse.Namespace) -> int:
    code: int = run(
        [
            *("tune", str(file_of(name, limit)), "--trials", str(options.trials)),
            *("-j", str(options.jobs), "--resume"),
            *("--out", str(options.out), "--no-plots", "-q"),
        ]
    )
    return code


if __name__ == "__main__":
    sys.exit(main())
