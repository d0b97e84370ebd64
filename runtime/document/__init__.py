"""The text of a graph: YAML read into an immutable tree with positions, files merged, edits made.

A :class:`Node` is a value with its position; every change returns a new tree.
"""

from runtime.document.edits import (
    Override,
    add_block,
    add_entry,
    add_names,
    add_wire,
    full_path,
    names_in,
    set_entry,
    set_wire,
)
from runtime.document.limits import MAX_BLOCKS, Work
from runtime.document.loader import (
    SHIPPED,
    complete_document,
    decoded,
    find_file,
    merge,
    read_file,
    read_graph,
    shipped_graphs,
)
from runtime.document.node import Node, dump_yaml, from_python, parse_yaml
from runtime.document.run_section import (
    DEFAULT_MEMORY,
    MAX_TICKS,
    RUN_CHOICES,
    STOP_DOCS,
    Solver,
    Stop,
    read_run,
    seconds,
)
from runtime.document.scalars import parse_scalar
from runtime.document.sections import (
    EXAMPLES,
    PART_SECTIONS,
    RUN_DOCS,
    RUN_KEYS,
    SECTIONS,
    check_keys,
    closest,
    expected,
    in_order,
    is_part,
    misnamed,
    misspelt,
    section,
    texts,
)
from runtime.document.substitution import fill_sections
from runtime.document.writer import flow_yaml

__all__ = [
    "DEFAULT_MEMORY",
    "EXAMPLES",
    "MAX_BLOCKS",
    "MAX_TICKS",
    "PART_SECTIONS",
    "RUN_CHOICES",
    "RUN_DOCS",
    "RUN_KEYS",
    "SECTIONS",
    "SHIPPED",
    "STOP_DOCS",
    "Node",
    "Override",
    "Solver",
    "Stop",
    "Work",
    "add_block",
    "add_entry",
    "add_names",
    "add_wire",
    "check_keys",
    "closest",
    "complete_document",
    "decoded",
    "dump_yaml",
    "expected",
    "fill_sections",
    "find_file",
    "flow_yaml",
    "from_python",
    "full_path",
    "in_order",
    "is_part",
    "merge",
    "misnamed",
    "misspelt",
    "names_in",
    "parse_scalar",
    "parse_yaml",
    "read_file",
    "read_graph",
    "read_run",
    "seconds",
    "section",
    "set_entry",
    "set_wire",
    "shipped_graphs",
    "texts",
]
