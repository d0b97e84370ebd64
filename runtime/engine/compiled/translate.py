"""A block's methods as plain functions for numba: ``self`` and ``state`` become one tuple."""

from __future__ import annotations

import ast
import inspect
import math
import textwrap
import types
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from blocks.core import Block, BlockState, SignalType, function_kernel, kernel_for, parsed
from blocks.generic import added, scaled
from runtime.engine.compiled.folding import Folding, holds_one

MODULES = {math: "math", np: "np"}
LITERALS = (str, bool, type(None))
# Functions that numba lacks, or that do not compile as they are written.
REPLACED: dict[Any, str] = {math.remainder: "remainder", scaled: "scaled", added: "added"}


class NotCompilableError(Exception):
    """A block cannot be compiled: the reason, then file and line."""


def plain(value: Any, name: str) -> Any:
    """A value in a form that compiled text accepts; arrays are shared if possible, else copied."""
    if isinstance(value, np.ndarray) and value.dtype.kind in "fib":
        if value.flags.c_contiguous and value.flags.writeable:
            return value
        if name.startswith("state.") and value.base is not None and _may_change(value):
            raise NotCompilableError(f"{name} is a part of an array, and not contiguous")
        return value.copy()
    if isinstance(value, np.random.Generator):
        return value
    if isinstance(value, (float, np.floating)):
        return float(value)
    if isinstance(value, (int, np.integer)):
        return int(value)
    if isinstance(value, tuple):
        return tuple(plain(part, name) for part in value)
    raise NotCompilableError(f"{name} is a {type(value).__name__}")


def _may_change(array: np.ndarray[Any, Any]) -> bool:
    """Whether an array's data can be written to by anyone."""
    base: Any = array
    while base is not None:
        if not isinstance(base, np.ndarray) or base.flags.writeable:
            return True
        base = base.base
    return False


