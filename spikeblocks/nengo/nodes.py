"""Nodes of Nengo as blocks: constants, expressions, a recorded table, or blocks of an own file.

In: a node, or a function on a connection. Out: an entry of ``blocks``, and for a function that no
expression has, the class of a block in ``my_blocks.py``. A node sees the time at the end of a step,
which is t + dt here::

    Node(lambda t: np.sin(8 * t))    ->    {type: Function, expression: sin(8 * (t + 0.001))}
"""

from __future__ import annotations

import ast
import inspect
import re
import textwrap
import types
from typing import Any

import nengo
import numpy as np

from blocks.core import FloatArray
from spikeblocks.nengo.expressions import Text, expression_of, given_names, node_of

POINTS = 300
HEADER = '''"""Functions of the Nengo model that are no expressions of a graph."""

from __future__ import annotations

import math

import numpy as np

from blocks import Block, Input, Output, Scalar, Vector

DT = {dt!r}


def at(t):
    """The time that a node of Nengo sees in the step of t: that at its end."""
    return (round(t / DT) + 1) * DT
'''
CLASS = '''

{source}


class {name}(Block):
    """The node {label} of the model."""
{input}
    out = Output({output})

    def output(self, state, t{argument}):
        value = np.asarray({call}, dtype=float)
        return {result}
'''


def timed(text: Text, dt: float) -> Text:
    """An expression of t as it is at the end of a step that begins at t."""
    if isinstance(text, list):
        return [str(timed(each, dt)) for each in text]
    return re.sub(r"(?<![\w.])t(?![\w(])", f"(t + {dt:g})", text)


def ticks(dt: float, until: float) -> list[float]:
    """Times that nodes see; the first ones and others up to the end of a run."""
    count = max(2, round(until / dt))
    chosen = range(count) if count <= 5000 else np.linspace(0, count - 1, 5000).astype(int).tolist()
    return [(k + 1) * dt for k in chosen]


def of_time(node: Any, dt: float, until: float) -> Text | None:
    """The expression of a node without inputs; None if there is none, or if it has a memory."""
    points = [(t,) for t in ticks(dt, until)]
    text = expression_of(node.output, points, {"t": None})
    if text is None:
        return None
    # Asked at the times of a graph: t_k + dt may round to the other side of a step than (k + 1) dt.
    return timed(text, dt)


def of_input(node: Any, dt: float) -> Text | None:
    """The expression of a node with inputs, of t and u."""
    rng, d = np.random.default_rng(5), node.size_in
    points = [((k + 1) * dt, rng.uniform(-1.5, 1.5, d)) for k in range(POINTS)]
    text = expression_of(node.output, points, {"t": None, "u": d})
    return None if text is None else timed(text, dt)


def of_values(function: Any, d: int, name: str, radius: float = 1.0) -> Text | None:
    """The expression of a connection's function."""
    rng = np.random.default_rng(5)
    points = [(x,) for x in rng.uniform(-radius, radius, (POINTS, d))]
    return expression_of(function, points, {name: d})


def recorded(simulator: Any, nodes: list[Any], dt: float, until: float) -> dict[Any, FloatArray]:
    """What nodes put out in each step, (steps, size), and the times of these."""
    steps = max(2, round(until / dt) + 1)
    signals = {node: simulator.model.sig[node]["out"] for node in nodes}
    rows: dict[Any, list[FloatArray]] = {node: [] for node in nodes}
    for _ in range(steps):
        simulator.step()
        for node, signal in signals.items():
            rows[node].append(np.array(simulator.signals[signal], dtype=float).reshape(-1))
    times = np.array([k * dt for k in range(steps)])
    return {"time": times} | {node: np.array(each) for node, each in rows.items()}


def of_table(name: str) -> dict[str, str]:
    """A block that replays the column of a table, whose file is not known yet."""
    columns = {"file": "", "time": "time", "columns": name}
    return {**columns, "method": "hold", "outside": "hold"}


def is_process(node: Any) -> bool:
    """Whether a node's output is a process, and not a Python function."""
    return isinstance(node.output, nengo.Process)


