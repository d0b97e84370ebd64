"""``runtime plugins``: what installed packages offer, and what of it does not work."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from importlib import import_module
from typing import TYPE_CHECKING, Any

from runtime.arguments import add_json
from runtime.terminal import show, show_json, table, tell

if TYPE_CHECKING:
    from blocks.library.extensions import Registry

HELP = "list what installed packages offer: blocks, metrics, verbs, ..."
EXAMPLES = """
runtime plugins
runtime plugins --json
"""
# Every registry: what its entries are, and where it is.
REGISTRIES = {
    "blocks": ("types of blocks", "blocks.library.registry:BLOCKS"),
    "neurons": ("neuron models of an Ensemble", "blocks.neural:NeuronModel.members"),
    "solvers": ("solvers of decoders", "blocks.neural:DecoderSolver.members"),
    "metrics": ("kinds of metrics", "runtime.observation:METRIC_KINDS"),
    "plots": ("kinds of plots", "runtime.observation:PLOT_KINDS"),
    "diagrams": ("formats of diagrams", "runtime.diagrams:FORMATS"),
    "exports": ("targets of runtime export", "runtime.export:TARGETS"),
    "verbs": ("verbs of the command line", "runtime.cli.commands:VERBS"),
}


def add(parser: ArgumentParser) -> None:
    """Declare the options."""
    add_json(parser)


def run(options: Namespace) -> int:
    """Print one line for each offer; exit code 1 if one cannot be used."""
    from blocks.library.extensions import PREFIX

    offers, failures = _every()
    if options.json:
        show_json({"schema_version": 1, "plugins": offers, "failures": failures})
        return 1 if failures else 0
    rows = [tuple(offer.values()) for offer in offers]
    if rows:
        show(table([("KIND", "NAME", "PACKAGE", "FROM"), *rows]))
    else:
        show("no installed package offers anything; a package declares what it offers under")
        show(table([(f"{PREFIX}{name}", what) for name, (what, _) in REGISTRIES.items()]))
        show("'runtime new --package my_blocks' writes one that does.")
    for line in failures:
        tell(f"error: {line}")
    return 1 if failures else 0


def registry(name: str) -> Registry[Any]:
    """One of the registries, imported."""
    module, _, path = REGISTRIES[name][1].partition(":")
    found: Any = import_module(module)
    for part in path.split("."):
        found = getattr(found, part)
    return found  # type: ignore[no-any-return]


def _every() -> tuple[list[dict[str, str]], list[str]]:
    """What packages offer that can be used, and one line for each that cannot."""
    from blocks.core import hint
    from blocks.library.extensions import PREFIX, groups

    offers, failures = [], []
    for name in REGISTRIES:
        entries = registry(name)
        failures += entries.broken()
        offers += [
            {
                "kind": name,
                "name": key,
                "package": offer.package,
                "module": offer.point.value,
            }
            for key, offer in entries.offers().items()
            if not offer.is_ours and not entries.why_broken(key)
        ]
    known = [f"{PREFIX}{name}" for name in REGISTRIES]
    for group in groups():
        if group not in known:
            near = hint(group, known) or f"; there are {', '.join(known)}"
            failures.append(f"there is no group of entry points '{group}'{near}")
    # What cannot be read belongs to no registry, and each names it.
    return offers, list(dict.fromkeys(failures))
