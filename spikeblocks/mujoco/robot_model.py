"""The robot and its room as a MuJoCo model, and beams cast in it."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable
from typing import Any

import numpy as np

from blocks.core import Block, FloatArray, ParameterError, directions, param, product, require
from blocks.world import World
from spikeblocks.mujoco.solid_walls import wall_pieces

WALL_HEIGHT = 0.3
# Hull and ground, rear skid and ground (m).
CLEARANCE = 0.012
SKID_CLEARANCE = 0.002
GLIDER_RADIUS = 0.015
# The group of shapes that rays hit; the robot is in the other groups.
SEEN_GROUP = 0
ROBOT_GROUP = 1
# Stiff contacts: with the defaults the wheels sink in by 0.3 mm and the odometry's scale is off by
# up to a per cent. solref's time constant must exceed two physics steps.
FIRM = 'solref="0.005 1" solimp="0.99 0.99 0.001"'


class VacuumBody(Block):
    """The parameters of a robot vacuum from which its MuJoCo model is written."""

    x0: FloatArray = param((0.0, 0.0, 0.0), shape=(3,), unit="m, m, rad", doc="initial pose")
    body_radius: float = param(
        0.17, name="hull_radius", unit="m", above=0.0, doc="radius of the hull"
    )
    hull_height: float = param(0.08, unit="m", above=0.0, doc="height of the hull")
    mass: float = param(3.34, unit="kg", above=0.0, doc="of the whole robot")
    centre_of_mass: float = param(0.02, unit="m", doc="how far it is ahead of the axle")
    caster: float = param(0.125, unit="m", above=0.0, doc="how far ahead the front caster is")
    wheel_radius: float = param(0.035, unit="m", above=0.0, doc="radius of the wheels")
    wheel_width: float = param(0.02, unit="m", above=0.0, doc="width of the wheels")
    wheel_mass: float = param(0.15, unit="kg", above=0.0, doc="of each wheel")
    track: float = param(0.235, unit="m", above=0.0, doc="distance between the wheels")
    armature: float = param(
        0.002, unit="kg m^2", at_least=0.0, doc="inertia of rotor and gear, felt at the wheel"
    )
    motor_gain: float = param(
        2.0, unit="N m s/rad", above=0.0, doc="torque per difference of wheel speeds"
    )
    torque_max: float = param(1.5, unit="N m", above=0.0, doc="largest torque of a motor")
    wheel_speed_max: float = param(0.6, unit="m/s", above=0.0, doc="largest rim speed asked for")
    friction: float = param(0.9, above=0.0, doc="of wheels on the floor")
    hull_friction: float = param(0.2, at_least=0.0, doc="of the hull on walls")
    lidar_height: float = param(
        0.095, unit="m", above=0.0, below=WALL_HEIGHT, doc="above the floor"
    )
    physics_step: float = param(
        0.002, unit="s", above=0.0, at_most=0.0025, doc="step of the simulation"
    )


def engine(feature: str = "MujocoVacuum") -> Any:
    """The mujoco module.

    Raises
    ------
    MissingPackageError : it is not installed.
    ParameterError : it does not load.
    """
    try:
        return require("mujoco", feature, "physics")
    except (AttributeError, OSError, RuntimeError) as error:
        # It loads the graphics library named by MUJOCO_GL, and fails if that is missing.
        named = os.environ.get("MUJOCO_GL", "")
        message = f"mujoco does not load with MUJOCO_GL={named}: {error}; unset it for physics"
        raise ParameterError([("type", message)]) from error


def model_of(robot: VacuumBody, world: World) -> Any:
    """The compiled model (``mujoco.MjModel``)."""
    return engine().MjModel.from_xml_string(model_text(robot, world))


def model_text(robot: VacuumBody, world: World) -> str:
    """The model in MuJoCo's own format, MJCF.

    The origin of the body ``robot`` is half way between the wheels, x ahead, y left. Masses are
    given to bodies, not to geoms: the hull is a homogeneous cylinder whose centre of mass is
    moved ahead, so that the caster carries part of it.
    """
    pieces = wall_pieces(world)
    return f"""<mujoco model="vacuum">
  <compiler angle="radian" inertiafromgeom="false"/>
  <option timestep="{robot.physics_step!r}" integrator="implicitfast" cone="elliptic"
    impratio="10"/>
  <visual>
    <headlight ambient="0.3 0.3 0.3" diffuse="0.3 0.3 0.3" specular="0 0 0"/>
    <map shadowclip="2"/>
    <global offwidth="4096" offheight="4096"/>
  </visual>
  <asset>
    <texture name="floor" type="2d" builtin="checker" rgb1="0.93 0.92 0.90" rgb2="0.87 0.86 0.84"
      width="256" height="256"/>
    <texture name="sky" type="skybox" builtin="flat" rgb1="1 1 1" rgb2="1 1 1" width="8"
      height="48"/>
    <material name="floor" texture="floor" texrepeat="1 1" texuniform="true"/>
{_lines(_mesh(i, piece) for i, piece in enumerate(pieces) if not _is_rectangle(piece))}
  </asset>
  <worldbody>
    <light pos="0 0 6" dir="0.25 0.2 -1" diffuse="0.4 0.4 0.4" specular="0 0 0"
      directional="true"/>
    <geom name="floor" type="plane" size="0 0 1" material="floor" conaffinity="0"/>
{_lines(_wall(i, piece) for i, piece in enumerate(pieces))}
{_lines(_column(x, y, r) for x, y, r in world.circles.tolist())}
{_robot(robot)}
  </worldbody>
  <actuator>
{_lines(_motor(robot, name) for name in ("left", "right"))}
  </actuator>
  <sensor><touch site="bumper"/></sensor>
