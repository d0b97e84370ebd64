"""Scopes of the source: variables of comprehensions, and variables that may not be assigned yet.

In go statements, out come the same with a name for each variable, and the names that may have no
value where they are read:

    sum([x for x in a]) + x     sum([x__c1 for x__c1 in a]) + x
    if a > 0: last = a          uncertain: last, which C tests before it is read
    return last
"""

from __future__ import annotations

import ast
import copy
from collections.abc import Iterable, Sequence

Comprehension = ast.ListComp | ast.SetComp | ast.GeneratorExp | ast.DictComp


def separated(statements: Sequence[ast.stmt]) -> list[ast.stmt]:
    """Statements in which each comprehension has variables of its own.

    sum([x * x for x in (1.0, 2.0)]) + x   ->   sum([x__c1 * x__c1 for x__c1 in (1.0, 2.0)]) + x
    """
    holds = any(isinstance(n, Comprehension) for s in statements for n in ast.walk(s))
    if not holds:
        return list(statements)
    renaming = _Renaming()
    return [renaming.visit(copy.deepcopy(statement)) for statement in statements]


class _Renaming(ast.NodeTransformer):
    def __init__(self) -> None:
        self.count = 0

    def comprehension(self, node: Comprehension) -> ast.AST:
        # Inner comprehensions first: then no name of theirs is left that could be this one's.
        self.generic_visit(node)
        self.count += 1
        names = {n for loop in node.generators for n in stored_names(loop.target)}
        # The first iterable is evaluated outside.
        first = set(map(id, ast.walk(node.generators[0].iter)))
        for inner in ast.walk(node):
            if isinstance(inner, ast.Name) and inner.id in names and id(inner) not in first:
                inner.id = f"{inner.id}__c{self.count}"
        return node

    visit_ListComp = comprehension
    visit_SetComp = comprehension
    visit_GeneratorExp = comprehension
    visit_DictComp = comprehension


def uncertain(parameters: Iterable[str], statements: Sequence[ast.stmt]) -> frozenset[str]:
    """Variables that are read where no assignment may have come before.

    Python raises UnboundLocalError there, as for ``last`` where no item was above 0:

        for item in items:
            if item > 0:
                last = item
        return last
    """
    flow = _Flow(frozenset(parameters))
    flow.all(statements)
    stored = {n for s in statements for n in stored_names(s)}
    return frozenset(flow.uncertain & stored)


class _Flow:
    """Follows which names are assigned for certain; None after a statement that never ends."""

    def __init__(self, names: frozenset[str]) -> None:
        self.names: frozenset[str] | None = names
        self.uncertain: set[str] = set()
        self.breaks: list[frozenset[str] | None] = []

    def all(self, statements: Sequence[ast.stmt]) -> None:
        for statement in statements:
            if self.names is None:
                return
            self.statement(statement)

    def statement(self, node: ast.stmt) -> None:
        if isinstance(node, ast.If):
            self.read(node.test)
            before = self.names
            self.all(node.body)
            after, self.names = self.names, before
            self.all(node.orelse)
            self.names = _both(after, self.names)
        elif isinstance(node, (ast.For, ast.While)):
            self.loop(node)
        elif isinstance(node, ast.Break):
            self.breaks.append(self.names)
            self.names = None
        else:
            self.plain(node)

    def plain(self, node: ast.stmt) -> None:
        if isinstance(node, ast.AugAssign) and isinstance(node.target, ast.Name):
            self.read(ast.Name(node.target.id, ast.Load()))
        self.read(node)
        self.add(stored_names(node))
        if isinstance(node, (ast.Return, ast.Raise, ast.Continue)):
            self.names = None

    def loop(self, node: ast.For | ast.While) -> None:
        outer, self.breaks = self.breaks, []
        self.read(node.iter if isinstance(node, ast.For) else node.test)
        before = self.names
        if isinstance(node, ast.For):
            self.add(stored_names(node.target))
        self.all(node.body)
        endless = isinstance(node, ast.While) and isinstance(node.test, ast.Constant)
        self.names = None if endless else before
        for names in self.breaks:
            self.names = _both(self.names, names)
        self.breaks = outer

    def add(self, names: Iterable[str]) -> None:
        if self.names is not None:
            self.names |= frozenset(names)

    def read(self, node: ast.AST) -> None:
        own = {
            name
            for inner in ast.walk(node)
            if isinstance(inner, ast.comprehension)
            for name in stored_names(inner.target)
        }
        for inner in ast.walk(node):
            if not isinstance(inner, ast.Name) or not isinstance(inner.ctx, ast.Load):
                continue
            if self.names is not None and inner.id not in self.names | own:
                self.uncertain.add(inner.id)


def _both(a: frozenset[str] | None, b: frozenset[str] | None) -> frozenset[str] | None:
    """What is assigned on both of two ways; None for a way that is not taken."""
    return b if a is None else a if b is None else a & b


def stored_names(node: ast.AST) -> list[str]:
    """The names that are assigned in a part of a tree, as often as they are."""
    return [
        inner.id
        for inner in ast.walk(node)
        if isinstance(inner, ast.Name) and isinstance(inner.ctx, ast.Store)
    ]
