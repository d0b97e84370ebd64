"""The study of docs/comparison.md: ``python -m tests.studies.comparison COMMAND``.

``power`` tells how many conditions the margin asks for; ``run TASK...`` runs what has no row yet (a
study that was interrupted continues); ``gather`` writes the rows to docs/study; ``costs`` measures
what each contestant needs as C; ``coverage`` simulates how often the intervals hold the truth;
``check`` compares plan, commits and rows; ``page`` writes docs/comparison.md from the rows.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from runtime.cli import run as command
from tests.studies.comparison import costs, judge, plan, register, rows

COMMANDS = ("power", "run", "gather", "costs", "coverage", "check", "page")
POWER, END = "<!-- power, generated -->", "<!-- end -->"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("command", choices=COMMANDS)
    parser.add_argument("tasks", nargs="*", default=list(plan.read()["tasks"]))
    parser.add_argument("-j", "--jobs", type=int, default=1)
    parser.add_argument(
        "--only", nargs="*", help="run these contestants, in this order, even if they have rows"
    )
    parser.add_argument("--out", type=Path, default=Path("contests"))
    options = parser.parse_args()
    if options.command == "power":
        text = plan.TEXT.read_text(encoding="utf-8")
        before, rest = text.split(POWER)
        table = f"{POWER}\n{judge.power_table()}\n{END}"
        plan.TEXT.write_text(before + table + rest.split(END, 1)[1], encoding="utf-8")
    if options.command == "coverage":
        judge.write_coverage()
    if options.command == "costs":
        costs.measure()
    if options.command == "check":
        problems = register.problems()
        print("\n".join([*problems, *register.told()]))
        return 1 if problems else 0
    if options.command == "page":
        from tests.studies.comparison import page

        page.write()
    for task in options.tasks:
        if options.command == "run":
            register.require()
            # One after the other, so that what has been run is complete wherever it is interrupted.
            for name in options.only or plan.read()["tasks"][task]["contestants"]:
                if not options.only and task in rows.tasks() and rows.is_complete(task, name):
                    continue
                file = plan.write(task, options.out / "files", name)
                where = ["-j", str(options.jobs), "--out", str(options.out)]
                code = command(["contest", str(file), *where, "--resume", "--no-plots", "-q"])
                if code not in (0, 3):
                    return code
        if options.command == "gather":
            print(rows.gather(task, options.out / task))
    return 0


if __name__ == "__main__":
    sys.exit(main())
