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

from runtime.engine import silent
from runtime.experiments.design import read_experiment
from runtime.experiments.execution import RunOptions
from runtime.experiments.tuning import contest_plans, run_contest
from runtime.terminal import Progress
from tests.studies.comparison import costs, judge, plan, register, rows

COMMANDS = ("power", "run", "gather", "costs", "coverage", "check", "page")
GENERATED, END = "<!-- {}, generated -->", "<!-- end -->"


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
        for place, table in (("power", judge.power_table()), ("again", judge.power_again("again"))):
            before, rest = text.split(GENERATED.format(place))
            text = f"{before}{GENERATED.format(place)}\n{table}\n{END}{rest.split(END, 1)[1]}"
        plan.TEXT.write_text(text, encoding="utf-8")
    if options.command == "coverage":
        judge.write_coverage()
    if options.command == "costs":
        costs.measure()
    if options.command == "check":
        problems = register.problems()
        print("\n".join([*problems, *register.told(), *register.judged_since()]))
        return 1 if problems else 0
    if options.command == "page":
        from tests.studies.comparison import page

        page.write()
    for task in options.tasks:
        if options.command == "run":
            register.require()
            for name in options.only or plan.read()["tasks"][task]["contestants"]:
                if not options.only and task in rows.tasks() and rows.is_complete(task, name):
                    continue
                code = _run(task, name, options)
                if code:
                    return code
        if options.command == "gather":
            print(rows.gather(task, options.out / task))
    return 0


def _quiet(name: str) -> Progress:
    return Progress(name, wanted=False)


def _run(task: str, name: str, options: argparse.Namespace) -> int:
    """Tune a contestant and judge it, or only judge what another task's tunings entered.

    One contestant after the other, so that what has been run is complete wherever it is
    interrupted.
    """
    tuned = plan.read()["tasks"][task].get("tuned")
    numbers = range(plan.tunings(task, name)) if tuned else (None,)
    for tuning in numbers:
        values = None if tuning is None else rows.entered(tuned, name, tuning)
        file = plan.write(task, options.out / "files", name, values, tuning)
        experiment = read_experiment(str(file))
        to = RunOptions(options.out / task, resume=True, jobs=options.jobs)
        if run_contest(task, contest_plans(experiment, silent), to, _quiet).is_interrupted:
            return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())
