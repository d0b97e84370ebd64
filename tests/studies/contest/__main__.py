"""Run the contest and write docs/comparison.md: ``python -m tests.studies.contest --trials 100``.

A run that was interrupted continues; contestants that are complete are not run again.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from runtime.cli import run
from tests.studies.contest import transfer
from tests.studies.contest.contestants import CONTESTANTS, name_of, write
from tests.studies.contest.page import draw, page
from tests.studies.contest.results import read

DOCS = Path(__file__).parents[3] / "docs"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trials", type=int, default=100, help="of each contestant (100)")
    parser.add_argument("--held-out", default="100..104", help="held-out seeds (100..104)")
    parser.add_argument("-j", "--jobs", type=int, default=1)
    parser.add_argument("--out", type=Path, default=Path("tunings/contest"))
    parser.add_argument("--only", nargs="*", default=list(CONTESTANTS), help="these contestants")
    parser.add_argument("--files", action="store_true", help="write the experiment files only")
    parser.add_argument("--page", action="store_true", help="write the page from what is there")
    options = parser.parse_args()
    files = {path.stem: path for path in write()}
    if options.files:
        return 0
    for name in () if options.page else options.only:
        print(f"== {name}", flush=True)
        code = run(
            [
                *("tune", str(files[name_of(name)]), "--trials", str(options.trials)),
                *("--held-out", options.held_out, "-j", str(options.jobs), "--resume"),
                *("--out", str(options.out), "--no-plots", "-q"),
            ]
        )
        if code not in (0, 3):
            return code
    found = read(options.out)
    names = {one.name for one in found}
    draw(found, DOCS / "images" / "comparison.png")
    ours = next((one for one in found if one.name == transfer.OURS), None)
    if ours is not None and not (options.page or (options.out / transfer.FILE).exists()):
        transfer.measure(ours.values, options.out)
    missing = [name for name in CONTESTANTS if name not in names]
    text = page(found, missing, transfer.rows(options.out))
    (DOCS / "comparison.md").write_text(text, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
