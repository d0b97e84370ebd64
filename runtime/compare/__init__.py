"""Compares runs: differences of their graphs, metrics and probes, and the first differing tick."""

from runtime.compare.comparison import Comparison, compare
from runtime.compare.documents import text_of
from runtime.compare.output import as_data, exact_summary, summary
from runtime.compare.runs import Run, open_runs
