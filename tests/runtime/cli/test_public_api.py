"""The public interface is what docs/api.txt lists, typed, and no name of it is missing."""

from __future__ import annotations

import inspect
from difflib import unified_diff
from importlib import import_module
from pathlib import Path

import pytest

from docs.public_api import PUBLIC, listing, public_names

STORED = Path(__file__).parents[3] / "docs" / "api.txt"


def test_the_listing_is_that_of_the_code() -> None:
    lines = (STORED.read_text(encoding="utf-8").splitlines(), listing().splitlines())
    changed = list(unified_diff(*lines, "docs/api.txt", "the code", lineterm="", n=0))
    assert not changed, "\n".join(changed) + "\nis the change meant? then: python -m docs.describe"


@pytest.mark.parametrize("module", PUBLIC)
def test_public_names_are_typed_and_documented(module: str) -> None:
    door = import_module(module)
    names = public_names(module)
    assert set(names) <= {*door.__all__} if hasattr(door, "__all__") else True
    for name in names:
        value = getattr(door, name)
        if inspect.isclass(value) or inspect.isfunction(value):
            assert (value.__doc__ or "").strip(), f"{module}.{name} has no documentation"
        if inspect.isfunction(value):
            signature = inspect.signature(value)
            assert signature.return_annotation is not signature.empty, name
            for each in signature.parameters.values():
                assert each.annotation is not each.empty, f"{module}.{name}: {each.name}"
