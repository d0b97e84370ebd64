"""Which texts of a figure are formulas, and plain text for the numbers of its axes.

A figure goes in whose texts are as users wrote them, such as the title "cost $5" or the label
"$e_p$"; afterwards only the latter is drawn as a formula, and 3e-5 at an axis is 3 and ×10⁻⁵.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from matplotlib.mathtext import MathTextParser
from matplotlib.text import Text
from matplotlib.ticker import LogFormatter, ScalarFormatter

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_FORMULA = re.compile(r"\$[^$\s]+\$")


def is_formula(text: str) -> bool:
    """Whether a string has formulas as $e_p$, without spaces, that matplotlib can draw."""
    formulas_in = _FORMULA.findall(text)
    if not formulas_in or text.count("$") != 2 * len(formulas_in):
        return False
    try:
        for formula in formulas_in:
            MathTextParser("path").parse(formula)
    except ValueError:
        return False
    return True


class PlainNumbers(ScalarFormatter):
    """Tick labels in the text's font, with a power of ten as ×10⁻³.

    As formulas, matplotlib's ``use_mathtext``, they take a third of the time of a figure: each
    label is parsed by a grammar.
    """

    def get_offset(self) -> str:
        """The power of ten that all numbers of the axis share; empty if there is none."""
        text = super().get_offset()
        if self.offset or "e" not in text:
            return text
        exponent = int(text.partition("e")[2].replace("\N{MINUS SIGN}", "-"))
        return f"×10{str(exponent).translate(SUPERSCRIPTS)}"


def disable_math(figure: Figure) -> None:
    """Show names and titles as they are written; only $e_p$, without spaces, is a formula.

    Powers of ten beside a logarithmic axis stay formulas, since matplotlib writes them so; those
    of other axes are plain text (:class:`PlainNumbers`).
    """
    for axis in (axis for axes in figure.axes for axis in (axes.xaxis, axes.yaxis)):
        if type(axis.get_major_formatter()) is ScalarFormatter:
            axis.set_major_formatter(PlainNumbers())
    for text in figure.findobj(Text):
        # matplotlib takes two dollar signs for a formula, and stops at one that it cannot parse.
        text.set_parse_math(is_formula(text.get_text()))
    for axis in (axis for axes in figure.axes for axis in (axes.xaxis, axes.yaxis)):
        if isinstance(axis.get_major_formatter(), LogFormatter):
            for tick in axis.get_major_ticks():
                tick.label1.set_parse_math(True)
                tick.label2.set_parse_math(True)
