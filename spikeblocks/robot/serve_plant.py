"""``runtime serve-plant``: a simulated robot in real time, for a controller in another process."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace

from spikeblocks.robot.drive import add_driving, run_driver

HELP = "run a simulated robot in real time, for a controller elsewhere"
GROUP = "robots"
ABOUT = """
It reads the robot.yaml of the controller from the other side: the controller's inputs are what
the graph's outputs send, and its addresses change places.
"""
EXAMPLES = """
runtime serve-plant plant.yaml --ports robot.yaml --for 60
runtime serve-plant plant.yaml --ports robot.yaml --log plant.mcap
"""


def add(parser: ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("graph", help="a graph whose outputs are the controller's inputs")
    add_driving(parser)


def run(options: Namespace) -> int:
    """Serve the plant, and print what happened."""
    return run_driver(options, is_plant=True)