</mujoco>
"""


def _lines(items: Iterable[str]) -> str:
    return "\n".join(f"    {item}" for item in items)


def _numbers(values: Iterable[float]) -> str:
    return " ".join(repr(float(value)) for value in values)


def _mesh(i: int, piece: FloatArray) -> str:
    corners = [(x, y, z) for x, y in piece.tolist() for z in (0.0, WALL_HEIGHT)]
    vertices = _numbers(value for corner in corners for value in corner)
    # Static walls need no inertia, and a thin one has too little volume for an exact one.
    return f'<mesh name="wall{i}" inertia="shell" vertex="{vertices}"/>'


SOLID = f'contype="2" conaffinity="0" group="{SEEN_GROUP}" rgba="0.62 0.66 0.72 1"'


def _is_rectangle(piece: FloatArray) -> bool:
    front, side = piece[1] - piece[0], piece[3] - piece[0]
    square = abs(float(front @ side)) < 1e-9 * float(front @ front)
    return square and bool(np.allclose(piece[2] - piece[1], side, rtol=0.0, atol=1e-9))


def _wall(i: int, piece: FloatArray) -> str:
    """A wall: a box where possible, since rays and contacts are faster with boxes."""
    if not _is_rectangle(piece):
        return f'<geom name="wall{i}" type="mesh" mesh="wall{i}" {SOLID}/>'
    (along_x, along_y), side = (piece[1] - piece[0]).tolist(), piece[3] - piece[0]
    half = (0.5 * math.hypot(along_x, along_y), 0.5 * float(np.hypot(*side)), 0.5 * WALL_HEIGHT)
    middle = (*piece.mean(axis=0).tolist(), 0.5 * WALL_HEIGHT)
    turn = math.atan2(along_y, along_x)
    return (
        f'<geom name="wall{i}" type="box" pos="{_numbers(middle)}" euler="0 0 {turn!r}"'
        f' size="{_numbers(half)}" {SOLID}/>'
    )


def _column(x: float, y: float, r: float) -> str:
    half = 0.5 * WALL_HEIGHT
    return f'<geom type="cylinder" pos="{_numbers((x, y, half))}" size="{r!r} {half}" {SOLID}/>'


def _robot(robot: VacuumBody) -> str:
    """The body: hull, front caster, rear skid and two wheels.

    Floor and gliders, floor and wheels, walls and hull may touch; no other pair is tested.
    """
    r, half = robot.wheel_radius, 0.5 * robot.hull_height
    x, y, theta = robot.x0.tolist()
    heading = _numbers((math.cos(0.5 * theta), 0.0, 0.0, math.sin(0.5 * theta)))
    hull = robot.mass - 2.0 * robot.wheel_mass
    middle = CLEARANCE + half - r
    across = hull * (3.0 * robot.body_radius**2 + robot.hull_height**2) / 12.0
    upright = 0.5 * hull * robot.body_radius**2
    # The wheels' mass is on the axle, so the hull's centre must be farther ahead.
    ahead = robot.mass * robot.centre_of_mass / hull
    glider = f'type="sphere" size="{GLIDER_RADIUS}" condim="1" priority="1" {FIRM}'
    glider += f' contype="0" conaffinity="1" group="{ROBOT_GROUP}" rgba="0.2 0.2 0.2 1"'
    low = GLIDER_RADIUS - r
    return f"""    <body name="robot" pos="{_numbers((x, y, r))}" quat="{heading}">
      <freejoint/>
      <inertial pos="{_numbers((ahead, 0.0, middle))}" mass="{hull!r}"
        diaginertia="{_numbers((across, across, upright))}"/>
      <geom name="hull" type="cylinder" pos="0 0 {middle!r}" size="{robot.body_radius!r} {half!r}"
        friction="{robot.hull_friction!r}" priority="1" contype="0" conaffinity="2"
        group="{ROBOT_GROUP}" rgba="0.16 0.18 0.22 1"/>
      <geom name="caster" pos="{_numbers((robot.caster, 0.0, low))}" {glider}/>
      <geom name="skid" pos="{_numbers((-robot.caster, 0.0, low + SKID_CLEARANCE))}" {glider}/>
      <geom name="turret" type="cylinder" pos="0 0 {robot.lidar_height - r!r}" size="0.04 0.012"
        contype="0" conaffinity="0" group="{ROBOT_GROUP}" rgba="0.85 0.4 0.1 1"/>
      <geom name="nose" type="box" pos="{_numbers((0.7 * robot.body_radius, 0.0, middle + half))}"
        size="0.03 0.008 0.002" contype="0" conaffinity="0" group="{ROBOT_GROUP}"
        rgba="0.95 0.75 0.2 1"/>
      <site name="lidar" pos="0 0 {robot.lidar_height - r!r}" group="4"/>
      <site name="bumper" type="cylinder" pos="0 0 {middle!r}"
        size="{robot.body_radius + 0.02!r} {half!r}" group="4"/>
{_wheel(robot, "left", 0.5 * robot.track)}
{_wheel(robot, "right", -0.5 * robot.track)}
    </body>"""


def _wheel(robot: VacuumBody, name: str, y: float) -> str:
    """A wheel: an ellipsoid, since a cylinder would touch the floor at two edges and scrub."""
    r, half = robot.wheel_radius, 0.5 * robot.wheel_width
    spin = 0.5 * robot.wheel_mass * r**2
    across = robot.wheel_mass * (3.0 * r**2 + robot.wheel_width**2) / 12.0
    return f"""      <body name="{name}" pos="0 {y!r} 0">
        <joint name="{name}" axis="0 1 0" armature="{robot.armature!r}"/>
        <inertial pos="0 0 0" mass="{robot.wheel_mass!r}"
          diaginertia="{_numbers((across, spin, across))}"/>
        <geom name="{name}" type="ellipsoid" size="{_numbers((r, half, r))}" condim="3"
          friction="{robot.friction!r}" priority="1" {FIRM} contype="0" conaffinity="1"
          group="{ROBOT_GROUP}" rgba="0.1 0.1 0.1 1"/>
      </body>"""


def _motor(robot: VacuumBody, name: str) -> str:
    fastest, torque = robot.wheel_speed_max / robot.wheel_radius, robot.torque_max
    return (
        f'<velocity name="{name}" joint="{name}" kv="{robot.motor_gain!r}"'
        f' ctrlrange="{-fastest!r} {fastest!r}" forcerange="{-torque!r} {torque!r}"/>'
    )


GROUPS = 6


class BeamCaster:
    """Casts all beams of a scan at once.

    Parameters
    ----------
    mujoco : the module.
    model, data : the simulation to cast in; ``data`` gets its kinematics up to date.
    bearings : directions in the plane of the site (rad), (n,).
    group : the group of the shapes that beams hit.
    reach : beams end here (m).
    """

    def __init__(
        self, mujoco: Any, model: Any, data: Any, bearings: FloatArray, group: int, reach: float
    ) -> None:
        self.mujoco, self.model, self.data, self.reach = mujoco, model, data, reach
        self.site = data.site("lidar")
        level = np.zeros_like(bearings)
        self.units = np.column_stack((directions(bearings), level))
        self.groups = np.zeros(GROUPS, dtype=np.uint8)
        self.groups[group] = 1
        self.shapes = np.zeros(len(bearings), dtype=np.int32)

    def directions(self) -> FloatArray:
        """Unit vectors along the beams in the world, (n, 3)."""
        return product(self.units, self.site.xmat.reshape(3, 3).T)

    def cast(self) -> FloatArray:
        """Range along each beam (m), (n,); inf where it meets nothing within reach."""
        # After a step, positions are those of its beginning.
        self.mujoco.mj_kinematics(self.model, self.data)
        n = len(self.units)
        ranges = np.empty(n)
        self.mujoco.mj_multiRay(
            self.model,
            self.data,
            self.site.xpos,
            self.directions().ravel(),
            self.groups,
            True,
            -1,
            self.shapes,
            ranges,
            None,
            n,
            self.reach,
        )
        ranges[(ranges < 0.0) | (ranges > self.reach)] = np.inf
        return ranges
