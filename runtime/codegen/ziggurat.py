"""The tables of the ziggurat, as NumPy has them: computed, then corrected by its rounding.

In go the edge of the last layer and the area of each, out come 256 limits ``k``, widths ``w`` and
heights ``f`` (Marsaglia and Tsang, The ziggurat method for generating random variables, 2000). With
``x[255] = r``, the layers below follow from equal areas v:

    f(x[i]) = v / x[i + 1] + f(x[i + 1]),   w = x / m,   k[i] = m x[i - 1] / x[i]

They are computed with 40 digits. NumPy's were computed in double precision from the top layer down,
so that theirs differ in the last bits: by how many units, the letters below tell, ``m`` for none,
``n`` for one more. Without them one draw in about 1e13 would be another one.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from decimal import Decimal, localcontext
from functools import cache
from pathlib import Path

DIGITS, LAYERS = 40, 256
Curve = Callable[[Decimal], Decimal]
NORMAL_W = (
    "blmkjhfhgijjkkkjjijihhhghiijhhhiihiihhiijkjjkjjjjjjikkjjjjjjkjkkkkjkjkkjkklkkkjjkkkkjkkl"
    "llllmmmlllmllllllllkklkkklllllllllmmmmlllllllllllklljjjjjjkklklllllmmmnmmlmmmnmmmmnnoppp"
    "poonmnmnmmmmmmmmmmmlmlllklkkkkkkllllmmllmmmmmmmmmmmmmmmmmlllllllmmnnnnnnnnmmnnnm"
)
NORMAL_K = (
    "nmnmmnmnnnnnmnnmnnnmnnmnmnnnnmmnmmmnmmmnnnmmmmnmmmnnmmnnmnmnmmmmnmmnmnmmnmnmmmmmmmmmnnnn"
    "mnmmnnnmmmnmnmmnmmmmmnnmmmmmnmmnmnmmnmmnnnmmmmnmnmmnmmnnmmmmmnnmnmnmmnnmmmnmmnnnnnnmnmmm"
    "nnnmmnnmnmnmnmnnmnnnmmnmmnmmnnmnnnmmmmnnnmnmmnnnmmmmnmnnnmnmmnnmnnnmnmnmnmnnnnmm"
)
NORMAL_F = (
    "mmmmmmmmmmmmmmmmmmmmmmmmnmmmmmmmmmmmmmnmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmnmmmmmlmllmmmmmmnmm"
    "nmlnmmnmmmmmmmmmmmmlmnmmmnmmnmmmmmnmlnmlmmmmlmmmmmnmlmmmmlmnnmnnnnmnnnnmllnnlnlmlmnmnnmm"
    "llmllmmmmlnmmmmmmllonknlknllmlnmonmnmllmnnnmmllmnmlmlnnllmllmonnmlnmmklppjllkllo"
)
EXPONENTIAL_W = (
    "mijlklllmmmmllllmmlmmmmmmmmmmmmmmlmlmmmmmmmmmmmmmmmmmmmllmmmmmmmmmlmmmmmmmmmmmmmmmmmmmmm"
    "mmmlmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmlmmlmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmm"
    "mmmlmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmmm"
)
EXPONENTIAL_K = (
    "kmknmnlllklllmmmmmlnmmllmmmmlllnlmmlmmnkmknlnllmlllmmmmmlmmlmmllmkllmllmmlkkmlmmlmkloknl"
    "mmllmmnnlllmmmlkmlklnllmkmmmkkmlmlmlmlmlmmllllmnlmmmllmmmnkmlllmmknmllklnmllmlllmnmmllml"
    "nllmmmnmlkmmllmkmlnmlmknmlllmlmmmklmmlllnkmkmmmmmnlkmlmlkmlmklmnlmllnlllnlmmkmlm"
)
EXPONENTIAL_F = (
    "mmmmmmmmmmmmmmmmmmlnmmmmmmmmmmlmmmmmmmmmmmmlmmmmmmmmmlmllmmmmmmmmmlmmmmnmmmlmmnmmnmmmmnm"
    "nmlmmmnnmmlmnmmlmlllnnmmmmnnmmmmmmmmmlnmmlmmmlmnmmmnmmmmlmmmnmnmmlnmlmkkllllonkmlonmmlnl"
    "nmkllknmmllmmlnmllnnkmkmnnnnmllnnlnlmnmmnlmlmllnllllmmnnmooomjmoklllololnkmnklop"
)


def template() -> str:
    """C text of PCG64 and of the draws from it, without the tables."""
    return (Path(__file__).parent / "draws.h").read_text(encoding="utf-8")


@cache
def draws_text() -> str:
    """C text of PCG64 and of the draws from it, with the tables."""
    text = template()
    with localcontext() as context:
        context.prec = DIGITS
        normal = _tables(
            r="3.6541528853610088",
            area="0.0049286732339746557",
            bits=52,
            curve=lambda x: (-x * x / 2).exp(),
            inverse=lambda y: (-2 * y.ln()).sqrt(),
            corrections=(NORMAL_W, NORMAL_K, NORMAL_F),
        )
        exponential = _tables(
            r="7.69711747013104972",
            area="0.0039496598225815571993",
            bits=53,
            curve=lambda x: (-x).exp(),
            inverse=lambda y: -y.ln(),
            corrections=(EXPONENTIAL_W, EXPONENTIAL_K, EXPONENTIAL_F),
        )
    tables = []
    for name, (w, k, f) in (("normal", normal), ("exponential", exponential)):
        tables += [_array(f"double {name}_w", w), _array(f"uint64_t {name}_k", k)]
        tables.append(_array(f"double {name}_f", f))
    return text.replace("@tables@\n", "\n".join(tables))


def _tables(
    r: str, area: str, bits: int, curve: Curve, inverse: Curve, corrections: tuple[str, str, str]
) -> tuple[list[float], list[int], list[float]]:
    """Widths, limits and heights of the layers."""
    v, m = Decimal(area), Decimal(2) ** bits
    x = [Decimal(r)]
    for _ in range(LAYERS - 2):
        x.append(inverse(v / x[-1] + curve(x[-1])))
    x.append(v / curve(x[0]))  # the base: as wide as a rectangle of its area with its tail
    more_w, more_k, more_f = ([ord(letter) - ord("m") for letter in text] for text in corrections)
    w = [_moved(float(each / m), units) for each, units in zip(reversed(x), more_w, strict=True)]
    edges = [Decimal(each) * m for each in w]
    inside = [Decimal(r) / edges[0], Decimal(0)]
    inside += [edges[i - 1] / edges[i] for i in range(2, LAYERS)]
    k = [int(share * m) + units for share, units in zip(inside, more_k, strict=True)]
    heights = [1.0, *(float(curve(edge)) for edge in edges[1:])]
    f = [_moved(each, units) for each, units in zip(heights, more_f, strict=True)]
    return w, k, f


def _moved(number: float, units: int) -> float:
    """A number, so many units in its last place further up."""
    return number + units * math.ulp(number)


def _array(head: str, items: list[float] | list[int]) -> str:
    texts = [f"{each!r}," if isinstance(each, float) else f"UINT64_C({each})," for each in items]
    rows = [" ".join(texts[i : i + 4]) for i in range(0, LAYERS, 4)]
    return f"static const {head}[{LAYERS}] = {{\n    " + "\n    ".join(rows) + "\n};\n"
