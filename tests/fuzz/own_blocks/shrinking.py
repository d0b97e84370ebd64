"""Smaller programs: a failure is shown by the smallest that still fails."""

from __future__ import annotations

import ast
import copy
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

from tests.fuzz.own_blocks.generator import BEGIN, FIRST, Program

ROUNDS, TRIED = 12, 40
Check = Callable[[Sequence[Program]], dict[str, str]]


def smallest(program: Program, kind: str, check: Check) -> Program:
    """The smallest program that still fails.

    Parameters
    ----------
    kind : what fails, in a word.
    check : tries programs at once; returns what fails of each that does, by name.
    """
    for _ in range(ROUNDS):
        found = sorted(set(smaller(program)), key=lambda p: (len(p.text), p.text))[:TRIED]
        tried = [replace(each, name=f"{program.name}s{i}") for i, each in enumerate(found)]
        failed = check(tried) if tried else {}
        still = [each for each in tried if failed.get(each.name, "") == kind]
        if not still:
            return program
        program = replace(still[0], name=program.name)
    return program


def smaller(program: Program) -> Iterator[Program]:
    """Programs with a statement or a part of an expression less."""
    for at in range(len(program.statements)):
        yield program.without(at)
    if program.begin != BEGIN:
        yield replace(program, begin=BEGIN)
    if program.first != FIRST["ordinary"]:
        yield replace(program, first=FIRST["ordinary"])
    for at, text in enumerate(program.statements):
        for shorter in _shorter(text):
            statements = (*program.statements[:at], shorter, *program.statements[at + 1 :])
            made = replace(program, statements=statements)
            if _is_python(made.text):
                yield made


def _is_python(text: str) -> bool:
    try:
        compile(text, "program", "exec")
    except (SyntaxError, ValueError):
        return False
    return True


def _shorter(text: str) -> Iterator[str]:
    """A statement's text with one expression replaced by a part of it, or by its body."""
    # In a loop and a function, since it may hold 'return' and 'continue'.
    lines = "\n".join(f"        {line}" for line in text.split("\n"))
    try:
        whole = ast.parse(f"def f():\n    while 1:\n{lines}")
    except SyntaxError:
        return
    body = whole.body[0].body[0].body  # type: ignore[attr-defined]
    if len(body) > 1:
        for left in range(len(body)):
            yield "\n".join(ast.unparse(s) for i, s in enumerate(body) if i != left)
    for statement in body:
        for inner in (getattr(statement, "body", []), getattr(statement, "orelse", [])):
            if inner and isinstance(inner, list):
                yield "\n".join(map(ast.unparse, inner))
    places = [node for node in ast.walk(ast.Module(body, [])) if isinstance(node, ast.expr)]
    for number, node in enumerate(places):
        if isinstance(node, (ast.Constant, ast.Name)) or not _is_read(node):
            continue
        parts = [n for n in ast.iter_child_nodes(node) if isinstance(n, ast.expr) and _is_read(n)]
        for part in [*parts, ast.Name("x", ast.Load())]:
            yield _replaced(body, number, part)


def _is_read(node: ast.expr) -> bool:
    return isinstance(getattr(node, "ctx", ast.Load()), ast.Load)


def _replaced(body: list[ast.stmt], number: int, part: ast.expr) -> str:
    """The statements with the expression of a number replaced by another."""
    whole = ast.Module(copy.deepcopy(body), [])
    target = [node for node in ast.walk(whole) if isinstance(node, ast.expr)][number]

    class Replacing(ast.NodeTransformer):
        def visit(self, node: ast.AST) -> ast.AST:
            return part if node is target else self.generic_visit(node)

    return ast.unparse(ast.fix_missing_locations(Replacing().visit(whole)))


def likeness(program: Program) -> str:
    """The same for programs that differ in numbers alone."""
    return re.sub(r"\d[\d.e]*", "0", "\n".join(program.statements))
