"""Runs side by side: what differs in their graphs, metrics and probes, and where it begins."""
