"""Tuning: values of factors that are found by an optimiser, and judged by held-out runs."""

from runtime.experiments.tuning.contest import (
    CONTEST,
    HOW,
    ONCE,
    agreement,
    contest_plans,
    run_contest,
)
from runtime.experiments.tuning.judgement_table import judgement_table
from runtime.experiments.tuning.judging import Evaluation, Judgement
from runtime.experiments.tuning.plan import TUNING, tuning_plan
from runtime.experiments.tuning.result import NOT_DISTINGUISHABLE, NOTHING, TuningTable
from runtime.experiments.tuning.running import run_tuning
from runtime.experiments.tuning.scores import Candidate
