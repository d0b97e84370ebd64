"""What other tools call the kinds of plots and metrics.

In: a kind that does not exist here, ``fft``. Out: the one that is meant, ``spectrum``.
"""

from __future__ import annotations

_NAMES = {
    "timeseries": "line lines plot scope time signal signals curve curves series time_plot",
    "trajectory": "path track route way xyplot",
    "xy": "phase phase_plane phaseplane phase_portrait scatter scopexy",
    "spectrum": "fft psd frequency periodogram power_spectrum",
    "heatmap": "image matrix imshow",
    "raster": "spikes spike_raster",
    "mean_abs": "mae mean_error mean_absolute mean_absolute_error average",
    "max_abs": "max maximum peak largest max_error",
    "min": "minimum smallest least",
    "final": "last end end_value final_value",
    "settling_time": "settled settling converged convergence_time",
    "rms": "std rmse root_mean_square",
    "share_above": "fraction duty time_above",
    "first_time": "time_of when crossing crossing_time",
    "effort": "energy control_effort",
    "stop_time": "duration end_time",
}
OTHER_NAMES = {name: ours for ours, names in _NAMES.items() for name in names.split()}
