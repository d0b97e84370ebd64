"""Block types: from a name in a graph to a class of the library or of the user.

In: an entry such as ``{type: Mine, module: mine.py}``. Out: its class; None, and a problem with a
suggestion, if there is none. Importing a user's file may run anything, so each failure of it is a
problem at the entry, and ``modules`` says whether files are imported at all.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import TypeVar

from blocks.core import (
    TYPES,
    Block,
    DeclarationError,
    Names,
    SettingError,
    SignalType,
    Variant,
    misspelt,
    similar,
)
from blocks.files import opened
from blocks.library.extensions import BrokenPackageError
from blocks.library.registry import (
    BLOCKS,
    BUILTIN,
    ModuleReader,
    Modules,
    PendingModuleError,
    objects_of_module,
    variants_of_module,
)
from blocks.limits import MODULE
from blocks.messages import Message
from runtime.document import Node, section
from runtime.errors import Problems, UsageError, raised_at, raised_text
from runtime.network.other_names import ours_for

Kind = TypeVar("Kind")
Object = TypeVar("Object")


def block_class(
    node: Node,
    address: str,
    classes: Mapping[str, type[Block]],
    problems: Problems,
    modules: Modules = True,
) -> type[Block] | None:
    """The class that a block's entry names; None, and a problem, if it does not exist.

    With ``modules=False`` blocks with a ``module`` are refused, and nothing is imported.
    """
    type_node = node.get("type")
    if type_node is None or not isinstance(type_node.value, str):
        _report_no_type(node, address, problems)
        return None
    module = node.get("module")
    if module is not None and not modules:
        _report_refusal(module, type_node, f"{address}.type", problems)
        return None
    own: Mapping[str, type[Block]] | None = {}
    if module is not None:
        own = _import_file(module, address, problems, _reader(modules).blocks)
    if own is None:
        return None
    # The nearest first; the library and packages come last: to install one changes no graph.
    found = own.get(type_node.value) or classes.get(type_node.value)
    try:
        found = found or BLOCKS.find(type_node.value)
    except BrokenPackageError as error:
        problems.add(type_node.where, f"{address}.type", str(error))
        return None
    if found is not None and found.executes and not modules:
        message = f"a block '{type_node.value}' executes {found.executes}, which is refused"
        problems.add(type_node.where, f"{address}.type", f"{message} (--no-modules)")
        return None
    if found is not None:
        return found
    if module is None:
        ours = ours_for(type_node.value)
        known = [] if ours else [*classes, *BLOCKS.names()]
        other = ours or "; see 'runtime blocks'; your own block needs 'module: file.py'"
    else:
        known, other = [*own], f"; '{short_path(module)}' defines {', '.join(own) or 'none'}"
    text = f"no block type '{type_node.value}'"
    message = misspelt("unknown-type", text, type_node.value, known, other)
    problems.add(type_node.where, f"{address}.type", message)
    return None


def _report_no_type(node: Node, address: str, problems: Problems) -> None:
    type_node = node.get("type")
    got = "" if type_node is None else f", got {type_node.describe()}"
    where = node.key if type_node is None else type_node.where
    text = f"expected a type, as in {{type: Sum}}{got}; see 'runtime blocks'"
    message = Message(text, "missing-type")
    near = similar("type", [key for key, _ in node.items()])
    misspelt_node = node.get(near)
    if type_node is None and misspelt_node is not None:
        where = misspelt_node.key
        message = misspelt("unknown-key", f"unknown key '{near}'", near, ["type"])
    problems.add(where, address, message)


def own_variant(
    node: Node, family: type[Variant], address: str, problems: Problems, modules: Modules
) -> type[Variant] | None:
    """The class that a setting with a ``module`` names, as ``neuron: {type: Mine, module: m.py}``.

    None, and a problem, if there is none; None alone if another process reads modules.
    """
    read = partial(variants_of_module, family=family)
    return _named_of_file(node, family.key, family.expected, read, address, problems, modules)


def own_object(
    node: Node,
    kind: type[Object],
    expectation: str,
    address: str,
    problems: Problems,
    modules: Modules,
) -> tuple[Object, dict[str, bytes]] | None:
    """What an entry with a ``module`` names as its ``kind``, and the files that were run for it.

    None, and a problem, if there is none; None alone if another process reads modules.
    """
    read = partial(objects_of_module, kind=kind)
    return _named_of_file(node, "kind", expectation, read, address, problems, modules)


def _named_of_file(
    node: Node,
    key: str,
    expectation: str,
    read: Callable[[Path], Mapping[str, Kind]],
    address: str,
    problems: Problems,
    modules: Modules,
) -> Kind | None:
    """What the entry ``key`` names among what ``read`` finds in the file under ``module``."""
    module, name_node = node.value["module"], node.get(key)
    if not modules:
        _report_refusal(module, name_node or node, f"{address}.{key}", problems)
        return None
    if isinstance(modules, ModuleReader):
        return None
    own = _import_file(module, address, problems, read)
    if own is None:
        return None
    name = None if name_node is None else name_node.value
    if isinstance(name, str) and name in own:
        return own[name]
    definitions = f"; '{short_path(module)}' defines {', '.join(own) or 'none'}"
    got = "nothing" if name_node is None else name_node.describe()
    text, known = f"expected {expectation} of that file, got {got}", () if name is None else own
    message = misspelt("unknown-type", text, name, known, definitions)
    problems.add(node.where if name_node is None else name_node.where, f"{address}.{key}", message)
    return None


def _report_refusal(module: Node, name_node: Node, address: str, problems: Problems) -> None:
    message = f"'{short_path(module)}' was not imported, since modules are refused (--no-modules)"
    problems.add(name_node.where, address, f"{message}; its types are unknown")


def is_variadic(document: Node, target: str, classes: Mapping[str, type[Block]]) -> bool:
    """Whether ``block.input`` is known to take several wires."""
    name, _, port = target.partition(".")
    entry = (document.get("blocks") or Node({})).get(name) or Node({})
    type_node = entry.get("type") or Node("")
    kind = str(type_node.value)
    cls = classes.get(kind) or BUILTIN.get(kind)
    declared = cls.spec.inputs.get(port) if cls is not None else None
    return declared is not None and bool(declared.variadic)


def _reader(modules: Modules) -> ModuleReader:
    return modules if isinstance(modules, ModuleReader) else ModuleReader()


def relative_with(cls: type[Block], name: str) -> str:
    """A type of the library that has a parameter or input, and the type's name in its own."""
    # A PathPID is a PID, but a TransferFunction is no Function: generic types have everyday names.
    if cls.__module__.startswith("blocks.generic."):
        return ""
    for other, cls_of_other in BUILTIN.items():
        has = name in cls_of_other.spec.params or name in cls_of_other.spec.inputs
        if has and other != cls.__name__ and cls.__name__ in other:
            return other
    return ""


