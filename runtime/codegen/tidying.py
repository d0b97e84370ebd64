"""Lines of C without what is never read."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence

DECLARED = re.compile(r"^( *)(?:const )?\w+ (?:\*?(?:const )?)?\*?(\w+) = (.*);$")
ASSIGNED = re.compile(r"^( *)(\w+) = (.*);$")


def tidied(lines: Sequence[str]) -> list[str]:
    """Lines without variables that are never read; calls for their effects stay."""
    kept = list(lines)
    while True:
        times = Counter(re.findall(r"(?<!->)\b\w+", "\n".join(kept)))
        matches = [DECLARED.match(line) or ASSIGNED.match(line) for line in kept]
        writes = Counter(match.group(2) for match in matches if match)
        found = []
        for line, match in zip(kept, matches, strict=True):
            if match is None or times[match.group(2)] > writes[match.group(2)]:
                found.append(line)
            elif "(" in match.group(3):
                found.append(f"{match.group(1)}(void){match.group(3)};")
        if found == kept:
            return found
        kept = found
