"""Translations of blocks, kept on disk: a start finds the C of a block without reading its source.

In go a block and its state, out comes the key of its C text, from disk where it is known:

    translation(Gain(gain=2.0), state, {}, records)    read from translation_3f...json
    translation(Gain(gain=3.0), state, {}, records)    the same: numbers are no part of the text

A translation depends on the files of the package, and on the attributes of the block and of its
state: their types and shapes, and the values of strings and flags. Both make its name. Blocks that
are not built in are translated at every start, since their source may be anywhere.
"""

from __future__ import annotations

import hashlib
import os
import sys
import types
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import blocks
from blocks.core import Block, BlockState, SignalType
from blocks.files import read
from blocks.library.registry import is_built_in
from blocks.limits import MODULE
from runtime import codegen
from runtime.codegen import CFunction, Source
from runtime.compiler.fields import WRITTEN, Fields, NotCompilableError
from runtime.toolchain import digest, read_record, write_record

LITERALS = (str, bool, type(None))


@dataclass(frozen=True)
class Translation:
    """What is known of a block's translation without its text.

    methods : the function of each method.
    fields : the attributes that it depends on.
    key : says what the text is.
    """

    methods: Mapping[str, str]
    fields: Fields
    key: str


class Records:
    """The cache's records that one compilation uses, each read and parsed once.

    Blocks of one type share the C text of theirs: 10,000 blocks of four types hold four texts.

    ``translations`` has those of this compilation by block type and signature, ``functions`` the
    typed form of the units that it has written, by record.

    Parameters
    ----------
    typed : whether all units are written again, since the cache has no typed form.
    """

    def __init__(self, typed: bool = False) -> None:
        self.typed = typed
        self.functions: dict[str, Mapping[str, CFunction]] = {}
        self._known: dict[str, Any] = {}
        self.translations: dict[tuple[type, str], Translation] = {}

    def read(self, name: str) -> Any:
        """A record; None if there is none."""
        if name not in self._known:
            is_written_again = self.typed and name.startswith("block_")
            self._known[name] = None if is_written_again else read_record(name)
        return self._known[name]

    def write(
        self, name: str, record: Any, functions: Mapping[str, CFunction] | None = None
    ) -> None:
        """Store a record."""
        write_record(name, record)
        self._known[name] = record
        self.functions[name] = functions or {}


def translation(
    made: Block, state: BlockState, terms: dict[str, int], records: Records
) -> Translation:
    """The translation of a block, from the cache if it is there.

    Parameters
    ----------
    made, state : the block, and its state after ``start``.
    terms : the number of wires of each variadic input.
    records : of the cache.

    Raises
    ------
    NotCompilableError : naming the reason.
    """
    try:
        signature = "\n".join(_signature(made, state, terms))
    except _UnnamedFunctionError:
        return _find(made, state, terms, records, "")
    key = (type(made), signature)
    known = records.translations.get(key)
    if known is None or known.fields.fitting(made, state) is None:
        stored = is_built_in(type(made))
        name = f"translation_{digest(salt(), signature)}.json" if stored else ""
        known = records.translations[key] = _find(made, state, terms, records, name)
    return known


def _find(
    made: Block, state: BlockState, terms: dict[str, int], records: Records, name: str
) -> Translation:
    """The translation of a block: the record of this name, or a new one; "" is never stored."""
    record = records.read(name) if name else None
    if record is not None:
        if "refused" in record:
            raise NotCompilableError(record["refused"])
        constants = {(owner, key): _restored(value) for owner, key, value in record["constants"]}
        attributes = tuple((owner, key) for owner, key in record["attributes"])
        fields = Fields(attributes, tuple(record["types"]), constants)
        if fields.fitting(made, state) is not None:
            return Translation(record["methods"], fields, record["key"])
    try:
        found = _translate(made, state, terms)
    except NotCompilableError as error:
        if name:
            records.write(name, {"refused": str(error)})
        raise
    fields = found.fields
    if name:
        constants_list = [[*key, _kept(value)] for key, value in fields.constants.items()]
        record = {"methods": found.methods, "key": found.key, "constants": constants_list}
        records.write(name, {**record, "attributes": fields.attributes, "types": fields.types})
    return found


def source_of(made: Block, state: BlockState, terms: dict[str, int]) -> Source:
    """The functions of a block, to be written as C."""
    from runtime.compiler.translate import translate

    return translate(made, state, terms).source


def _translate(made: Block, state: BlockState, terms: dict[str, int]) -> Translation:
    # Imported where something is translated: most starts find everything in the cache.
    from runtime.compiler.translate import translate

    try:
        found = translate(made, state, terms)
    except NotCompilableError:
        raise
    except Exception as error:
        # A fault of the translator must not end a run that Python can do.
        text = f"cannot be translated: {type(error).__name__}: {error}"
        raise NotCompilableError(text) from error
    places = [(f.file, f.line) for f in found.source.functions.values()]
    key = digest(found.text, repr(found.source.entries), repr(places))
    return Translation(found.methods, found.fields, key)


class _UnnamedFunctionError(Exception):
    """An attribute is a function that is not one of a module of the package."""


def _kept(value: Any) -> Any:
    """A constant as it is stored; functions by name."""
    return [value.__module__, value.__name__] if isinstance(value, types.FunctionType) else value


def _restored(value: Any) -> Any:
    return getattr(sys.modules.get(value[0]), value[1], None) if isinstance(value, list) else value


def _signature(made: Block, state: BlockState, terms: dict[str, int]) -> Iterator[str]:
    """Everything that a translation may depend on, apart from files."""
    yield f"{type(made).__name__} {sorted(terms.items())} {made.indirect!r} {WRITTEN.get()}"
    for owner in (made, state):
        for name, value in sorted(vars(owner).items()):
            yield f"{name} {_described(value)}"


def _described(value: Any) -> str:
    """The type of a value, its shape, and the values of strings and flags."""
    if isinstance(value, LITERALS):
        return repr(value)
    if isinstance(value, np.ndarray):
        return f"{value.dtype} {value.shape}"
    if isinstance(value, tuple):
        return f"({', '.join(map(_described, value))})"
    if isinstance(value, types.FunctionType):
        name = _kept(value)
        inside = str(value.__module__).startswith(f"{blocks.__name__}.")
        if not inside or _restored(name) is not value:
            raise _UnnamedFunctionError
        return repr(name)
    if isinstance(value, types.MethodType):
        return f"{_described(value.__self__)} {value.__name__}"
    return repr(value) if isinstance(value, SignalType) else type(value).__qualname__


@cache
def salt(*packages: types.ModuleType) -> str:
    """What translations and C texts depend on, apart from blocks of the user's own.

    Parameters
    ----------
    packages : others whose functions are translated.
    """
    found = hashlib.sha256(sys.version.encode())
    folders = [Path(str(package.__file__)).parent for package in (blocks, codegen, *packages)]
    for folder in (Path(__file__).parent, *folders):
        for parent, _, names in sorted(os.walk(folder)):
            for name in sorted(names):
                if name.endswith((".py", ".h")):
                    content = read(Path(parent, name), MODULE)
                    found.update(f"{parent} {name} {len(content)} ".encode() + content)
    return found.hexdigest()
