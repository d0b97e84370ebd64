"""Ask where the spiking adaptive term helps, and write docs/ablation.md.

python -m tests.studies.ablation [--seeds 20..39] [--folder DIR] [-j 2]

Seeds are those of the experiments if not given. What the folder holds is not run again.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

from runtime.document.node import parse_yaml
from runtime.errors import Problems
from runtime.experiments.design.seeds import Seeds, parse_seeds
from tests.studies.ablation.judge import Judged
from tests.studies.ablation.page import page
from tests.studies.ablation.runs import CONFIGURATIONS, RULES, measure
from tests.studies.following import WORKERS

PAGE = Path(__file__).parents[3] / "docs" / "ablation.md"


def main() -> None:
    """Run what the folder does not hold yet; write and print the page."""
    parser = argparse.ArgumentParser(prog="python -m tests.studies.ablation")
    parser.add_argument("--seeds", help="such as 20..39; those of the experiments if not given")
    parser.add_argument("--folder", help="keeps the runs, so that a second call continues")
    parser.add_argument("-j", "--jobs", type=int, default=WORKERS, help="processes")
    options = parser.parse_args()
    seeds = read_seeds(options.seeds) if options.seeds else None
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(options.folder or scratch)
        folder.mkdir(parents=True, exist_ok=True)
        results = {}
        for configuration in CONFIGURATIONS:
            for rule in RULES:
                print(f"{configuration.label}, {rule}", file=sys.stderr, flush=True)
                results[configuration, rule] = measure(
                    configuration, rule, folder, seeds, jobs=options.jobs
                )
    text = page(Judged(results), Judged(results, "t"))
    PAGE.write_text(text, encoding="utf-8")
    print(text)


def read_seeds(text: str) -> Seeds | None:
    """Seeds as the command line writes them: 20..39."""
    problems = Problems()
    seeds = parse_seeds(parse_yaml(text, "seeds"), "", problems)
    problems.raise_any()
    return seeds


if __name__ == "__main__":
    main()
