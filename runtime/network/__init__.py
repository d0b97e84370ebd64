"""The network of a document: blocks constructed, wires resolved, types and units checked.

:func:`build` returns a frozen :class:`Network` and collects every problem with its location.
"""

from runtime.network.addresses import AddressError, Endpoint, ReportedError, find
from runtime.network.block_types import is_variadic, source_file
from runtime.network.build import build
from runtime.network.components import columns, component_type, is_range, unknown_component
from runtime.network.network import Entry, Network, Wire, check_output
from runtime.network.removal import follow, missing_block
from runtime.network.replacement import replace_block
from runtime.network.scope import expand
from runtime.network.shapes import MAX_BYTES, state_shape, whole_shape

__all__ = [
    "MAX_BYTES",
    "AddressError",
    "Endpoint",
    "Entry",
    "Network",
    "ReportedError",
    "Wire",
    "build",
    "check_output",
    "columns",
    "component_type",
    "expand",
    "find",
    "follow",
    "is_range",
    "is_variadic",
    "missing_block",
    "replace_block",
    "source_file",
    "state_shape",
    "unknown_component",
    "whole_shape",
]
