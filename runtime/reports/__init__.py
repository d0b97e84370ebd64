"""Reports of runs, sweeps and ablations as self-contained HTML pages."""

from runtime.reports.dispatch import report
from runtime.reports.zoom import chart_script, chart_style
