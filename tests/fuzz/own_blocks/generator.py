"""Random programs: methods of own blocks, made of forms.

The forms are in text files beside this one: expressions by type, statements, statements that record
something (``records``), those that use memory beside the declared states (``memory``), and whole
programs that are tried first (``directed``). In a form, ``{f}`` stands for an expression of a type:

    f, F   a float of Python, a number of NumPy (float64)
    i, I   an integer of Python, of NumPy (int64)
    b, B   a bool of Python, of NumPy
    A, M   arrays of floats, of shapes (4,) and (2, 3)
    K, Q   arrays of shape (4,): of integers, of bools
    s      any number; S: any of f and F; e: any array of shape (4,)

``{c}`` is one name within the form, often that of a variable that there is; ``{n}`` a small
integer, ``{d}`` an index of four elements, ``{k}`` a place of the record ``r``. ``{new_f}`` is a
local variable of that type, defined from there on, ``{set_f}`` one that there is, ``{loop_i}`` one
of a loop, and ``{body}`` stands for statements.

A form that begins with ``~`` is recorded only, since NumPy may round otherwise than C does. One
that begins with ``?`` is not expected to compile; a third of the programs has such.
"""

from __future__ import annotations

import ast
import random
import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path


def _forms(name: str) -> str:
    return Path(__file__).with_name(f"{name}.txt").read_text(encoding="utf-8").strip()


def _by_type(text: str) -> dict[str, list[str]]:
    sections = [part.strip().split("\n") for part in text.split("\n## ")[1:]]
    return {kind: forms for kind, *forms in sections}


HOLE = re.compile(r"\{\{|\}\}|\{(\w+)\}")
OPERATORS = (ast.BinOp, ast.BoolOp, ast.Compare, ast.UnaryOp, ast.IfExp)
EXPRESSIONS = _by_type(_forms("expressions"))
STATEMENTS, RECORDS, DIRECTED, MEMORY = (
    _forms(name).split("\n\n") for name in ("statements", "records", "directed", "memory")
)
# What writes into a state, in a form that an output has no use for.
WRITES = re.compile(r"^ *(np\.\w+\()?state\.|changed|swapped|= state|in state\.g", re.MULTILINE)
# What changes memory that all runs share.
SHARED = re.compile(r"bumped|summed|counted")
ANY = {"s": "fffFFiiIbB", "S": "fF", "e": "AAKQ"}
LITERALS = ("0.0", "1.0", "-1.0", "0.5", "2.5", "-0.75", "3.0", "1.5", "1e308", "2", "-0.0", "8.0")
NAMES = {
    **{"f": ("a", "b", "y"), "F": ("p", "q"), "i": ("j", "k"), "I": ("i", "m"), "b": ("ok", "on")},
    **{"B": ("yes", "no"), "A": ("u", "w"), "M": ("g", "e"), "K": ("ks", "at"), "Q": ("mask",)},
}
CLASHES = ("x", "a", "b", "y", "t", "i", "z", "j")
# What only some statements of a random program have, so that their faults do not hide others.
FIRST = {
    "ordinary": (0.5, -2.0, 1.0, 3.0),
    "special": (float("nan"), float("inf"), -0.0, 2.0),
}
BEGIN = 0.015


@dataclass(frozen=True)
class Program:
    """The statements of one method.

    method : ``update``, which writes into the state r, or ``output``, which returns a new array r.
    begin : time (s) from which they run: the tick after the first, which Python runs, or the first.
    first : what the state h begins with.
    loose : whether NumPy's functions round otherwise than C's in what is written into r.
    """

    name: str
    statements: tuple[str, ...]
    method: str = "update"
    begin: float = BEGIN
    first: tuple[float, ...] = FIRST["ordinary"]
    loose: bool = False

    @property
    def text(self) -> str:
        """The block's class."""
        first = [f"if t < state.begin:{LEAVE[self.method]}", RECORD[self.method]]
        body = "\n".join([*first, *self.statements, *END[self.method]])
        inside = "\n".join(f"        {line}" for line in body.split("\n"))
        return (
            f'class {self.name}({BASES[self.method]}):\n    """Random."""\n\n'
            f"    def {self.method}(self, state, t, x, v):\n{inside}\n"
        )

    @property
    def is_shared(self) -> bool:
        """Whether it changes memory that all runs share, so that it cannot be branched."""
        return any(map(SHARED.search, self.statements))

    @property
    def body(self) -> Program:
        """The program without its name."""
        return replace(self, name="")

    def __repr__(self) -> str:
        return f"# from {self.begin} s, h = {self.first}\n{self.text}"

    def without(self, at: int) -> Program:
        """The program without one statement."""
        return replace(self, statements=self.statements[:at] + self.statements[at + 1 :])