def own_types(cls: type[Block], node: Node, modules: Modules = True) -> list[SignalType]:
    """Signal types, other than the library's, that a block or its ``module`` defines."""
    kinds: list[object] = [port.type for port in cls.spec.ports.values()]
    module = node.get("module")
    kinds += [] if module is None else _reader(modules).signal_types(Path(module.value))
    plain = {kind.sized(None) for kind in kinds if isinstance(kind, SignalType)}
    return sorted((kind for kind in plain if TYPES.get(kind.name) != kind), key=str)


def short_path(module: Node) -> str:
    """A module's path, relative to the current folder if it is inside."""
    path = Path(str(module.value))
    here = Path.cwd()
    return str(path.relative_to(here)) if path.is_relative_to(here) else str(path)


def _import_file(
    node: Node, address: str, problems: Problems, read: Callable[[Path], Mapping[str, Kind]]
) -> Mapping[str, Kind] | None:
    """What ``read`` finds in a Python file; None, and a problem, if that fails."""
    message = ""
    if not isinstance(node.value, str) or not node.value.endswith(".py"):
        got = f"'{short_path(node)}'" if isinstance(node.value, str) else node.describe()
        message = f"expected a Python file, got {got}"
        problems.add(node.where, f"{address}.module", message)
        return None
    file = short_path(node)
    try:
        opened(node.value, MODULE).close()
    except FileNotFoundError:
        message = f"no such file: '{file}'; paths are relative to the graph's own file"
    except OSError as error:
        message = f"cannot read '{file}': {error.strerror}"
    if message:
        problems.add(node.where, f"{address}.module", message)
        return None
    try:
        return read(Path(node.value))
    except PendingModuleError:
        text = f"'{file}' is being imported; what needs it is checked then"
        problems.wait(node.where, f"{address}.module", text)
        return None
    except SyntaxError as error:
        message = f"{file}:{error.lineno or 1}: {error.msg}"
    except DeclarationError as error:
        message = f"{raised_at(error) or file}: {error}"
    except BaseException as error:  # noqa: BLE001 -- a user's file may raise anything
        message = f"{file} failed: {raised_text(error)}"
    problems.add(node.where, f"{address}.module", message)
    return None


def source_file(cls: type[Block]) -> str:
    """The file that defines a block type, which a YAML graph names as its ``module``.

    Raises
    ------
    UsageError : there is none.
    """
    import inspect

    try:
        file = inspect.getsourcefile(cls)
    except TypeError:
        file = None
    if file is None or not Path(file).is_file():
        raise UsageError(
            f"block type {cls.__name__} is not defined in a file, so a YAML graph cannot name it; "
            "put the class into a .py file"
        )
    return str(Path(file).resolve())


def written_types(document: Node, problems: Problems) -> dict[str, SignalType]:
    """The types of the section ``types``, by name."""
    types = {}
    for name, node in section(document, "types", "types", problems).items():
        address = f"types.{name}"
        if not (name.isidentifier() and name.isascii()) or name in TYPES:
            what = "is a type of the library" if name in TYPES else "is not a name for a type"
            problems.add(node.key, address, f"'{name}' {what}; choose another name")
            continue
        try:
            rows = Names.read(node.plain()).rows if node.is_map else ()
        except (SettingError, ValueError) as error:
            problems.add(node.where, address, str(error) or "expected units as texts")
            continue
        if not rows:
            message = "expected components with their units, as in {x: m, v: m/s}, got "
            problems.add(node.where, address, message + node.describe())
            continue
        names, units = zip(*rows, strict=True)
        types[name] = SignalType(name, "record", names, units)
    return types
