"""Figures of what a run recorded, drawn with matplotlib: one function per kind of plot.

In: a graph's plot and the run's recordings. Out: a matplotlib figure, or files::

    draw(plot, result)                                   one figure
    save_plots(result, Path("plots"), formats=["pdf"])   all of them

``figures`` chooses the function by the plot's kind (``painters``) and adds what all kinds share:
titles, limits, legends, sizes.
"""

from runtime.plots.figures import (
    FORMATS,
    arrange,
    draw,
    save_figure,
    save_plots,
)
from runtime.plots.film import animate, animated_plot
from runtime.plots.formulas import disable_math
from runtime.plots.linear import (
    LinearSystem,
    draw_linear,
    draw_locus,
    draw_margins,
    draw_nyquist,
)
from runtime.plots.log_axes import label_log, power_text
from runtime.plots.looks import LOOKS, fit, headline, styled
from runtime.plots.map import (
    contacts,
    draw_world,
    view_limits,
)
from runtime.plots.overlays import complete_runs, draw_panels, panels_of
from runtime.plots.painters import drawing_of
from runtime.plots.parts import draw_parts
from runtime.plots.style import (
    COLOURS,
    GREY,
    LINESTYLES,
    WIDTH,
    axis_label,
    coincident,
    display_names,
    explain_empty,
    layers,
    line_style,
    run_end,
    symbol,
    write_note,
)
from runtime.plots.thinning import thin
from runtime.plots.titles import facts, separate_notes, write_title
