"""The images of the README and of the documents, each the output of the commands above it.

    python docs/pictures.py     # makes them

Pages of the gallery show the same pictures with their commands (site_pages.py).
"""

from __future__ import annotations

import shlex
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

IMAGES = Path(__file__).resolve().parent / "images"


@dataclass(frozen=True)
class Picture:
    """Commands that are printed above an image, and the file that they write.

    made : a pattern of the path of that file in the folder of the commands.
    shows : what is seen, for those who cannot see it.
    """

    made: str
    commands: tuple[str, ...]
    shows: str = ""

    def make(self, target: Path) -> None:
        """Run the commands in an empty folder, and copy what they made.

        Raises
        ------
        RuntimeError : a command failed, or they did not make exactly one such file.
        """
        with TemporaryDirectory() as name:
            folder = Path(name)
            for command in self.commands:
                printed(command, folder)
            found = list(folder.glob(self.made))
            if len(found) != 1:
                raise RuntimeError(f"{self.commands} made {len(found)} files '{self.made}'")
            shutil.copyfile(found[0], target)


def of_run(command: str, plot: str, shows: str) -> Picture:
    """A plot of the run of a command."""
    return Picture(f"runs/*/latest/plots/{plot}.png", (command,), shows)


POLE = "runtime linearize gallery/balanced_pole --without noise --state cart.x=0"


def of_pole(options: str) -> Picture:
    """A figure of the linearization of the balanced pole."""
    return Picture("pole.png", (f"{POLE} {options} -o pole.png",))


def of_study(name: str, figure: str, shows: str) -> Picture:
    """A figure of a shipped study."""
    return Picture(
        f"sweeps/{name}/plots/{figure}.png", (f"runtime sweep experiments/{name}",), shows
    )


PICTURES = {
    "paper_quadrotor_tracking.png": of_study(
        "quadrotor",
        "quadrotor_tracking",
        "tracking error over the mean wind: flat with the neurons, rising without them",
    ),
    "paper_quadrotor_estimator.png": of_study(
        "quadrotor",
        "quadrotor_estimator",
        "error of the estimator over time: small with each fix used once, large and periodic with "
        "held fixes taken for new",
    ),
    "paper_head_direction_drift.png": of_study(
        "head_direction",
        "drift",
        "drift of a ring over its number of neurons: falling, and far lower with regular spikes",
    ),
    "paper_head_direction_direction.png": of_study(
        "head_direction",
        "direction",
        "error of the direction over time: a walk with Poisson spikes, near zero with regular ones",
    ),
    "paper_gated_memory_capacity.png": of_study(
        "gated_memory",
        "capacity",
        "share of items that are recalled, falling with their number, lower with an open gate",
    ),
    "paper_gated_memory_dimensions.png": of_study(
        "gated_memory",
        "dimensions",
        "the same in 16 dimensions: falling earlier",
    ),
    "paper_associations_recall.png": of_study(
        "associations",
        "recall",
        "error of recall over the number of pairs: about a third with encoders that learn",
    ),
    "paper_associations_learning.png": of_study(
        "associations",
        "learning",
        "error over time: falling within each pair, and from round to round",
    ),
    "paper_curl_field_last.png": of_study(
        "curl_field",
        "last",
        "deviation in the field after training: small if the torque is learnt",
    ),
    "paper_curl_field_after_effect.png": of_study(
        "curl_field",
        "after_effect",
        "deviation without the field after training: large if the torque was learnt",
    ),
    "linear_step.png": of_pole("--inputs wanted.out --outputs cart.position,cart.angle"),
    "linear_margins.png": of_pole("--open lqr.command --margins"),
    "linear_nyquist.png": of_pole("--open lqr.command --nyquist"),
    "linear_locus.png": of_pole("--rlocus blocks.lqr.R=0.005..50"),
    "errors.png": of_run(
        "runtime run starters/adaptive --vs without=adaptive",
        "errors",
        "with the neurons its distance from the line goes to 0, without them it stays at 0.4 m",
    ),
    "diagram.svg": Picture("adaptive.svg", ("runtime draw starters/adaptive",)),
    "film.gif": Picture(
        "runs/*/latest/plots/animation.gif",
        (
            "runtime run wall_following_robust --with conditions/turn_loss_50 "
            "--vs without=adaptive --labels 'with neurons,without neurons' --animate --no-plots",
        ),
        "two robots follow the walls of a room by LiDAR; the one with neurons keeps its distance, "
        "the other touches walls and cylinders",
    ),
    "physics.png": Picture(
        "runs/*/latest/plots/render.png",
        (
            "runtime run wall_following_mujoco_robust --with wheel_faults/turn_loss_35 --until 100",
            "runtime render runs/wall_following_mujoco_robust/latest --no-film --height 600",
        ),
        "the robot and its trajectory along the walls, from above and in perspective",
    ),
}


def printed(command: str, folder: Path) -> str:
    """What a command line prints, run in a folder.

    Raises
    ------
    RuntimeError : the command failed; with what it printed.
    """
    words = shlex.split(command.replace("\\\n", " "))
    program = Path(sys.executable).parent / words[0]
    done = subprocess.run(
        [str(program), *words[1:]], cwd=folder, capture_output=True, text=True, encoding="utf-8"
    )
    if done.returncode:
        raise RuntimeError(f"{command}: exit code {done.returncode}\n{done.stderr}")
    return done.stdout


def main() -> None:
    IMAGES.mkdir(exist_ok=True)
    for name, picture in PICTURES.items():
        picture.make(IMAGES / name)


if __name__ == "__main__":
    main()
