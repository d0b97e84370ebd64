"""A block's methods as plain functions: ``self`` and ``state`` become entries of one struct.

In go a block and its state after ``start``, out come syntax trees of the functions that its methods
call, and the attributes that these read. What depends on the block and not on the tick is decided
here: strings and flags become constants, and branches that they decide are dropped (``folding``).

    def output(self, state, t, input):              def output(t, input):
        if self.mode == "fast":                         return self_gain * input
            return self.gain * input
        return slow(input)                          fields: self_gain, a float

What cannot be a plain function, as a closure or a method of another object, is refused with its
line: the block is then called from Python.
"""

from __future__ import annotations

import ast
import math
import textwrap
import types
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from blocks.core import Block, BlockState, SignalType, function_kernel, kernel_for, parsed
from blocks.core.polynomials import any_order, exponent_of, power_of_two
from blocks.library.registry import is_built_in
from runtime.codegen import ANY_ORDER, Function, Source, unknown_call
from runtime.compiler.fields import (
    Attribute,
    Fields,
    NotCompilableError,
    Read,
    plain,
    type_of,
    type_texts,
)
from runtime.compiler.folding import Folding, holds_one
from runtime.compiler.function_source import source_of
from runtime.compiler.syntax import (
    assigned_names,
    constant,
    copied_list,
    entries_of,
    is_call,
    reads_name,
    without_list,
)

MODULES = {math: "math", np: "np"}
LITERALS = (str, bool, type(None))
# Functions of blocks.core that have a form in C.
PRIMITIVES = {power_of_two: "power_of_two", exponent_of: "exponent_of"}


