"""Pictures of what a run recorded."""

from runtime.plots import style, walls
from runtime.plots.animation import animate, animated
from runtime.plots.figures import THIN_ABOVE, THIN_TO, draw, save_figure, save_plots
from runtime.plots.raster import WINDOW
from runtime.plots.style import GREY
from runtime.plots.trajectory import draw_trajectory, equal_scales

__all__ = [
    "GREY",
    "THIN_ABOVE",
    "THIN_TO",
    "WINDOW",
    "animate",
    "animated",
    "draw",
    "draw_trajectory",
    "equal_scales",
    "save_figure",
    "save_plots",
    "style",
    "walls",
]
