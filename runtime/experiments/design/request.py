"""What a command or a call asks of an experiment: one request for both.

In: an experiment as its file or graph says it, and options. Out: the experiment with them, checked.
The options are entries of an experiment file that were written elsewhere, so that
:func:`read_entries` reads both, and one message serves both::

    runtime sweep G --vary lqr.q.0=0.1..1:5 --sobol 0   --sobol 0: expected an integer from 1 ...
    runtime.sweep(G, {"lqr.q.0": "0.1..1:5"}, sobol=0)  sobol: expected an integer from 1 ...
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace

from runtime.document import Node, from_python, parse_yaml
from runtime.errors import Problems, UsageError, Where
from runtime.experiments.design.entries import read_entries
from runtime.experiments.design.experiment import Experiment
from runtime.experiments.design.variants import GraphVariant
from runtime.files import slug
from runtime.graph import Graph

ON_COMMAND_LINE = "--{}"
SeedList = str | int | Iterable[int]
# The changed graphs by name; on a command line, what changes the baseline.
Named = Iterable[tuple[str, Graph | Callable[[Graph], Graph]]]


@dataclass(frozen=True)
class Request:
    """Options of a command or a call; each replaces what the experiment says itself.

    Parameters
    ----------
    entries : as in an experiment file; their positions name the options.
    name : of the experiment.
    variants : of an ablation, in addition to the experiment's own.
    conditions, held_out_conditions : of a tuning's training and held-out runs.
    option : how an option is written in messages, ``--{}`` on a command line.
    """

    entries: Node
    name: str | None = None
    variants: Named = ()
    conditions: Named = ()
    held_out_conditions: Named = ()
    option: str = "{}"

    @classmethod
    def of(
        cls,
        entries: Mapping[str, object],
        *,
        vary: Iterable[tuple[str, object]] = (),
        name: str | None = None,
        variants: Named = (),
        conditions: Named = (),
        held_out_conditions: Named = (),
        option: str = "{}",
    ) -> Request:
        """The request of options as they are written, checked when they are added.

        Parameters
        ----------
        entries : values by their names in an experiment file, None or empty where not written;
            ``seeds`` and ``held_out`` are seeds such as ``"0..9"``, 3 or ``range(5)``.
        vary : a path and its values for each factor.

        Raises
        ------
        GraphError, UsageError : a value cannot be read, or a path is varied twice.
        """
        nodes: dict[str, Node] = {}
        factors: dict[str, Node] = {}
        for path, values in vary:
            if path in factors:
                raise UsageError(f"'{path}' is varied twice; keep one")
            factors[path] = _node(values, _origin(option, "vary", f"{path}={values}"))
        if factors:
            nodes["vary"] = Node(factors)
        for key, value in entries.items():
            origin = _origin(option, key, value)
            if value is None or value == []:
                continue
            if key == "seeds":
                nodes[key] = _node(value, origin)
            elif key == "held_out":
                nodes[key] = Node({"seeds": _node(value, origin)})
            elif isinstance(value, (list, tuple)):
                # Each has an origin of its own: '--constrain a' beside '--constrain b'.
                items = [from_python(item, Where(_origin(option, key, item))) for item in value]
                nodes[key] = Node(items)
            else:
                nodes[key] = from_python(value, Where(origin))
        return cls(Node(nodes), name, variants, conditions, held_out_conditions, option)

    def apply_to(self, experiment: Experiment) -> Experiment:
        """The experiment with this request, checked as far as it concerns every verb.

        Raises
        ------
        GraphError, UsageError : the graph, an entry or the name is invalid.
        """
        problems = Problems()
        graph = experiment.graph.check()
        entries = read_entries(self.entries, graph, problems)
        problems.raise_any()
        name = self.name or experiment.name
        if slug(name) != name:
            option = self.option.format("name")
            raise UsageError(f"{option} {name}: expected letters, digits, '_', '-' and '.'")
        entries = replace(
            entries,
            training=(entries.training[0], tuple(_variants(self.conditions, graph))),
            held_out=(entries.held_out[0], tuple(_variants(self.held_out_conditions, graph))),
        )
        return replace(
            experiment,
            name=name,
            entries=experiment.entries.overlay(entries),
            variants=(*experiment.variants, *_variants(self.variants, graph)),
        )


def _variants(named: Named, baseline: Graph) -> Iterable[GraphVariant]:
    for name, each in named:
        graph = each if isinstance(each, Graph) else each(baseline)
        yield GraphVariant.of(name, graph, baseline)


def _origin(option: str, key: str, value: object) -> str:
    """Where an option was written, as messages show it: ``--seeds 0..9``, or ``seeds``."""
    if option != ON_COMMAND_LINE:
        return key
    spelling = "constrain" if key == "constraints" else key.replace("_", "-")
    return f"{option.format(spelling)} {value}"


def _node(values: object, origin: str) -> Node:
    """Seeds, or the values of a factor; a string is read as YAML."""
    if isinstance(values, str):
        return parse_yaml(values, origin)
    plain = list(values) if isinstance(values, Iterable) else values
    return from_python(plain, Where(origin))
