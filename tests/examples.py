"""How many random examples a test tries."""

from __future__ import annotations

from typing import Any

from hypothesis import settings


def examples(number: int, **others: Any) -> settings:
    """Hypothesis' settings for a number of examples in the slow run, a quarter of them otherwise.

    A number that ``settings`` is given would be the same in both; ``conftest.py`` has chosen the
    profile, and with it the share, before a test module is imported.
    """
    share = settings.default.max_examples / settings.get_profile("slow").max_examples
    return settings(max_examples=max(4, round(share * number)), **others)
