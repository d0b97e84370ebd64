"""runtime.experiments.execution."""

from runtime.experiments.execution import forkserver
from runtime.experiments.execution.backends import WorkerPool, cluster_pool, local_pool
from runtime.experiments.execution.index import Columns, Index, Row, read_rows, remaining
from runtime.experiments.execution.plan import (
    DIAGRAMS,
    GRAPH,
    INDEX,
    PLAN,
    RUNS,
    SCHEMA_VERSION,
    SUMMARY,
    TABLE,
    Case,
    Plan,
    ablation_plan,
    check_same,
    create,
    read_plan,
    sweep_plan,
)
from runtime.experiments.execution.retention import RetentionPolicy
from runtime.experiments.execution.runner import run_points
from runtime.experiments.execution.trials import Trial
from runtime.experiments.execution.worker import WAYS, Task

__all__ = [
    "DIAGRAMS",
    "GRAPH",
    "INDEX",
    "PLAN",
    "RUNS",
    "SCHEMA_VERSION",
    "SUMMARY",
    "TABLE",
    "WAYS",
    "Case",
    "Columns",
    "Index",
    "Plan",
    "RetentionPolicy",
    "Row",
    "Task",
    "Trial",
    "WorkerPool",
    "ablation_plan",
    "check_same",
    "cluster_pool",
    "create",
    "forkserver",
    "local_pool",
    "read_plan",
    "read_rows",
    "remaining",
    "run_points",
    "sweep_plan",
]
