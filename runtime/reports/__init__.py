"""Reports: a run, a sweep or an ablation as one HTML page that needs nothing else."""

from runtime.reports.report import report

__all__ = ["report"]