class Writer(Folding):
    """Writes one function as text."""

    def __init__(self, owner: Translator, function: types.FunctionType, bound: bool) -> None:
        self.owner, self.function, self.bound = owner, function, bound
        self.is_own = not str(function.__module__).startswith("blocks.")
        self.used: dict[str, None] = {}

    def written(self, name: str) -> Function:
        """The function in the form that is compiled."""
        code = self.function.__code__
        source = source_of(code)
        if source is None:
            raise NotCompilableError(f"the source of '{name}' cannot be read")
        node = parsed(source).body[0]
        if not isinstance(node, ast.FunctionDef):
            raise NotCompilableError(f"'{name}' is no plain function")
        others = (*node.args.posonlyargs, *node.args.kwonlyargs, node.args.vararg, node.args.kwarg)
        if any(others) or code.co_freevars:
            raise NotCompilableError(f"'{name}' has other parameters than plain ones")
        names = [a.arg for a in node.args.args]
        if self.bound:
            names = [n for n in names if n not in ("self", "state")]
        self.locals = {*names, *assigned_names(node)}
        if self.locals & {"math", "np"}:
            raise self.refuse(node, "has a variable that is called 'math' or 'np'")
        values = reversed(self.function.__defaults__ or ())
        given = dict(zip(reversed(names), values, strict=False))
        defaults = {n: self.default(node, n, value) for n, value in given.items()}
        note = (ast.get_docstring(node) or "").split("\n\n")[0]
        # The plan calls output methods without the inputs that the block declares indirect.
        left = self.owner.made.indirect if self.bound else ()
        absent = [n for n in names if n in left and n in defaults]
        names = [n for n in names if n not in absent]
        reads = [n for n in absent if reads_name(node, n)]
        set_first = [ast.Assign([ast.Name(n, ast.Store())], defaults[n]) for n in reads]
        located = [ast.copy_location(each, node) for each in set_first]
        body = [*located, *self.block(node.body)] or [ast.Pass()]
        return Function(
            name=name,
            parameters=tuple(names),
            statements=body,
            defaults={n: d for n, d in defaults.items() if n not in absent},
            file=code.co_filename,
            line=code.co_firstlineno - 1,
            bound=self.bound,
            note=note,
        )

    def default(self, node: ast.AST, name: str, value: Any) -> ast.expr:
        """The value of a parameter that is not given: it was computed with the definition."""
        if isinstance(value, tuple):
            parts = [self.default(node, name, each) for each in value]
            return ast.Tuple(parts, ast.Load())
        if type(value) in (bool, int, float, str, type(None)):
            return constant(value)
        kind = type(value).__name__
        raise self.refuse(node, f"has a default of '{name}' that is no number or text, a {kind}")

    def read(self, name: str) -> Any:
        """A global of the function; None if there is none."""
        value = self.function.__globals__.get(name)
        if self.is_own:
            self.owner.read(self.function.__globals__, name, value)
        return value

    def is_builtin(self, name: str) -> bool:
        """Whether a name is Python's own."""
        self.read(name)
        return name not in self.locals and name not in self.function.__globals__

    def text(self, function: Function) -> str:
        """The function as Python, which reads the entries of ``b``."""
        keys = list(self.owner.fields)
        reads = [f"{key} = b[{keys.index(key)}]" for key in self.used]
        body = ast.unparse(ast.Module(list(function.statements), [])).split("\n")
        defaults = function.defaults
        heads = [
            f"{n}={ast.unparse(defaults[n])}" if n in defaults else n for n in function.parameters
        ]
        first = ["b"] if function.bound else []
        lines = textwrap.indent("\n".join(reads + body), "    ")
        return f"def {function.name}({', '.join(first + heads)}):\n{lines}"

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
        if all(isinstance(target, ast.Tuple) for target in node.targets):
            node.value = without_list(node.value)
        return self.generic_visit(node)

    def visit_For(self, node: ast.For) -> Any:
        source = node.iter
        if isinstance(source, ast.Call) and isinstance(source.func, ast.Name):
            if self.read(source.func.id) is any_order:
                source.func = ast.copy_location(ast.Name("range", ast.Load()), source.func)
                node.type_comment = ANY_ORDER
            source.args = [copied_list(argument) for argument in source.args]
        node.iter = copied_list(source)
        return self.generic_visit(node)

    def visit_AugAssign(self, node: ast.AugAssign) -> Any:
        node.value = self.visit(node.value)
        if isinstance(node.target, ast.Attribute):
            self.stored(node.target)
        node.target = self.visit(node.target)
        return node

    def stored(self, node: ast.Attribute) -> None:
        whole = isinstance(node.value, ast.Name) and node.value.id == "state"
        if not whole or node.attr not in type(self.owner.made).spec.states:
            text = f"assigns to '{ast.unparse(node)}', which is no State"
            raise self.refuse(node, f"{text}; declare a State for what changes")

    def visit_Attribute(self, node: ast.Attribute) -> Any:
        if isinstance(node.value, ast.Name) and node.value.id not in self.locals:
            owner = node.value.id
            if self.bound and owner in ("self", "state"):
                if not isinstance(node.ctx, ast.Load):
                    # Assigning to a state copies into its array.
                    self.stored(node)
                    load = self.entry(ast.Attribute(node.value, node.attr, ast.Load()), owner)
                    return ast.Subscript(load, ast.Constant(...), node.ctx)
                return self.entry(node, owner)
            module = self.read(owner)
            if isinstance(module, types.ModuleType):
                value = getattr(module, node.attr, None)
                if value is None:
                    raise self.refuse(node, f"'{owner}' has no '{node.attr}'")
                if module not in MODULES:
                    raise self.refuse(node, f"uses the module '{owner}'")
                if self.is_own:
                    self.owner.read(vars(module), node.attr, value)
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
        if isinstance(function, ast.Name) and self.is_builtin(function.id):
            if function.id == "tuple" and len(node.args) == 1 and is_call(node.args[0], "tolist"):
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
        return self.generic_visit(node)

    def called(self, node: ast.Call, attribute: str, method: types.MethodType) -> Any:
        """A call of one of the block's own methods, or of a signal type's ``pack``."""
        if isinstance(method.__self__, SignalType) and method.__name__ == "pack":
            return self.packed(method.__self__, node.args[0])
        own = method.__self__ is self.owner.made
        if not own or getattr(type(self.owner.made), attribute) is not method.__func__:
            raise self.refuse(node, unknown_call(ast.unparse(node.func)))
        arguments = [
            self.visit(a) for a in node.args if not (isinstance(a, ast.Name) and a.id == "state")
        ]
        name = self.owner.method(attribute)
        keywords = [ast.keyword(k.arg, self.visit(k.value)) for k in node.keywords]
        unit = ast.Name("b", ast.Load())
        return ast.Call(ast.Name(name, ast.Load()), [unit, *arguments], keywords)

    def packed(self, kind: SignalType, array: ast.expr) -> Any:
        """An array of a signal's shape in the signal's own form."""
        inner = self.visit(array)
        if kind.form == "array":
            return ast.Call(ast.Attribute(inner, "copy", ast.Load()), [], [])
        if kind.form == "scalar":
            return ast.Subscript(inner, ast.Tuple([], ast.Load()), ast.Load())
        return entries_of(inner, len(kind.components))

    def spelled(self, array: ast.expr) -> Any:
        """``tuple(state.x.tolist())`` with the length that the array has."""
        inner = self.visit(array)
        value = self.owner.fields.get(inner.id) if isinstance(inner, ast.Name) else None
        if not isinstance(value, np.ndarray) or value.ndim != 1:
            raise self.refuse(array, "makes a tuple of an array of unknown length")
        return entries_of(inner, len(value))

    def visit_Name(self, node: ast.Name) -> Any:
        name = node.id
        if name in self.locals or (self.bound and name == "b"):
            return node
        if self.bound and name in ("self", "state"):
            raise self.refuse(node, f"passes '{name}' on")
        value = self.read(name)
        if name not in self.function.__globals__:
            return node  # a builtin
        if isinstance(value, types.FunctionType):
            if value in PRIMITIVES:
                return ast.Name(PRIMITIVES[value], ast.Load())
            return ast.Name(self.owner.function(value), ast.Load())
        of = getattr(value, "__name__", "")
        for module, short in MODULES.items():
            if callable(value) and getattr(module, of, None) is value:
                return ast.Attribute(ast.Name(short, ast.Load()), of, node.ctx)
        if isinstance(value, (bool, int, float, str)):
            return constant(value)
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


