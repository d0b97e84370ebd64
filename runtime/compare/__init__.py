"""Runs side by side: what differs in their graphs, metrics and probes, and where it begins."""

from runtime.compare.comparison import Comparison, compare
from runtime.compare.data import as_data
from runtime.compare.documents import text_of
from runtime.compare.runs import open_runs
from runtime.compare.text import exact_summary, summary

__all__ = ["Comparison", "as_data", "compare", "exact_summary", "open_runs", "summary", "text_of"]
