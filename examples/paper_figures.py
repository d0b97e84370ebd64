"""The paper's figures, made by this package: both controllers in each picture.

    python examples/paper_figures.py [folder] [format]

Figures 1 and 2 are diagrams of the graphs that run, 3 is a single neuron, 4 to 8 are cases A and
B, and 9 is case C with half of the turn rate lost. The benchmark is the LQR alone, without the
adaptive part and without feedforward. The paper prints no gains; docs/reproduction.md says what is
reproduced.
"""

from __future__ import annotations

import shutil
import sys
import tempfile
from pathlib import Path

from runtime.cli import run

HERE = Path(__file__).parent
LQR_ALONE = ("--vs", f"with={HERE / 'paper_lqr.yaml'}", "--labels", "LQR and SNN,LQR alone")
LOSS = ("--with", "conditions/turn_loss_50.yaml")
DIAGRAMS = {
    "figure_1_framework": "line_actuator_failure",
    "figure_2_network": str(HERE / "paper_network.yaml"),
}
# graph, what is changed and compared, and the figure that each plot stands for.
RUNS: tuple[tuple[str, tuple[str, ...], dict[str, str]], ...] = (
    ("gallery/lif_neuron", (), {"voltage": "figure_3_lif_neuron"}),
    (
        "line_actuator_failure",
        LQR_ALONE,
        {
            "trajectory": "figure_4_line_trajectory",
            "errors": "figure_5_line_errors",
            "adaptive": "figure_6_line_adaptive_command",
        },
    ),
    (
        "sine_estimation_error",
        LQR_ALONE,
        {"trajectory": "figure_7_sine_trajectory", "errors": "figure_8_sine_errors"},
    ),
    ("wall_following", (*LOSS, *LQR_ALONE), {"room": "figure_9_wall_following"}),
)


def main(folder: Path, suffix: str) -> int:
    """Make all figures; the exit code is that of the first command that fails."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, graph in DIAGRAMS.items():
        code = run(["draw", graph, "-o", str(folder / f"{name}.{suffix}")])
        if code:
            return code
    for graph, changes, figures in RUNS:
        with tempfile.TemporaryDirectory() as out:
            code = run(
                ["run", graph, *changes, "--style", "paper", "--figures", suffix, "--out", out]
            )
            if code:
                return code
            for plot, name in figures.items():
                drawn = sorted(Path(out).glob(f"*/*/plots/{plot}.{suffix}"))[-1]
                shutil.copy(drawn, folder / f"{name}.{suffix}")
    return 0


if __name__ == "__main__":
    given = sys.argv[1:]
    sys.exit(main(Path(given[0] if given else "figures"), given[1] if len(given) > 1 else "png"))
