"""What a command or a call adds to an experiment: factors, sampling, an objective, a name."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from runtime.document import Node
from runtime.errors import NOWHERE, Problems, UsageError, Where
from runtime.experiments.design.checks import check_design, check_factor, check_objective
from runtime.experiments.design.experiment import Experiment
from runtime.experiments.design.factors import parse_factor
from runtime.experiments.design.objective import Objective
from runtime.experiments.design.sampling import Method
from runtime.experiments.design.seeds import Seeds
from runtime.files import slug


@dataclass(frozen=True)
class Additions:
    """What is added to a sweep; each entry replaces what the experiment says itself.

    Parameters
    ----------
    vary : a path into the graph and its values for each factor; the origin of the values' text
        is what messages show.
    method, samples : how the values are chosen; None leaves the experiment's own way.
    sampling_seed : of the samples.
    objective : what is best.
    name : of the sweep.
    options : the word for an option in messages, ``--{}`` on a command line.
    """

    vary: Sequence[tuple[str, Node]] = ()
    method: Method | None = None
    samples: int = 0
    sampling_seed: int | None = None
    objective: Objective | None = None
    name: str | None = None
    options: str = "{}"

    def to(self, experiment: Experiment, seeds: Seeds) -> Experiment:
        """The experiment with these additions, checked.

        Raises
        ------
        GraphError, UsageError : a factor, the sampling, the objective or the name is invalid.
        """
        problems = Problems()
        graph = experiment.graph
        factors = []
        for path, node in self.vary:
            factor = parse_factor(path, node, path, problems)
            if factor is not None:
                check_factor(graph, factor, Where(node.where.file), problems)
                factors.append(factor)
        own = {factor.path for factor in factors}
        kept = (factor for factor in experiment.design.factors if factor.path not in own)
        design = replace(experiment.design, factors=(*kept, *factors))
        if self.method is not None:
            samples = self._at_least(1, self.samples, self.method)
            design = replace(design, method=self.method, samples=samples)
        if self.sampling_seed is not None:
            seed = self._at_least(0, self.sampling_seed, "sampling-seed")
            design = replace(design, seed=seed)
        if self.objective is not None:
            check_objective(graph, self.objective, NOWHERE, problems)
        problems.raise_any()
        check_design(graph, design, seeds)
        name = self.name or experiment.name
        if slug(name) != name:
            option = self.options.format("name")
            raise UsageError(f"{option} {name}: expected letters, digits, '_', '-' and '.'")
        objective = self.objective or experiment.objective
        return replace(experiment, name=name, design=design, objective=objective)

    def _at_least(self, least: int, number: int, option: str) -> int:
        if number < least:
            shown = self.options.format(option)
            raise UsageError(f"{shown} {number}: expected at least {least}")
        return number
