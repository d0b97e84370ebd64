"""Try many examples of one subject, or write docs/reliability.md from what was recorded.

python -m tests.fuzz SUBJECT --examples N --seed S [--record]
python -m tests.fuzz --page
"""

from __future__ import annotations

import argparse
import sys
import warnings

from tests.fuzz.page import PAGE, page, remember, subjects


def main() -> int:
    """Returns 1 if something failed."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("subject", nargs="?", choices=sorted(subjects()))
    parser.add_argument("--examples", type=int, default=100, help="how many to try (100)")
    parser.add_argument("--seed", type=int, default=0, help="what they are drawn from (0)")
    parser.add_argument("--record", action="store_true", help="put the result on the page")
    parser.add_argument("--page", action="store_true", help=f"write {PAGE.name}")
    options = parser.parse_args()
    failed = False
    if options.subject:
        warnings.simplefilter("error")  # as in the tests
        record = subjects()[options.subject].run(options.examples, options.seed)
        print(record.line())
        for failure in record.failures:
            print(failure, file=sys.stderr)
        failed = bool(record.failures)
        if options.record:
            remember(record)
    if options.page or options.record:
        PAGE.write_text(page(), encoding="utf-8")
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