def own_block(name: str, function: Any, size_in: int, size: int, takes_time: bool) -> str | None:
    """The text of a block's class that calls a function, with its source; None if it is not plain.

    Plain is a function that takes nothing from around it but modules and numbers, and changes
    nothing there.
    """
    source = _source(function, f"_{name}")
    if source is None:
        return None
    return _class(name, source, f"_{name}", size_in, size, takes_time)


def stub(name: str, size_in: int, size: int) -> str:
    """A class that says what is to be written."""
    source = f"def _{name}(*arguments):\n"
    source += f'    raise NotImplementedError("write what the node {name} of the model computes")'
    return _class(name, source, f"_{name}", size_in, size, True)


def calling(name: str, number: int, size_in: int, size: int, takes_time: bool) -> str:
    """A class that calls a Python function of this process, by its number."""
    source = "from spikeblocks.nengo.live import CALLS"
    return _class(name, source, f"CALLS[{number}]", size_in, size, takes_time)


def _class(name: str, source: str, function: str, size_in: int, size: int, takes_time: bool) -> str:
    # A copy, since a function may change what it is given, or keep it.
    arguments = [
        *(["at(t)"] if takes_time else []),
        *(["np.atleast_1d(u).copy()"] if size_in else []),
    ]
    return CLASS.format(
        source=source,
        name=class_name(name),
        label=name,
        input=f"\n    u = Input({_type(size_in)})" if size_in else "",
        output=_type(size),
        argument=", u" if size_in else "",
        call=f"{function}({', '.join(arguments)})",
        result="float(value.reshape(-1)[0])" if size == 1 else "value.reshape(-1)",
    )


def class_name(name: str) -> str:
    """A name of a block as that of a class."""
    return "".join(part.capitalize() for part in name.split("_")) or "Node"


def _type(size: int) -> str:
    return "Scalar" if size == 1 else f"Vector({size})"


def _source(function: Any, name: str) -> str | None:
    found = node_of(function)
    if len(found) != 1:
        return None
    try:
        around = given_names(function)
    except (TypeError, ValueError):
        return None
    lines = []
    for key, value in around.items():
        if isinstance(value, types.ModuleType):
            root = value.__name__
            lines += [] if (key, root) in (("np", "numpy"), ("math", "math")) else [
                f"import {root} as {key}"]  # fmt: skip
        elif isinstance(value, (bool, int, float, str)):
            lines.append(f"{key} = {value!r}")
        elif isinstance(value, (np.ndarray, list, tuple)) and np.size(value) <= 100:
            made = np.asarray(value).tolist()
            lines.append(
                f"{key} = np.array({made!r})"
                if isinstance(value, np.ndarray)
                else f"{key} = {value!r}"
            )
        else:
            return None
    node = found[0]
    changes = (ast.Global, ast.Nonlocal, ast.Delete, ast.Yield, ast.Await)
    if any(isinstance(each, changes) for each in ast.walk(node)) or function.__defaults__:
        return None
    mutable = {k for k, v in around.items() if isinstance(v, (np.ndarray, list))}
    for each in ast.walk(node):  # a list outside that is appended to is a memory
        if isinstance(each, ast.Name) and each.id in mutable and _may_change(node, each.id):
            return None
    if isinstance(node, ast.Lambda):
        text = f"{name} = {ast.unparse(node)}"
    else:
        text = textwrap.dedent(inspect.getsource(function)).rstrip()
        text = re.sub(rf"\bdef {re.escape(node.name)}\b", f"def {name}", text, count=1)
    if not lines:
        return text
    # Two functions may call different numbers by one name: each has its own.
    inside = textwrap.indent("\n".join([*lines, text, f"return {name}"]), "    ")
    return f"def {name}_of():\n{inside}\n\n\n{name} = {name}_of()"


def _may_change(node: ast.AST, name: str) -> bool:
    for each in ast.walk(node):
        if isinstance(each, ast.Attribute) and getattr(each.value, "id", "") == name:
            return True
        targets = getattr(each, "targets", [getattr(each, "target", None)])
        for target in targets if isinstance(each, (ast.Assign, ast.AugAssign)) else ():
            if any(getattr(inner, "id", "") == name for inner in ast.walk(target)):
                return True
    return False
