"""Equations of the reference: nothing of a docstring is lost or changed when they become MathML."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET

import pytest

from blocks.library.registry import BUILTIN
from docs.equations import ALWAYS, FUNCTIONS, GREEK, LEFT, pieces

LETTERS = {value: key for key, value in GREEK.items()}
SIGNS = {"−": "-", "·": "", "×": "x", "≤": "<=", "≥": ">=", "…": "...", "∑": "sum", "^": "hat"}
PRIMES = {"′": "'", "″": "''", "‴": "'''"}


def blocks_with_text() -> list[tuple[str, str, set[str]]]:
    found = []
    for name, cls in sorted(BUILTIN.items()):
        names = {*cls.spec.inputs, *cls.spec.outputs, *cls.spec.params, *cls.spec.states}
        parts = (cls.__doc__ or "").replace("``", "").split("\n\n")
        found += [(name, " ".join(part.split()), names) for part in parts if "─" not in part]
    return found


def leaves(math: str) -> list[tuple[str, str]]:
    root = ET.fromstring(f"<span>{math}</span>".replace("<wbr>", "<wbr/>"))
    return [(e.tag, e.text or "") for e in root.iter() if e.tag in ("mi", "mn", "mo")]


def plain(text: str) -> str:
    """What an equation and its MathML have in common: letters, numbers, relations and signs."""
    return re.sub(r"[\s()/*^_|@]|(?<= )\.(?= )", "", text)


def test_all_of_a_text_is_there_in_order() -> None:
    for name, text, names in blocks_with_text():
        assert "".join(source for source, _ in pieces(text, names)) == text, name


def test_equations_have_the_letters_and_signs_of_their_text() -> None:
    count = 0
    for name, text, names in blocks_with_text():
        for source, math in pieces(text, names):
            if not math:
                continue
            count += 1
            shown = "".join(
                LETTERS.get(t) or SIGNS.get(t) or PRIMES.get(t, "" if t == "·" else t)
                for _, t in leaves(math)
            )
            # A hat is drawn over its letter and written behind it, as the dot of a product is not.
            assert plain(shown) == plain(source.replace(" . ", " ")), (name, source)
    # Few have none that can be read; were words refused by mistake, there would be far fewer.
    assert count > 240


def test_no_word_of_a_sentence_is_taken_for_a_symbol() -> None:
    for name, text, names in blocks_with_text():
        known = {*names, *FUNCTIONS, *ALWAYS, *LEFT.findall(text)}
        for source, math in pieces(text, names):
            if math:
                words = [
                    t for tag, t in leaves(math) if tag == "mi" and re.fullmatch(r"[a-z]{3,}", t)
                ]
                # Below the line is an index, such as that of tau_syn.
                words = [w for w in words if f"_{w}" not in source and f"_{w}_" not in source]
                assert set(words) <= known, (name, source)


@pytest.mark.parametrize(
    ("text", "equations"),
    [
        ("With theta = 0 upright, m x'' = force.", ["theta = 0", "m x'' = force"]),
        ("The heading e_theta = wrap(a - b), so", ["e_theta = wrap(a - b)"]),
        ("J = 2 (see chapter 3) for a run", ["J = 2"]),
        ("out = the sum of squares", []),
        ("x = y a constant", []),
        ("x = dh/dx there", []),
        ("x = 1 +- 2", []),
        ("(of 1 = 1, say)", ["1 = 1"]),
    ],
)
def test_where_an_equation_ends(text: str, equations: list[str]) -> None:
    assert [source for source, math in pieces(text, {"heading", "force"}) if math] == equations


def test_fractions_powers_and_products() -> None:
    (_, math), *_ = pieces("y = a / (b + c)", ())
    assert "<mfrac><mrow><mi>a</mi></mrow><mrow><mi>b</mi>" in math and "(" not in math
    (_, math), *_ = pieces("y = a / b c", ())
    assert "mfrac" not in math  # what follows would read as being outside of the fraction
    (_, math), *_ = pieces("M = omega x J omega", ())
    assert "<mo>×</mo><mi>J</mi>" in math
    (_, math), *_ = pieces("y = x^2", ())
    assert "<msup><mi>x</mi><mrow><mn>2</mn></mrow></msup>" in math
    (_, math), *_ = pieces("x(t_k+1) = d_hat", ())
    assert "<mi>k</mi><mo>+</mo><mi>1</mi>" in math and "<mover>" in math
