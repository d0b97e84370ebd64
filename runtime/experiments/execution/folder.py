"""The folder of an experiment, under one rule for sweeps, ablations and tunings.

In: a plan, and where it is run. Out: a folder with ``plan.yaml``, the graphs and an index; what is
written into it belongs to this plan alone::

    no folder                       it is made, with --resume too: a kill may have come before it
    a folder of the same plan       --resume continues it, without it nothing is touched
    a folder of another plan        an error that lists what differs
"""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

from blocks.files import read_text
from runtime.diagrams import stored_picture
from runtime.document import dump_yaml, parse_yaml
from runtime.errors import GraphError, UsageError
from runtime.experiments.design import BASELINE, ON_COMMAND_LINE
from runtime.experiments.execution.checksums import check_entries, with_checks
from runtime.experiments.execution.index import Index
from runtime.experiments.execution.options import RunOptions
from runtime.experiments.execution.plan import (
    GRAPH,
    INDEX,
    SCHEMA_VERSION,
    VARIANTS,
    ExperimentPlan,
)
from runtime.experiments.execution.trials import GraphBundle
from runtime.files import check_form, system_errors, write_whole
from runtime.runs import DIAGRAM

READ_VERSIONS = (1, SCHEMA_VERSION)
PLAN, SUMMARY = "plan.yaml", "summary.json"
TABLE, DIAGRAMS, RUNS = "ablation.json", "diagrams", "runs"


def open_folder(plan: ExperimentPlan, options: RunOptions) -> None:
    """Make the folder of a plan, or check that it may be continued.

    Raises
    ------
    UsageError : it belongs to a different plan, exists although it is not resumed, or cannot be
        read or written.
    """
    folder, option = options.folder, options.option
    if options.checkpoint is not None and plan.graph.network.keep is not None:
        raise UsageError(
            f"run.keep: trials with {option.format('checkpoint')} have all of their recordings on "
            "disk, from which they go on; leave out one of the two"
        )
    if not folder.exists():
        _create(plan, folder)
        return
    if not (folder / PLAN).exists():
        raise UsageError(
            f"'{folder}' exists already, and is not the folder of a {plan.kind} (it has no {PLAN});"
            f" {elsewhere(option)} begins one elsewhere"
        )
    _check_same(plan, folder, option)
    if not options.resume:
        resume = "--resume" if option == ON_COMMAND_LINE else "resume=True"
        raise UsageError(
            f"'{folder}' exists already; {resume} continues it, "
            f"{elsewhere(option)} begins another {plan.kind}"
        )
    try:
        read_plan(folder)
    except UsageError:
        # What was damaged is known: the digest is that of this very plan.
        with system_errors(f"write '{folder / PLAN}'"):
            write_plan(plan, folder)


def elsewhere(option: str) -> str:
    """The option that chooses another folder."""
    return "--name NAME" if option == ON_COMMAND_LINE else "another folder"


def _create(plan: ExperimentPlan, folder: Path) -> None:
    """Make a plan's folder, which gets its name only when it is complete.

    Raises
    ------
    UsageError : it cannot be written.
    """
    # Renamed at the end: whatever is killed meanwhile, a folder of this name has a whole plan.
    partial = folder.with_name(f".{folder.name}.partial")
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        shutil.rmtree(partial, ignore_errors=True)
        partial.mkdir()
        _write_bundle(plan.bundle, partial)
        picture = stored_picture(plan.graph.network, plan.graph.observation.probes.values())
        if picture is not None:
            write_whole(partial / DIAGRAM, picture)
        for variant in plan.variants:
            if variant.name != BASELINE:
                _write_bundle(variant.bundle, partial / VARIANTS / variant.slug)
        write_plan(plan, partial)
        Index.create(partial / INDEX, plan.columns)
        partial.rename(folder)
    except OSError as error:
        shutil.rmtree(partial, ignore_errors=True)
        raise UsageError(f"cannot write '{folder}': {error.strerror or error}") from None


def write_plan(plan: ExperimentPlan, folder: Path) -> None:
    """Write a plan into its folder, in place of an older one."""
    write_whole(folder / PLAN, dump_yaml(with_checks(plan.to_dict())))


def _write_bundle(bundle: GraphBundle, folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    write_whole(folder / GRAPH, bundle.text)
    for name, content in bundle.beside:
        write_whole(folder / name, content)


def read_plan(folder: Path) -> dict[str, Any]:
    """The plan of an experiment, as plain values.

    Raises
    ------
    UsageError : there is no plan, it cannot be read, or an entry was changed after it was written.
    """
    path = folder / PLAN
    stored = _load_plan(folder)
    # Plans of schema 1 have other words for two entries, and the first ones no ends and never.
    older = {"total": stored.get("points"), "provenance": stored.get("made")}
    try:
        if stored["schema_version"] != 1:
            check_entries(stored)
        plan = {"ends": {}, "never": {}, **older, **stored}
        check_form(plan, {"ends": dict, "never": dict})
        for name, ends in plan["ends"].items():
            low, high = map(float, ends)
            plan["ends"][name] = (low, high)
    except (TypeError, ValueError) as error:
        raise UsageError(f"'{path}' is damaged: {error}") from None
    return plan


def _load_plan(folder: Path) -> dict[str, Any]:
    """The content of plan.yaml, which need not be what was written."""
    path = folder / PLAN
    try:
        stored = parse_yaml(read_text(path), str(path)).plain()
    except (OSError, UnicodeDecodeError, GraphError) as error:
        raise UsageError(f"cannot read the plan of '{folder}': {error}") from None
    if not isinstance(stored, dict) or stored.get("schema_version") not in READ_VERSIONS:
        raise UsageError(f"'{path}' is not a plan of this version of the program")
    return stored


def _check_same(plan: ExperimentPlan, folder: Path, option: str) -> None:
    """Check that a folder belongs to the same plan, and contains no links.

    Raises
    ------
    UsageError : it does not; the message lists the differences.
    """
    _refuse_links(folder)
    stored = _load_plan(folder)
    try:
        text = read_text(folder / GRAPH)
    except (OSError, UnicodeDecodeError) as error:
        raise UsageError(f"cannot read '{folder / GRAPH}': {error}") from None
    if stored.get("digest") == plan.digest:
        return
    here = {"kind": plan.kind, **plan.specification, "metrics": list(plan.metrics)}
    keys = dict.fromkeys([*here, "vary", "random", "sobol", "sampling_seed", "variants"])
    differing = [
        f"{key}: {_short(stored.get(key))} there, {_short(here.get(key))} here"
        for key in keys
        if stored.get(key) != here.get(key)
    ]
    if text != plan.bundle.text or not differing:
        differing.append("the graph")
    raise UsageError(
        f"'{folder}' belongs to a different plan, which differs in {'; '.join(differing)}; "
        f"{elsewhere(option)} begins another {plan.kind} beside it"
    )


def _refuse_links(folder: Path) -> None:
    """Refuse to write into a folder with links: their targets could be written or deleted."""
    with system_errors(f"read '{folder}'"):
        for path in [*folder.iterdir(), *folder.glob("*/*")]:
            if path.is_symlink():
                raise UsageError(
                    f"'{path}' is a link, which is not followed when a folder is continued; "
                    "replace it by what it points to"
                )


def _short(value: Any) -> str:
    text = "nothing" if value is None else str(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