# What reads a variable, by its types: the change of one that nothing reads would show nothing.
READS = {"fFiIbB": "r[0] = {}", "AKQ": "r[8:12] = {}", "M": "r[7] = {}[1, 2]"}
BASES = {"update": "Updating", "output": "Returning"}
LEAVE = {"update": "\n    return", "output": "\n    return np.zeros(16)"}
RECORD = {"update": "r = state.r", "output": "r = np.zeros(16)"}
END: dict[str, list[str]] = {"update": [], "output": ["return r"]}


def directed() -> list[Program]:
    """The programs that are tried first."""
    return [
        Program(f"P{i}", tuple(map(ast.unparse, ast.parse(text).body)), loose="vdot" in text)
        for i, text in enumerate(DIRECTED)
    ]


def program(seed: int, number: int) -> Program:
    """The program of a number."""
    given = directed()
    if number < len(given):
        return given[number]
    draw = random.Random(f"{seed}/{number}")
    while True:
        made = Maker(draw).program(f"P{number}")
        try:
            compile(made.text, "program", "exec")
        except SyntaxError:  # such as := in the iterable of a comprehension
            continue
        return made


class Maker:
    """Makes one program."""

    def __init__(self, draw: random.Random) -> None:
        self.draw = draw
        self.scope: dict[str, list[str]] = {kind: [] for kind in NAMES}
        self.slot = 0
        self.loose = False
        self.beyond = draw.random() < 0.3
        self.method = "update" if draw.random() < 0.8 else "output"
        self.before: list[str] = []

    def program(self, name: str) -> Program:
        """One to six statements, of which the last records something."""
        made: list[str] = []
        for _ in range(self.draw.choice((0, 1, 1, 2, 2, 3, 4))):
            made += self.statement(self.draw.choice(self.allowed(STATEMENTS)), 2)
        if self.method == "update" and self.draw.random() < 0.2:
            for _ in range(self.draw.choice((1, 2, 3))):
                made += self.statement(self.draw.choice(MEMORY), 1)
        for kinds, form in READS.items():
            names = [name for kind in kinds for name in self.scope[kind]]
            made += [form.format(self.draw.choice(names))] if names else []
        for _ in range(self.draw.choice((1, 1, 2))):
            made += self.record()
        if any("rng" in text or "drawn" in text for text in made):
            made.append("r[7] = state.rng.random()")
        first = FIRST["special" if self.draw.random() < 0.15 else "ordinary"]
        begin = 0.0 if self.draw.random() < 0.25 else BEGIN
        return Program(name, tuple(made), self.method, begin, first, self.loose)

    def fits(self, form: str, rounded: bool) -> bool:
        """Whether a form may stand here."""
        return not (form[0] == "?" and not self.beyond) and not (form[0] == "~" and not rounded)

    def unmarked(self, form: str) -> str:
        """A form without its mark."""
        self.loose = self.loose or form[0] == "~"
        return form.lstrip("~?")

    def allowed(self, forms: list[str]) -> list[str]:
        """The forms of statements that may stand here: an output does not change the state."""
        fitting = [form for form in forms if self.fits(form, rounded=True)]
        if self.method == "update":
            return fitting
        return [form for form in fitting if not WRITES.search(form)]

    def record(self) -> list[str]:
        """A statement that records something."""
        form = self.draw.choice(self.allowed(RECORDS))
        (hole, *more) = [kind for kind in HOLE.findall(form) if kind not in ("k", "c", "")]
        if more or self.draw.random() < 0.7:
            return self.statement(form, 3)
        # The only place of an expression: a function that rounds otherwise may stand there.
        value = self.expression(hole, 3, rounded=True).replace("{", "{{").replace("}", "}}")
        return self.statement(form.replace(f"{{{hole}}}", value), 0)

    def statement(self, form: str, depth: int) -> list[str]:
        """The text of a statement, with those that it needs before it."""
        form = self.unmarked(form)
        outer, self.before = self.before, []
        inside = {kind: list(names) for kind, names in self.scope.items()}
        names = {"c": self.draw.choice(("c", "d", "z"))}
        lines: list[str] = []
        nested = "{body}" in form
        for line in form.split("\n"):
            indent = line[: len(line) - len(line.lstrip())]
            if line.strip() == "{body}":
                parts = [s for _ in range(self.draw.choice((1, 1, 2))) for s in self.nested()]
                lines += [indent + part for text in parts for part in text.split("\n")]
            else:
                lines.append(self.filled(line, depth, names))
        if nested:
            self.scope = inside
        made = [*self.before, "\n".join(lines)]
        self.before = outer
        return made

    def nested(self) -> list[str]:
        if self.draw.random() < 0.5:
            form = self.draw.choice(self.allowed(RECORDS))
        else:
            form = self.draw.choice(self.allowed(STATEMENTS))
        if "{body}" in form and self.draw.random() < 0.7:
            form = "r[{k}] += {f}"
        return self.statement(form, 1)

    def filled(self, form: str, depth: int, names: dict[str, str]) -> str:
        """A form with all its places filled; ``names`` are those of the whole statement."""
        fresh: dict[str, str] = {}

        def fill(found: re.Match[str]) -> str:
            hole = found[1]
            if hole is None:
                return found[0][0]
            if hole.startswith(("new_", "loop_")) and hole not in names:
                fresh[hole] = names[hole] = self.draw.choice(NAMES[hole.partition("_")[2][0]])
            return names[hole] if hole in names else self.hole(hole, depth)

        text = HOLE.sub(fill, form)
        for hole, name in fresh.items():  # which are defined after what stands beside them
            for known in self.scope.values():
                if name in known:
                    known.remove(name)
            self.scope[hole.partition("_")[2][0]].append(name)
        return text

    def hole(self, hole: str, depth: int) -> str:
        """What stands in one place."""
        small: dict[str, Callable[[], str]] = {
            "n": lambda: str(self.draw.randint(0 if self.draw.random() < 0.1 else 1, 6)),
            "d": lambda: str(self.draw.choice((0, 1, 2, 3, -1, -2))),
            "k": self.place,
            "leave": lambda: "r" if self.method == "output" else "",
            "del_any": lambda: self.existing(self.draw.choice("fFi")),
        }
        if hole in small:
            return small[hole]()
        if hole.startswith("set_"):
            return self.existing(hole[-1])
        return self.expression(hole, depth)

    def place(self) -> str:
        self.slot = (self.slot + 1) % 7
        return str(self.slot)

    def existing(self, kind: str) -> str:
        """A variable of a type; it is defined before the statement if there is none."""
        if not self.scope[kind]:
            name = self.draw.choice(NAMES[kind])
            copy = ".copy()" if kind in "AM" else ""
            self.before.append(f"{name} = {self.leaf(kind)}{copy}")
            self.scope[kind].append(name)
        return self.draw.choice(self.scope[kind])

    def expression(self, kind: str, depth: int, rounded: bool = False) -> str:
        """An expression of a type."""
        kind = self.draw.choice(ANY.get(kind, kind))
        if depth <= 0 or (not rounded and self.draw.random() < 0.25):
            return self.leaf(kind)
        forms = [f for f in EXPRESSIONS[kind] if self.fits(f, rounded)]
        if self.method == "output":
            forms = [f for f in forms if "changed" not in f and "swapped" not in f]
        form = self.draw.choice(forms)
        form = self.unmarked(form)
        name = self.draw.choice(CLASHES)

        def fill(found: re.Match[str]) -> str:
            if found[1] is None:
                return found[0][0]
            return name if found[1] == "c" else self.hole(found[1], depth - 1)

        text = HOLE.sub(fill, form)
        top = ast.parse(text, mode="eval").body
        return f"({text})" if isinstance(top, OPERATORS) and top.col_offset == 0 else text

    def leaf(self, kind: str) -> str:
        """A short expression of a type."""
        names = self.scope[kind]
        if names and self.draw.random() < 0.5:
            return self.draw.choice(names)
        choose = self.draw.choice
        literal = choose(LITERALS)
        d = self.hole("d", 0)
        return {
            "f": lambda: choose(("x", "x", "t", "self.a", literal, literal, "SCALE")),
            "F": lambda: choose((f"v[{d}]", f"state.h[{d}]")),
            "i": lambda: choose(("self.n", "COUNT", "len(v)", self.hole("n", 0), "-2", "int(x)")),
            "I": lambda: choose((f"np.int64({self.hole('n', 0)})", f"np.arange(4)[{d}]")),
            "b": lambda: choose((f"(x > {literal})", "self.flag", f"(x < {literal})", "True")),
            "B": lambda: f"(v[{d}] > {literal})",
            "A": lambda: choose(("v", "state.h")),
            "M": lambda: "state.g",
            "K": lambda: choose(("np.array([3, -2, 7, 5])", "np.arange(4)")),
            "Q": lambda: choose((f"(v > {literal})", f"(state.h < {literal})")),
        }[kind]()