class Writer(Folding):
    """Writes one function as text."""

    def __init__(self, owner: Translator, function: types.FunctionType, bound: bool) -> None:
        self.owner, self.function, self.bound = owner, function, bound
        self.used: dict[str, None] = {}

    def written(self, name: str) -> str:
        try:
            source = textwrap.dedent(inspect.getsource(self.function))
        except OSError:
            raise NotCompilableError(f"the source of '{name}' cannot be read") from None
        node = parsed(source).body[0]
        if not isinstance(node, ast.FunctionDef):
            raise NotCompilableError(f"'{name}' is no plain function")
        arguments = node.args.args
        names = [a.arg for a in arguments]
        if self.bound:
            names = [n for n in names if n not in ("self", "state")]
        self.locals = {*names, *_assigned(node)}
        defaults = dict(zip(reversed(names), reversed(node.args.defaults), strict=False))
        # The plan calls output methods without the inputs that the block declares indirect.
        left = self.owner.made.indirect if self.bound else ()
        absent = [n for n in names if n in left and n in defaults]
        names = [n for n in names if n not in absent]
        heads = [f"{n}={ast.unparse(defaults[n])}" if n in defaults else n for n in names]
        body = self.block(node.body)
        lines = [f"{n} = {ast.unparse(defaults[n])}" for n in absent if _reads(node, n)]
        lines += [f"{key} = b[{list(self.owner.fields).index(key)}]" for key in self.used]
        lines += ast.unparse(ast.fix_missing_locations(ast.Module(body or [ast.Pass()], []))).split(
            "\n"
        )
        first = ["b"] if self.bound else []
        return f"def {name}({', '.join(first + heads)}):\n" + textwrap.indent(
            "\n".join(lines), "    "
        )

    def refuse(self, node: ast.AST, why: str) -> NotCompilableError:
        code = self.function.__code__
        line = code.co_firstlineno + getattr(node, "lineno", 1) - 1
        return NotCompilableError(f"{why} ({code.co_filename}:{line})")

    def visit_Expr(self, node: ast.Expr) -> Any:
        if isinstance(node.value, ast.Constant):
            return None  # a docstring
        return self.generic_visit(node)

    def visit_AnnAssign(self, node: ast.AnnAssign) -> Any:
        if node.value is None:
            return None
        return self.visit(ast.copy_location(ast.Assign([node.target], node.value), node))

    def visit_Assign(self, node: ast.Assign) -> Any:
        target, value = node.targets[0], node.value
        if len(node.targets) == 1 and isinstance(target, ast.Tuple) and _is_call(value, "tolist"):
            return self.unpacked(target, value.func.value)  # type: ignore[attr-defined]
        return self.generic_visit(node)

    def unpacked(self, target: ast.Tuple, array: ast.expr) -> list[ast.stmt]:
        """``x, y = a.tolist()``, entry by entry: numba does not know the length of an array."""
        whole = f"entries_{target.lineno}_{target.col_offset}"
        self.locals.add(whole)
        done: list[ast.stmt] = [ast.Assign([ast.Name(whole, ast.Store())], self.visit(array))]

        def take(part: ast.expr, at: tuple[int, ...]) -> None:
            if isinstance(part, ast.Tuple):
                for i, inner in enumerate(part.elts):
                    take(inner, (*at, i))
                return
            index = parsed(repr(at[0] if len(at) == 1 else at)).body[0].value  # type: ignore[attr-defined]
            value = ast.Subscript(ast.Name(whole, ast.Load()), index, ast.Load())
            done.append(ast.Assign([part], value))

        take(target, ())
        return done

    def visit_AugAssign(self, node: ast.AugAssign) -> Any:
        node.value = self.visit(node.value)
        if isinstance(node.target, ast.Attribute):
            # In place, into a declared array.
            self.stored(node.target)
            load = self.visit(ast.Attribute(node.target.value, node.target.attr, ast.Load()))
            node.target = ast.Name(load.id, ast.Store())
        else:
            node.target = self.visit(node.target)
        return node

    def stored(self, node: ast.Attribute) -> None:
        whole = isinstance(node.value, ast.Name) and node.value.id == "state"
        if not whole or node.attr not in type(self.owner.made).spec.states:
            raise self.refuse(node, f"assigns to '{ast.unparse(node)}', which is no State")

    def visit_Attribute(self, node: ast.Attribute) -> Any:
        if isinstance(node.value, ast.Name) and node.value.id not in self.locals:
            owner = node.value.id
            if self.bound and owner in ("self", "state"):
                if isinstance(node.ctx, ast.Store):
                    suggestion = "; write into it, as in state.x[...] = value"
                    if node.attr not in type(self.owner.made).spec.states:
                        suggestion = "; declare a State for what changes"
                    raise self.refuse(node, f"assigns to '{owner}.{node.attr}'{suggestion}")
                return self.entry(node, owner)
            module = self.function.__globals__.get(owner)
            if isinstance(module, types.ModuleType):
                value = getattr(module, node.attr, None)
                if value is None:
                    raise self.refuse(node, f"'{owner}' has no '{node.attr}'")
                if callable(value) and value in REPLACED:
                    return ast.Name(REPLACED[value], ast.Load())
                if module not in MODULES:
                    raise self.refuse(node, f"uses the module '{owner}'")
                return ast.Attribute(ast.Name(MODULES[module], ast.Load()), node.attr, node.ctx)
        return self.generic_visit(node)

    def entry(self, node: ast.Attribute, owner: str) -> ast.expr:
        """An attribute of the block or of its state."""
        of = self.owner.made if owner == "self" else self.owner.state
        try:
            value = getattr(of, node.attr)
        except AttributeError:
            raise self.refuse(node, f"'{owner}.{node.attr}' is not set by start") from None
        if isinstance(value, (*LITERALS, types.FunctionType)):
            self.owner.constants[owner, node.attr] = value
        if isinstance(value, LITERALS):
            return ast.Constant(value)
        if isinstance(value, types.FunctionType):
            return ast.Name(self.owner.function(value), ast.Load())
        try:
            key = self.owner.field(owner, node.attr, value)
        except NotCompilableError as error:
            raise self.refuse(node, str(error)) from None
        self.used[key] = None
        return ast.Name(key, node.ctx)

    def visit_Call(self, node: ast.Call) -> Any:
        function = node.func
        if isinstance(function, ast.Attribute):
            owner = function.value
            if self.bound and isinstance(owner, ast.Name) and owner.id in ("self", "state"):
                of = self.owner.made if owner.id == "self" else self.owner.state
                value = getattr(of, function.attr, None)
                if isinstance(value, types.MethodType):
                    return self.called(node, function.attr, value)
            if function.attr == "tolist" and not node.args:
                return self.visit(owner)
        if isinstance(function, ast.Name) and function.id not in self.locals:
            if function.id == "tuple" and len(node.args) == 1 and _is_call(node.args[0], "tolist"):
                return self.spelled(node.args[0].func.value)  # type: ignore[attr-defined]
            if (
                function.id == "float"
                and len(node.args) == 1
                and self.bound
                and holds_one(node.args[0], self.owner.state)
            ):
                return ast.Subscript(
                    self.visit(node.args[0]), ast.Tuple([], ast.Load()), ast.Load()
                )
            if function.id == "len" and isinstance(node.args[0], ast.Name):
                terms = self.owner.terms.get(node.args[0].id)
                if self.bound and terms is not None:
                    return ast.Constant(terms)
            if function.id == "zip":
                node.keywords = [k for k in node.keywords if k.arg != "strict"]
        return self.generic_visit(node)

    def called(self, node: ast.Call, attribute: str, method: types.MethodType) -> Any:
        """A call of one of the block's own methods, or of a signal type's ``pack``."""
        if isinstance(method.__self__, SignalType) and method.__name__ == "pack":
            return self.packed(method.__self__, node.args[0])
        own = method.__self__ is self.owner.made
        if not own or getattr(type(self.owner.made), attribute) is not method.__func__:
            raise self.refuse(node, f"calls '{ast.unparse(node.func)}'")
        arguments = [
            self.visit(a) for a in node.args if not (isinstance(a, ast.Name) and a.id == "state")
        ]
        name = self.owner.method(attribute)
        return ast.Call(ast.Name(name, ast.Load()), [ast.Name("b", ast.Load()), *arguments], [])

    def packed(self, kind: SignalType, array: ast.expr) -> Any:
        """An array of a signal's shape in the signal's own form."""
        inner = self.visit(array)
        if kind.form == "array":
            return ast.Call(ast.Attribute(inner, "copy", ast.Load()), [], [])
        if kind.form == "scalar":
            return ast.Subscript(inner, ast.Tuple([], ast.Load()), ast.Load())
        return _entries(inner, len(kind.components))

    def spelled(self, array: ast.expr) -> Any:
        """``tuple(state.x.tolist())`` with the length that the array has."""
        inner = self.visit(array)
        value = self.owner.fields.get(inner.id) if isinstance(inner, ast.Name) else None
        if not isinstance(value, np.ndarray) or value.ndim != 1:
            raise self.refuse(array, "makes a tuple of an array of unknown length")
        return _entries(inner, len(value))

    def visit_Name(self, node: ast.Name) -> Any:
        name = node.id
        if name in self.locals or (self.bound and name == "b"):
            return node
        if self.bound and name in ("self", "state"):
            raise self.refuse(node, f"passes '{name}' on")
        scope = self.function.__globals__
        if name not in scope:
            return node  # a builtin
        value = scope[name]
        if callable(value) and value in REPLACED:
            return ast.Name(REPLACED[value], ast.Load())
        if isinstance(value, types.FunctionType):
            return ast.Name(self.owner.function(value), ast.Load())
        if isinstance(value, (bool, int, float, str)):
            return (
                ast.Constant(value)
                if value == value and value not in (math.inf, -math.inf)
                else _written(repr(value))
            )
        raise self.refuse(node, f"uses '{name}', a {type(value).__name__}")

    def refused(self, node: ast.AST) -> Any:
        raise self.refuse(node, f"holds a {type(node).__name__}")

    def visit_ImportFrom(self, node: ast.ImportFrom) -> Any:
        raise self.refuse(node, f"imports '{node.module}'")

    visit_Lambda = refused
    visit_FunctionDef = refused
    visit_Try = refused
    visit_With = refused
    visit_JoinedStr = refused
    visit_Yield = refused
    visit_Global = refused


