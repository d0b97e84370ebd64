"""The network of a document: blocks constructed, wires resolved, types and units checked.

In: a complete document. Out: a frozen :class:`Network`, and every problem with its location. One
room for each step, in this order:

    expansion     $names filled in, a scope for each part     (repetition: copies of a part)
    block_types   names of types -> classes                   build: blocks constructed
    wiring        addresses -> wires between blocks           (addresses, components)
    removal       without, bypass                             (replacement: before)
    inference     signal types and lengths along the wires    (components)
    units         units that contradict each other            open_inputs: what lacks a wire
    contexts      each block's check of its place             ticks: steps, and notes on them
    ports         inputs and outputs of the graph             initial: states of earlier runs
"""

from runtime.network.addresses import AddressError, Endpoint, ReportedError, find, is_range
from runtime.network.block_types import is_variadic, own_object, source_file
from runtime.network.build import BLOCK_KEYS, BlockCache, build, parameters_of
from runtime.network.components import (
    columns,
    component_type,
    first_column,
    unknown_component,
)
from runtime.network.contexts import MAX_BYTES, enables_of, resets, whole_shape
from runtime.network.declared_port import PortDeclaration
from runtime.network.expansion import expand
from runtime.network.initial import STATES
from runtime.network.network import Network, NetworkEntry, Wire, check_output
from runtime.network.open_inputs import fits, outputs_in
from runtime.network.other_names import ours_for
from runtime.network.ports import GraphOutput
from runtime.network.removal import follow, missing_block
from runtime.network.repetition import copy_name
from runtime.network.replacement import discretize, replace_block
from runtime.network.scope import INPUTS, Scope
from runtime.network.ticks import off_ticks
