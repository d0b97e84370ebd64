"""The files of an import: ``my.yaml``, ``my.npz`` and ``my_blocks.py``.

In: a :class:`~spikeblocks.nengo.converted.Converted`. Out: their texts and arrays, and the files::

    blocks:
      a: {type: Ensemble, neurons: 50, gain: my.npz#a.gain, ...}
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from blocks.core import FloatArray
from runtime.document import flow_yaml
from runtime.files import Content, system_errors, write_files
from runtime.streaming import save_arrays
from spikeblocks.nengo.converted import Converted, Options
from spikeblocks.nengo.nodes import HEADER

FEW = 16  # numbers that are written into the text, if they are short


def files(
    converted: Converted, options: Options, title: str, path: Path
) -> tuple[str, dict[str, FloatArray], str]:
    """The text of the graph, the arrays beside it, and the text of its own blocks, or ''."""
    arrays: dict[str, FloatArray] = dict(converted.tables)
    archive, module = path.with_suffix(".npz").name, f"{path.stem}_blocks.py"
    lines = []
    for name, entry in converted.blocks.items():
        written = {key: _value(v, f"{name}.{key}", arrays, archive) for key, v in entry.items()}
        if "module" in written:
            written["module"] = module
        if written.get("type") == "FromFile":
            written["file"] = archive
        comment = converted.comments.get(name, "")
        lines.append(f"  {name}: {flow_yaml(written)}{f'  # {comment}' if comment else ''}")
    seed = 0 if options.seed is None else options.seed
    run = {"dt": options.dt, "until": options.until, "seed": seed}
    text = f"graph: {flow_yaml(title)}\nrun: {flow_yaml(run)}\n\nblocks:\n" + "\n".join(lines)
    text += "\n\nwires:\n"
    text += "\n".join(f"  {name}: {flow_yaml(e)}" for name, e in converted.wires.items())
    if converted.probes:
        text += "\n\nprobes:\n"
        text += "\n".join(f"  {name}: {flow_yaml(e)}" for name, e in converted.probes.items())
    own = HEADER.format(dt=options.dt) + "".join(converted.classes) if converted.classes else ""
    return text + "\n", arrays, own


def write(path: Path, text: str, arrays: dict[str, FloatArray], own: str) -> list[Path]:
    """Write the files; returns those that there are.

    Raises
    ------
    UsageError : a file cannot be written.
    """
    written: dict[Path, Content] = {}
    if arrays:
        written[path.with_suffix(".npz")] = partial(save_arrays, arrays=arrays)
    if own:
        written[path.with_name(f"{path.stem}_blocks.py")] = own
    written[path] = text
    with system_errors():
        write_files(written, folders=True)
    return [path, *(each for each in written if each != path)]


def _value(value: Any, name: str, arrays: dict[str, FloatArray], archive: str) -> Any:
    """A parameter as the text has it: short arrays are lists, others names of the archive."""
    if isinstance(value, dict):
        return {key: _value(v, f"{name}.{key}", arrays, archive) for key, v in value.items()}
    if not isinstance(value, np.ndarray):
        return value
    array = np.asarray(value, dtype=float)
    if array.size == 1 and array.ndim == 1:
        array = array.reshape(())
    is_short = all(len(f"{number:g}") <= 6 and float(f"{number:g}") == number
                   for number in array.ravel()[:FEW].tolist())  # fmt: skip
    if array.size <= FEW and is_short:
        plain = array.tolist()
        return _whole(plain)
    arrays[name] = array
    return f"{archive}#{name}"


def _whole(value: Any) -> Any:
    """Numbers without a fraction as integers, which are shorter."""
    if isinstance(value, list):
        return [_whole(each) for each in value]
    return int(value) if value == int(value) else value
