"""The world's polygons as convex prisms, for engines that support convex solids only."""

from __future__ import annotations

import numpy as np

from blocks.core import FloatArray, ParameterError
from blocks.world import World

# The greatest thickness of a wall (m), and how often it is halved where that does not fit.
THICKNESS = 0.1
HALVINGS = 8
# By how much pieces are longer than their edges, at each end (m), so that no ray passes between
# two of them at a corner. Meshes in single precision need that much.
OVERLAP = 1e-5


def wall_pieces(world: World) -> list[FloatArray]:
    """Convex quadrilaterals, each (4, 2) in m, that line all edges on their solid side.

    Seen from free space they are the polygons themselves: the first side of each piece lies on an
    edge, its neighbours meet it at the corner, and none reaches into free space by more than
    ``OVERLAP``. Between two corners of less than 180 degrees of free space, as in a plain room, a
    piece is a rectangle.

    Raises
    ------
    ParameterError : an address in the world's description, where a solid is too thin.
    """
    rings = [] if world.room is None else [("world.room", world.room)]
    rings += [(f"world.obstacles[{i}]", ring) for i, ring in enumerate(world.obstacles)]
    return [piece for address, ring in rings for piece in _lining(address, ring)]


def _lining(address: str, ring: FloatArray) -> list[FloatArray]:
    """One polygon's pieces; free space is on the left of its edges."""
    along = _directions(ring)
    for halving in range(HALVINGS + 1):
        back = _mitred(ring, along, THICKNESS / 2**halving)
        corners = _corners(ring, back, along)
        if _inside_solid(ring, back, corners):
            hair = OVERLAP * along
            sides = (c + h for c, h in zip(corners, (-hair, hair, hair, -hair), strict=True))
            return [np.array(piece) for piece in zip(*sides, strict=True)]
    thinnest = 1e3 * THICKNESS / 2**HALVINGS
    message = f"a solid body needs walls of {thinnest:.1g} mm at least, and this one has a place "
    raise ParameterError([(address, message + "that is thinner or a corner that is too sharp")])


def _directions(ring: FloatArray) -> FloatArray:
    """Unit vectors along the edges, (k, 2)."""
    edges = np.roll(ring, -1, axis=0) - ring
    directions: FloatArray = edges / np.hypot(edges[:, :1], edges[:, 1:])
    return directions


def _mitred(ring: FloatArray, along: FloatArray, depth: float) -> FloatArray:
    """The ring moved by ``depth`` to the right of its edges, its corners kept sharp, (k, 2).

    Lines at distance h from two edges with unit normals n1, n2 meet at h (n1 + n2) / (1 + n1 . n2)
    from the corner.
    """
    normal = np.column_stack((along[:, 1], -along[:, 0]))
    before = np.roll(normal, 1, axis=0)
    opening = 1.0 + np.sum(before * normal, axis=1, keepdims=True)
    moved: FloatArray = ring + depth * (before + normal) / np.maximum(opening, 1e-9)
    return moved


def _corners(ring: FloatArray, back: FloatArray, along: FloatArray) -> tuple[FloatArray, ...]:
    """The pieces' corners, each (k, 2): where the front begins and ends, then the back from there.

    Between corners where the back is the longer side, a piece begins square with its edge and
    ends square with the end of its back, which fills the corner.
    """
    following, behind = np.roll(ring, -1, axis=0), np.roll(back, -1, axis=0)
    before = np.sum((ring - back) * along, axis=1, keepdims=True)
    beyond = np.sum((behind - following) * along, axis=1, keepdims=True)
    is_longer = (before >= 0.0) & (beyond >= 0.0)
    end: FloatArray = following + np.where(is_longer, beyond, 0.0) * along
    begin_of_back: FloatArray = back + np.where(is_longer, before, 0.0) * along
    return ring, end, behind, begin_of_back


def _inside_solid(ring: FloatArray, back: FloatArray, corners: tuple[FloatArray, ...]) -> bool:
    """Whether the pieces between a ring and its moved copy lie in the solid, side by side."""
    following, behind = np.roll(ring, -1, axis=0), np.roll(back, -1, axis=0)
    edges = following - ring
    if np.any(np.sum(edges * (behind - back), axis=1) <= 0.0):
        return False
    begin, end, _, begin_of_back = corners
    outlines = (
        *((back, behind), (ring, back)),
        *((begin, begin_of_back), (following, end), (end, behind)),
    )
    return not any(_cross(start, stop - start, ring, edges) for start, stop in outlines)


def _cross(start: FloatArray, step: FloatArray, corner: FloatArray, edge: FloatArray) -> bool:
    """Whether a segment of the first set crosses the interior of one of the second."""

    def sides(points: FloatArray, base: FloatArray, direction: FloatArray) -> FloatArray:
        offset = points[:, None] - base[None]
        cross: FloatArray = direction[:, 0] * offset[..., 1] - direction[:, 1] * offset[..., 0]
        return cross

    apart = sides(start, corner, edge) * sides(start + step, corner, edge) < 0.0
    astride = sides(corner, start, step) * sides(corner + edge, start, step) < 0.0
    return bool(np.any(apart & astride.T))