HEADER = """import math

import numpy as np

from blocks.core.polynomials import exponent_of, power_of_two
"""


@dataclass(frozen=True)
class Translated:
    """A block as compiled text.

    source : one function for each of ``methods``, those that they call, and the entries' types.
    text : the same as a Python module.
    fields : what the text depends on.
    """

    source: Source
    text: str
    methods: dict[str, str]
    fields: Fields


def translate(made: Block, state: BlockState, terms: dict[str, int]) -> Translated:
    """Write all methods of a block that the plan calls.

    Parameters
    ----------
    made, state : the block, and its state after ``start``.
    terms : the number of wires of each variadic input.

    Raises
    ------
    NotCompilableError : naming the reason.
    """
    translator = Translator(made, state, terms)
    spec = type(made).spec
    wanted = [evaluation.method for evaluation in spec.evaluations]
    others = (spec.update, spec.derivative, spec.guards, spec.event)
    wanted += [each.method for each in others if each is not None]
    wanted += ["project"] if spec.projects else []
    methods = {name: translator.method(name) for name in wanted}
    text = "\n\n".join([HEADER, *translator.texts.values()]) + "\n"
    types = {key: type_of(value) for key, value in translator.fields.items()}
    fields = Fields(
        tuple(translator.attributes.values()),
        type_texts(translator.fields.values()),
        translator.constants,
        tuple(translator.reads.values()),
    )
    return Translated(Source(translator.functions, types), text, methods, fields)


def translate_functions(functions: Sequence[Any]) -> Source:
    """Functions of no block, and those that they call."""
    translator = Translator(None, None, {})
    for function in functions:
        translator.function(function)
    return Source(translator.functions)


class Translator:
    """Collects the functions and fields of one block."""

    def __init__(self, made: Any, state: Any, terms: dict[str, int]) -> None:
        self.made, self.state, self.terms = made, state, terms
        self.fields: dict[str, Any] = {}
        self.attributes: dict[str, Attribute] = {}
        self.constants: dict[Attribute, Any] = {}
        self.functions: dict[str, Function] = {}
        self.texts: dict[str, str] = {}
        self.names: dict[Any, str] = {}
        self.reads: dict[tuple[int, str], Read] = {}

    def read(self, owner: Any, name: str, value: Any) -> None:
        """Note what the text depends on."""
        self.reads.setdefault((id(owner), name), Read(owner, name, value))

    def method(self, name: str) -> str:
        """The name of a method's function; writes the function if needed."""
        cls = type(self.made)
        method = getattr(cls, name)
        if not is_built_in(cls):
            self.read(cls, name, method)
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
            named = getattr(function, "__name__", function)
            raise NotCompilableError(f"'{named}' is not a function")
        name = function.__name__
        while name in self.names.values() or name in PRIMITIVES.values():
            name += "_"
        self.names[function] = name
        writer = Writer(self, function, bound)
        if writer.is_own:
            for each in ("__code__", "__defaults__"):
                self.read(function, each, getattr(function, each))
        made = writer.written(name)
        self.functions[name] = made
        self.texts[name] = writer.text(made)
        return name

    def field(self, owner: str, name: str, value: Any) -> str:
        """The local name of an entry of ``b``."""
        key = f"{owner}_{name}"
        if key not in self.fields:
            self.fields[key] = plain(value, f"{owner}.{name}")
            self.attributes[key] = (owner, name)
        return key
