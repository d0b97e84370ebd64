"""A graph's file as data: YAML becomes an immutable tree with positions, files merge, edits apply.

In: the name of a file. Out: one :class:`Node` tree with everything that the file extends and
contains, in which ``$names`` are not filled in yet; or every problem with its position.

    node, parse_errors, scalars   text -> tree         writer   tree -> text
    loader      extends and parts merged               limits   how much work that may be
    edits       --set, --without: a new tree; the difference of two
    substitution   $names -> values
    sections    which keys there are                   run_section    run: -> RunSection

Every change returns a new tree that shares what it does not change.
"""

from runtime.document.arrays import (
    arrays_beside,
    arrays_in,
    with_folder,
)
from runtime.document.edits import (
    Override,
    add_block,
    add_entry,
    add_names,
    add_wire,
    changed_paths,
    difference,
    full_path,
    names_in,
    same,
    set_entry,
    set_wire,
)
from runtime.document.limits import MAX_BLOCKS, Work
from runtime.document.loader import (
    SHIPPED,
    Source,
    complete_document,
    decode,
    find_file,
    merge,
    read_file,
    read_graph,
    shipped_graphs,
)
from runtime.document.node import Node, Value, dump_yaml, from_python, parse_yaml
from runtime.document.run_keys import MAX_TICKS, STOP_DOCS, Stop, read_seed, seconds
from runtime.document.run_section import RUN_KEYS, RunSection, read_run
from runtime.document.scalars import parse_scalar
from runtime.document.sections import (
    EXAMPLES,
    FILE_SECTIONS,
    PART_SECTIONS,
    SECTIONS,
    check_keys,
    expected_form,
    in_order,
    is_part,
    misspelt_keys,
    name_problem,
    read_title,
    rename_files,
    section,
    strings,
)
from runtime.document.substitution import INDEX, fill_sections, uses_index, without_unused
from runtime.document.time_units import SECOND, TIME_UNITS, in_time, rate_text
from runtime.document.writer import flow_yaml
