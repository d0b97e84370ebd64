"""A model's Python file executed, its network and the names that its author gave to the objects.

In: ``model.py`` or ``model.py:name``. Out: the network, and a name for each object::

    names(network, {"a": ensemble})        # {ensemble: "a"}
"""

from __future__ import annotations

import keyword
import os
import re
import runpy
import sys
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import nengo

from runtime.errors import ROOT, SpikeblocksError, UsageError, raised_at, raised_text


@contextmanager
def functions_of(source: str) -> Iterator[None]:
    """What a model's functions raise when they are called, or Nengo about the model.

    Raises
    ------
    UsageError : they did; a SystemExit would else end the command with exit code 0.
    """
    try:
        yield
    except (SpikeblocksError, KeyboardInterrupt):
        raise
    except BaseException as error:
        place = Path(raised_at(error).rpartition(":")[0]).resolve()
        if place.is_relative_to(ROOT / "runtime") or place.is_relative_to(ROOT / "blocks"):
            raise  # a fault of ours
        raise UsageError(f"'{source}' fails: {raised_text(error)}") from None


def read_network(source: str) -> tuple[Any, dict[str, Any]]:
    """The network of a file, and the file's variables.

    Raises
    ------
    UsageError : the file fails, or has no network, or several and no name was given.
    """
    path, _, name = source.partition(":") if not Path(source).is_file() else (source, "", "")
    if not Path(path).is_file():
        raise UsageError(f"there is no file '{path}'; expected a Python file with a nengo.Network")
    # Its cache on disk would be written by every import.
    nengo.rc["decoder_cache"]["enabled"] = "False"
    here, streams = Path.cwd(), (sys.stdout, sys.stderr)
    try:
        variables = runpy.run_path(path, run_name="nengo_model")
    except BaseException as error:  # noqa: BLE001 -- a user's file may raise anything
        raise UsageError(f"'{path}' fails: {raised_text(error)}") from None
    finally:  # files and messages go where they would have gone
        os.chdir(here)
        sys.stdout, sys.stderr = streams
    networks = {k: v for k, v in variables.items() if isinstance(v, nengo.Network)}
    inner = {id(n) for network in networks.values() for n in network.all_networks}
    outer = {k: v for k, v in networks.items() if id(v) not in inner}
    if name:
        made = variables.get(name)
        if callable(made) and not isinstance(made, nengo.Network):
            made = made()
        if isinstance(made, nengo.Network):
            return made, variables
        known = ", ".join(networks) or "none"
        raise UsageError(f"'{path}' has no network '{name}'; it has {known}")
    if len({id(v) for v in outer.values()}) != 1:
        known = ", ".join(outer) or "none"
        raise UsageError(f"expected one network in '{path}', got {known}; write {path}:NAME")
    return next(iter(outer.values())), variables


def names(network: Any, variables: Mapping[str, Any]) -> dict[Any, str]:
    """A name for each object: its variable, its label, or those of the networks around it."""
    found: dict[Any, str] = {}
    taken: set[str] = set()

    def name(thing: Any, proposal: str) -> None:
        text = re.sub(r"\W+", "_", proposal, flags=re.ASCII).strip("_").lower() or "block"
        text = f"n{text}" if text[0].isdigit() or keyword.iskeyword(text) else text
        number = 2
        unique = text
        while unique in taken:
            unique, number = f"{text}{number}", number + 1
        taken.add(unique)
        found[thing] = unique

    for path, thing in _attributes(network, variables):
        if thing not in found:
            name(thing, path)
    inner = (n for n in network.all_networks if n is not network)
    for thing in (*inner, *network.all_ensembles, *network.all_nodes, *network.all_probes):
        if thing not in found:
            name(thing, thing.label or type(thing).__name__)
    return found


def _attributes(network: Any, variables: Mapping[str, Any]) -> Iterable[tuple[str, Any]]:
    """Variables that hold objects of the network, and attributes of networks within it."""
    kinds = (nengo.Ensemble, nengo.Node, nengo.Probe, nengo.Network)
    own = {*network.all_objects, *network.all_networks}
    for key, value in variables.items():
        if isinstance(value, kinds) and value in own and not key.startswith("_"):
            yield key, value
    waiting = [(key, v) for key, v in variables.items() if isinstance(v, nengo.Network)]
    waiting += [("", network)]
    waiting += [(n.label or "", n) for n in network.all_networks]
    for prefix, each in waiting:
        path = "" if each is network else prefix
        for key, value in vars(each).items():
            if isinstance(value, kinds) and value in own and not key.startswith("_"):
                yield f"{path}_{key}" if path else key, value
