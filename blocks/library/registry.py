"""Which block types exist: the library's, those of installed packages, those of a Python file."""

from __future__ import annotations

import importlib.util
import linecache
import sys
import threading
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path as FilePath
from types import ModuleType
from typing import TypeVar

from blocks.core import Block, GraphInput, SignalType, Variant
from blocks.files import read
from blocks.library.extensions import PREFIX, Registry
from blocks.library.index import TYPES
from blocks.limits import MODULE

_T = TypeVar("_T")
# A module is registered before its code has run: other threads must not see it until then.
_LOADING = threading.RLock()
_CONTENT = "__spikeblocks_content__"


# Those of installed packages as well.
BLOCKS: Registry[type[Block]] = Registry(
    "blocks",
    Block,
    "a subclass of Block",
    lazy={name: f"blocks.{module}:{name}" for name, module in TYPES.items()},
    classes=True,
)


class _Library(Mapping[str, type[Block]]):
    """The library's types by name, those of its bridges included; each is imported on look-up."""

    def __getitem__(self, name: str) -> type[Block]:
        found = BLOCKS.get(name) if BLOCKS.is_library(name) else None
        if found is None:
            raise KeyError(name)
        return found

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and BLOCKS.is_library(name)

    def __iter__(self) -> Iterator[str]:
        return iter(BLOCKS.library())

    def __len__(self) -> int:
        return len(BLOCKS.library())


BUILTIN: Mapping[str, type[Block]] = _Library()


def is_built_in(cls: type[Block]) -> bool:
    """Whether a block class is one of ours: not of a package, nor of a graph's own file."""
    is_bridge = cls.__module__.startswith(PREFIX)
    return is_bridge or cls is GraphInput or f"blocks.{TYPES.get(cls.__name__)}" == cls.__module__


def blocks_of_module(file: FilePath) -> dict[str, type[Block]]:
    """Block types that a Python file defines; the file is run once per process and version.

    The content that ran is also what the compiled engine, tracebacks and run folders see, even if
    the file changes later.

    Raises
    ------
    OSError, SyntaxError and whatever the file itself raises.
    """
    return _defined(file, Block)


def variants_of_module(file: FilePath, family: type[Variant]) -> dict[str, type[Variant]]:
    """Settings of a family, such as neuron models, that a Python file defines.

    Raises
    ------
    OSError, SyntaxError and whatever the file itself raises.
    """
    return _defined(file, family)


def objects_of_module(file: FilePath, kind: type[_T]) -> dict[str, tuple[_T, dict[str, bytes]]]:
    """The objects of a class, such as kinds of metrics, that a Python file names.

    Returns
    -------
    dict : for each name the object, and the content that was run, by resolved path.

    Raises
    ------
    OSError, SyntaxError and whatever the file itself raises.
    """
    module = _module(file)
    text: dict[str, bytes] = getattr(module, _CONTENT)
    return {name: (value, text) for name, value in vars(module).items() if isinstance(value, kind)}


def types_of_module(file: FilePath) -> list[SignalType]:
    """Signal types among the names of a Python file, the library's that it imports included.

    Raises
    ------
    OSError, SyntaxError and whatever the file itself raises.
    """
    return [value for value in vars(_module(file)).values() if isinstance(value, SignalType)]


class PendingModuleError(Exception):
    """A file is still being imported by another process, which tells when it is done."""


@dataclass(frozen=True)
class ModuleReader:
    """How the Python files that a graph names are read; an editor lets another process do it.

    ``blocks`` and ``signal_types`` are as :func:`blocks_of_module` and :func:`types_of_module`.
    """

    blocks: Callable[[FilePath], Mapping[str, type[Block]]] = blocks_of_module
    signal_types: Callable[[FilePath], list[SignalType]] = types_of_module


# Whether the Python files that a graph names are imported, or how they are read instead.
Modules = bool | ModuleReader


def _defined(file: FilePath, family: type[_T]) -> dict[str, type[_T]]:
    """The subclasses of a class that the file itself defines, not those it imports."""
    module = _module(file)
    return {
        key: value
        for key, value in vars(module).items()
        if isinstance(value, type)
        and issubclass(value, family)
        and value.__module__ == module.__name__
    }


def _module(file: FilePath) -> ModuleType:
    with _LOADING:
        return _loaded(file)


def _loaded(file: FilePath) -> ModuleType:
    import hashlib

    data, where = read(file, MODULE), str(file.resolve())
    digest = hashlib.sha256(where.encode("utf-8", "backslashreplace") + b"\0" + data)
    name = f"_blocks_of_{file.stem}_{digest.hexdigest()[:16]}"
    module = sys.modules.get(name)
    if module is None:
        spec = importlib.util.spec_from_file_location(name, file)
        if spec is None or spec.loader is None:
            raise ImportError(f"{file} is not a Python file")
        module = importlib.util.module_from_spec(spec)
        setattr(module, _CONTENT, {where: data})
        sys.modules[name] = module
        try:
            code = compile(data, str(file), "exec", dont_inherit=True)
            lines = importlib.util.decode_source(data).splitlines(keepends=True)
            # Without a modification time linecache keeps the entry even if the file changes.
            linecache.cache[str(file)] = (len(data), None, lines, str(file))
            exec(code, vars(module))
        except BaseException:
            del sys.modules[name]
            raise
    return module


def block_texts(cls: type[Block], block: Block | None) -> dict[str, bytes]:
    """The contents of the files that a block was made from, by resolved path."""
    if block is None:
        return _text(cls)
    settings = [
        value for name in cls.spec.params if isinstance(value := block.value(name), Variant)
    ]
    texts = [_text(kind) for kind in (cls, *map(type, settings))]
    return {path: text for each in (*texts, block.files) for path, text in each.items()}


def _text(cls: type) -> dict[str, bytes]:
    """The content of the file that was run for a class, by resolved path; {} for the library's."""
    found: dict[str, bytes] = getattr(sys.modules.get(cls.__module__), _CONTENT, {})
    return found