def _written(text: str) -> ast.expr:
    return ast.Attribute(ast.Name("math", ast.Load()), text, ast.Load())


def _entries(array: ast.expr, length: int) -> ast.Tuple:
    return ast.Tuple(
        [ast.Subscript(array, ast.Constant(i), ast.Load()) for i in range(length)], ast.Load()
    )


def _is_call(node: ast.expr, attribute: str) -> bool:
    return (
        isinstance(node, ast.Call)
        and isinstance(node.func, ast.Attribute)
        and node.func.attr == attribute
        and not node.args
    )


def _reads(node: ast.FunctionDef, name: str) -> bool:
    return any(isinstance(inner, ast.Name) and inner.id == name for inner in ast.walk(node))


def _assigned(node: ast.AST) -> set[str]:
    return {
        n.id for n in ast.walk(node) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)
    }


Attribute = tuple[str, str]
HEADER = """from __future__ import annotations

import math

import numpy as np
from numba import njit

from blocks.generic.arithmetic import added, scaled
from runtime.engine.compiled.primitives import remainder
"""


@dataclass(frozen=True)
class Translated:
    """A block as compiled text.

    text : a Python module with one function for each of ``methods``.
    entries : the attributes in the first argument of these functions, as ("self" or "state", name).
    constants : attributes whose values were written into the text.
    arrays : the state's float arrays among the entries, each as the subscripts of its place.
    """

    text: str
    methods: dict[str, str]
    entries: tuple[Attribute, ...]
    constants: dict[Attribute, Any]
    arrays: tuple[str, ...] = ()

    def fields(self, made: Block, state: BlockState) -> tuple[Any, ...]:
        """The first argument of the functions, for a block and its state."""
        of = {"self": made, "state": state}
        return tuple(plain(getattr(of[o], name), f"{o}.{name}") for o, name in self.entries)

    def fits(self, made: Block, state: BlockState) -> bool:
        """Whether the text's constants are those of this block and state."""
        of = {"self": made, "state": state}
        return all(getattr(of[o], name) == value for (o, name), value in self.constants.items())


