"""Equations in the reference of blocks as MathML, which browsers show without a library.

In: the text of a docstring and the names that the block declares. Out: pieces of text and MathML::

    "With theta = 0 upright, m x'' = force - k x."
    ->  "With ", <math>θ = 0</math>, " upright, ", <math>m x″ = force − k x</math>, "."

There is one source, the docstring. What is not certainly an equation stays text: an equation is a
relation between two expressions of numbers, letters, Greek letters by name, names that the block
declares, and functions; any other word ends it.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator

GREEK_NAMES = (
    "alpha beta gamma delta epsilon zeta eta theta iota kappa lambda mu nu xi pi rho sigma tau phi "
    "chi psi omega"
)
GREEK = dict(zip(GREEK_NAMES.split(), "αβγδεζηθικλμνξπρστφχψω", strict=True))
# At the start of an element, browsers take a sign for that of a number.
INFIX = '<mo form="infix">'
PRIMES = {1: "′", 2: "″", 3: "‴"}
ALWAYS = frozenset({"dt"})
FUNCTION_NAMES = "sin cos tan atan atan2 exp log log1p sqrt min max abs wrap round diag"
FUNCTIONS = frozenset(FUNCTION_NAMES.split())
RELATIONS = {"=": "=", "<=": "≤", ">=": "≥", "<": "&lt;", ">": "&gt;", "+=": "+=", "-=": "-="}
SIGNS = {"+": "+", "-": "−"}
# A word with a relation after it is a name, as "keep" in "keep = exp(-leak dt)".
LEFT = re.compile(r"\b([a-z]{2,})(?:\([^ ()]*\))?'* [+-]?= ")
TOKEN = re.compile(
    r"(?P<space> +)|(?P<number>\d+(?:\.\d+)?(?![\w.]*[A-Za-z_]))|"
    r"(?P<name>[A-Za-z][A-Za-z0-9]*(?:_(?:[A-Za-z0-9]+_?)+(?:[+-]1)?)?)|(?P<primes>'{1,3})|"
    r"(?P<mark>\+=|-=|<=|>=|\.\.\.|\.(?= \w)|[-+*/^=<>()|,@\[\]])"
)


class _NotAnEquation(Exception):  # noqa: N818 -- no error
    pass


class _Reader:
    """Reads one equation from a position; every method returns MathML and moves on."""

    def __init__(self, text: str, names: Collection[str], at: int) -> None:
        self.text, self.names, self.at = text, names, at

    def peek(self) -> tuple[str, str, int, bool]:
        """The kind of the next token, itself, where it ends, and whether a space is before it."""
        at, spaced = self.at, False
        while True:
            match = TOKEN.match(self.text, at)
            if match is None:
                return "", "", at, spaced
            if match.lastgroup != "space":
                return str(match.lastgroup), match[0], match.end(), spaced
            at, spaced = match.end(), True

    def take(self, *marks: str) -> str:
        kind, token, end, _ = self.peek()
        if kind != "mark" or token not in marks:
            return ""
        self.at = end
        return token

    def expect(self, mark: str) -> None:
        if not self.take(mark):
            raise _NotAnEquation

    def equation(self) -> list[str]:
        """The sides, each later one with its relation before it."""
        pieces = self.sum()
        relations = 0
        while True:
            before = self.at
            relation = self.take(*RELATIONS)
            if not relation:
                break
            try:
                first, *rest = self.sum()
            except _NotAnEquation:
                self.at = before
                raise
            pieces += [f"{INFIX}{RELATIONS[relation]}</mo>{first}", *rest]
            relations += 1
        if not relations:
            raise _NotAnEquation
        return pieces

    def sum(self) -> list[str]:
        """The terms, each with its sign."""
        sign = self.take(*SIGNS)
        pieces = [(f"<mo>{SIGNS[sign]}</mo>" if sign else "") + self.term()]
        while sign := self.take(*SIGNS):
            pieces.append(f"{INFIX}{SIGNS[sign]}</mo>{self.term()}")
        return pieces

    def term(self) -> str:
        """Factors beside each other, a product or a quotient."""
        done = self.factor()
        while True:
            if self.take("/"):
                below = self.factor()
                done, more = f"{done}<mo>/</mo>{below}", self.starts_factor()
                if not more:
                    above = done.removesuffix(f"<mo>/</mo>{below}")
                    done = f"<mfrac><mrow>{_bare(above)}</mrow><mrow>{_bare(below)}</mrow></mfrac>"
            elif self.take("*"):
                done += f"<mo>·</mo>{self.factor()}"
            elif self.peek()[1] == "." and self.peek()[3]:
                self.take(".")
                done += f"<mo>·</mo>{self.factor()}"
            elif self.take("@"):
                done += f"<mspace width='0.17em'/>{self.factor()}"
            elif self.starts_factor():
                done += f"<mspace width='0.17em'/>{self.beside()}"
            else:
                return done

    def beside(self) -> str:
        """A factor; an x between two factors is a cross product."""
        kind, token, end, spaced = self.peek()
        if kind == "name" and token == "x" and spaced and self.text[end : end + 1] == " ":
            before, self.at = self.at, end
            if self.starts_factor() and self.peek()[1] != "(":
                return "<mo>×</mo>" + self.factor()
            self.at = before
        return self.factor()

    def starts_factor(self) -> bool:
        """Whether a factor follows that can be read; a parenthesis may be one of the sentence."""
        kind, token, _, _ = self.peek()
        if kind == "mark" and token in ("(", "|", "..."):
            before = self.at
            try:
                self.factor()
            except _NotAnEquation:
                return False
            finally:
                self.at = before
            return True
        return kind == "number" or (kind == "name" and self.knows(token))

    def knows(self, name: str) -> bool:
        stem = name.partition("_")[0]
        short = len(stem) == 1 or stem in GREEK or re.fullmatch(r"[A-Za-z]\d", stem)
        return bool(short) or stem == "sum" or name in FUNCTIONS | ALWAYS or name in self.names

    def factor(self) -> str:
        base = self.atom()
        while True:
            kind, token, end, spaced = self.peek()
            if kind == "primes" and not spaced:
                self.at = end
                # Not as a superscript, which fonts without tables for mathematics raise twice.
                base += f"<mo lspace='0' rspace='0'>{PRIMES[len(token)]}</mo>"
            elif token == "^" and not spaced:
                self.at = end
                sign = self.take("-", "+")
                power = (f"<mo>{SIGNS[sign]}</mo>" if sign else "") + self.atom()
                base = f"<msup>{_row(base)}<mrow>{_bare(power)}</mrow></msup>"
            elif token in ("(", "[") and not spaced and kind == "mark":
                base += self.group()
            else:
                return base

    def atom(self) -> str:
        kind, token, end, _ = self.peek()
        if kind == "number":
            self.at = end
            return f"<mn>{token}</mn>"
        if kind == "name" and self.knows(token):
            self.at = end
            if token in FUNCTIONS | {"sum"} and self.text[end : end + 1] != "(":
                raise _NotAnEquation
            return _name(token, self.names)
        if token == "...":
            self.at = end
            return "<mo>…</mo>"
        if token in ("(", "["):
            return self.group()
        if token == "|":
            self.at = end
            inside = "".join(self.sum())
            self.expect("|")
            return f"<mrow><mo>|</mo>{inside}<mo>|</mo></mrow>"
        raise _NotAnEquation

    def group(self) -> str:
        """What parentheses or brackets hold, with commas between."""
        opening = self.take("(", "[")
        inside = "".join(self.sum())
        while self.take(","):
            inside += "<mo>,</mo>" + "".join(self.sum())
        closing = ")" if opening == "(" else "]"
        self.expect(closing)
        return f"<mrow><mo>{opening}</mo>{inside}<mo>{closing}</mo></mrow>"


def _row(base: str) -> str:
    return base if re.fullmatch(r"<(m\w+)>[^<]*</\1>", base) else f"<mrow>{base}</mrow>"


def _bare(inside: str) -> str:
    """Without the parentheses around all of it, which a fraction or a power does not need."""
    match = re.fullmatch(r"<mrow><mo>\(</mo>(.*)<mo>\)</mo></mrow>", inside)
    if match is None or "<mrow><mo>(</mo>" in match[1] or "<mo>,</mo>" in match[1]:
        return inside
    return match[1]


def _name(token: str, names: Collection[str]) -> str:
    stem, _, below = token.partition("_")
    if stem == "sum":
        return f"<msub><mo>∑</mo><mi>{below}</mi></msub>" if below else "<mo>∑</mo>"
    if not below or (len(stem) > 1 and stem not in GREEK and not re.fullmatch(r"[A-Za-z]\d", stem)):
        digit = re.fullmatch(r"([A-Za-z])(\d)", token)
        if digit and token not in names:
            return f"<msub><mi>{digit[1]}</mi><mn>{digit[2]}</mn></msub>"
        return f"<mi>{GREEK.get(token, token)}</mi>"
    if below == "hat":
        return f"<mover><mi>{GREEK.get(stem, stem)}</mi><mo>^</mo></mover>"
    index = "".join(
        f"<mo>{SIGNS[part]}</mo>" if part in SIGNS else f"<mi>{GREEK.get(part, part)}</mi>"
        for part in re.split(r"([+-])", below)
    )
    return f"<msub><mi>{GREEK.get(stem, stem)}</mi><mrow>{index}</mrow></msub>"


def pieces(text: str, names: Collection[str]) -> Iterator[tuple[str, str]]:
    """The parts of a text in order, each with its MathML, or "" where it is no equation."""
    text = " ".join(text.split())
    names = {*names, *LEFT.findall(text)}
    done = at = 0
    while at < len(text):
        is_start = (at == 0 or text[at - 1] in " (") and not _is_word(text[at:], names)
        if is_start and not re.search(r"[-+*/^=<>@|]\s*$", text[done:at]):
            reader = _Reader(text, names, at)
            try:
                found = reader.equation()
            except _NotAnEquation:
                found = []
            if found and _ends_well(text, at, reader.at):
                if done < at:
                    yield text[done:at], ""
                yield text[at : reader.at], _math(found)
                done = at = reader.at
                continue
        at += 1
    if done < len(text):
        yield text[done:], ""


def _is_word(text: str, names: Collection[str]) -> bool:
    """Whether a text begins with a name of the block as a word: "heading e_theta = ..."."""
    match = re.match(r"([a-z]{4,}) [A-Za-z]", text)
    return match is not None and match[1] in names and match[1] not in GREEK


def _ends_well(text: str, start: int, end: int) -> bool:
    """Whether what follows is a sentence: no operator, and the last word is no article."""
    if re.match(r"\s*(?:[-+*/^=<>@|\[]|\.\.|\(?[a-z]\w*\()|[\w'.(](?!\s|$)", text[end:]):
        return False
    return not re.search(r"\ba$", text[start:end]) or not re.match(r" [a-z]", text[end:])


def _math(parts: list[str]) -> str:
    """One element for each term, so that a line can break before a sign."""
    return "<wbr>".join(f'<math displaystyle="true"><mrow>{part}</mrow></math>' for part in parts)