def translate(made: Block, state: BlockState, terms: dict[str, int], safe: bool) -> Translated:
    """Write all methods of a block that the plan calls.

    Parameters
    ----------
    made, state : the block, and its state after ``start``.
    terms : the number of wires of each variadic input.
    safe : check every index while running, as is needed for blocks that are not built in.

    Raises
    ------
    NotCompilableError : naming the reason.
    """
    translator = Translator(made, state, terms)
    spec = type(made).spec
    wanted = [evaluation.method for evaluation in spec.evaluations]
    wanted += [each.method for each in (spec.update, spec.derivative) if each is not None]
    wanted += ["project"] if spec.projects else []
    methods = {name: translator.method(name) for name in wanted}
    options = "error_model='python', cache=True" + (", boundscheck=True" if safe else "")
    # Functions that only compiled text calls need no Python wrapper.
    inner = options + ", no_cpython_wrapper=True, no_cfunc_wrapper=True"
    functions = [
        f"@njit({options if name in methods.values() else inner})\n{text}"
        for name, text in translator.functions.items()
    ]
    text = "\n\n".join([HEADER, *functions]) + "\n"
    entries = tuple(translator.attributes.values())
    arrays = tuple(
        at
        for i, (key, (owner, _)) in enumerate(translator.attributes.items())
        if owner == "state"
        for at in float_arrays(translator.fields[key], f"[{i}]")
    )
    return Translated(text, methods, entries, translator.constants, arrays)


def float_arrays(value: Any, at: str) -> Iterator[str]:
    """The subscripts of the float arrays in a field, itself at ``at``."""
    if isinstance(value, tuple):
        for i, part in enumerate(value):
            yield from float_arrays(part, f"{at}[{i}]")
    elif isinstance(value, np.ndarray) and value.dtype == np.float64:
        yield at


class Translator:
    """Collects the functions and fields of one block."""

    def __init__(self, made: Block, state: BlockState, terms: dict[str, int]) -> None:
        self.made, self.state, self.terms = made, state, terms
        self.fields: dict[str, Any] = {}
        self.attributes: dict[str, Attribute] = {}
        self.constants: dict[Attribute, Any] = {}
        self.functions: dict[str, str] = {}
        self.names: dict[Any, str] = {}

    def method(self, name: str) -> str:
        """The name of a method's function; writes the function if needed."""
        cls = type(self.made)
        method = getattr(cls, name)
        if isinstance(method, types.FunctionType):
            method = kernel_for(cls, method, vars(self.state)) or method
        return self.function(method, bound=True)

    def function(self, function: Callable[..., Any], bound: bool = False) -> str:
        """A function's name in the text; writes the function after those that it calls."""
        if isinstance(function, types.FunctionType) and not bound:
            function = function_kernel(function) or function
        if function in self.names:
            return self.names[function]
        if not isinstance(function, types.FunctionType) or function.__closure__:
            raise NotCompilableError(f"'{getattr(function, '__name__', function)}' is no function")
        name = function.__name__
        while name in self.names.values():
            name += "_"
        self.names[function] = name
        writer = Writer(self, function, bound)
        self.functions[name] = ""  # reserves the name, so that recursion ends
        text = writer.written(name)
        del self.functions[name]
        self.functions[name] = text
        return name

    def field(self, owner: str, name: str, value: Any) -> str:
        """The local name of an entry of ``b``."""
        key = f"{owner}_{name}"
        if key not in self.fields:
            self.fields[key] = plain(value, f"{owner}.{name}")
            self.attributes[key] = (owner, name)
        return key
