"""Growing what is solid: the outline that a disc's centre must not cross, as straight edges.

Along edges the outline is exact.  Around a convex corner the exact outline is an arc; here it is
the tangent polygon outside of that arc, which turns by at most 22.5 degrees at each vertex and is
at most 2 % farther from the corner.  Grown polygons may overlap: their edges then cross each other
inside solid ground.  A line from outside crosses the outermost edge first, so no union of polygons
is needed.

Decides: the outline's edges and the vertices at which a taut way may turn.  Must not know: who
moves.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from coordinator.curves.nurbs import Array

Indices = npt.NDArray[np.int64]

TURN_STEP: Final = math.pi / 8
"""Greatest turn [rad] at a vertex of a tangent polygon."""

_OVERLAP: Final = 1e-9
"""Neighbouring edges overlap by this [m]."""

_STRAIGHT: Final = 1e-9
"""Corners that turn less [rad] count as straight."""


@dataclass(frozen=True, eq=False)
class Rings:
    """The corners of all solid polygons, ring after ring; what is solid lies left of each ring.

    corners (n, 2) [m]; following (n,): the index of the next corner on the same ring.
    """

    corners: Array
    following: Indices

    @staticmethod
    def of(polygons: Sequence[Sequence[tuple[float, float]]], floor: Array) -> Rings:
        """Return the rings of the obstacles and of the outside of the floor (n, 2) [m].

        Polygons may be given clockwise or counterclockwise.
        """
        rings = [np.array(ring, dtype=np.float64).reshape(-1, 2) for ring in (*polygons, floor)]
        sizes = np.array([len(ring) for ring in rings])
        corners, ring = np.concatenate(rings), np.repeat(np.arange(len(rings)), sizes)
        following = _following(sizes)
        doubled = np.all(corners == corners[following], axis=1)
        corners, ring = corners[~doubled], ring[~doubled]
        sizes = np.bincount(ring, minlength=len(rings))
        following = _following(sizes)
        first = np.cumsum(sizes) - sizes
        x, y = (corners - np.repeat(corners[first], sizes, axis=0)).T
        area = np.bincount(ring, weights=x * y[following] - y * x[following])
        turned = area < 0.0
        turned[-1] = not turned[-1]
        turned = turned[ring]
        last = np.repeat(2 * first + sizes - 1, sizes)
        order = np.arange(len(corners))
        return Rings(corners[np.where(turned, last - order, order)], following)


@dataclass(frozen=True, eq=False)
class Outline:
    """The outline of what is solid, grown by a distance.

    edges (m, 4): x0, y0, x1, y1 [m].  An edge of the outline is a side of a solid polygon, moved
    outwards and extended at both ends along the tangent polygons of the corners there.  owners
    (m, 2): the corner at each end; beyond (m, 2) [m]: the length of the extension.  At an end
    without extension they are -1 and 0.  An edge between two vertices of one tangent polygon has
    that corner at both ends, and beyond is infinite.
    turns (v, 2) [m]: the vertices of the tangent polygons, at which a taut way may turn; before,
    after (v, 2): the unit directions from there back and on along the outline; around (v,): the
    corner of each.
    """

    edges: Array
    owners: Indices
    beyond: Array
    turns: Array
    before: Array
    after: Array
    around: Indices


def grow(rings: Rings, distance: float) -> Outline:
    """Return the outline of everything solid, grown by a distance [m]."""
    corners, following = rings.corners, rings.following
    preceding = np.empty_like(following)
    preceding[following] = np.arange(len(following))
    edge = corners[following] - corners
    unit = edge / np.hypot(edge[:, 0], edge[:, 1])[:, None]
    normal = np.column_stack((unit[:, 1], -unit[:, 0]))
    normal_in = normal[preceding]
    turn = np.arctan2(
        normal_in[:, 0] * normal[:, 1] - normal_in[:, 1] * normal[:, 0],
        np.einsum("ij,ij->i", normal_in, normal),
    )
    count = np.where(turn > _STRAIGHT, np.ceil(turn / TURN_STEP - 1e-9), 0).astype(np.int64)
    half = 0.5 * turn / np.maximum(count, 1)
    reach = np.where(count > 0, distance * np.tan(half), 0.0)
    side = np.column_stack(
        (
            corners + distance * normal - reach[:, None] * unit,
            corners[following] + distance * normal + reach[following, None] * unit,
        )
    )
    owner = np.where(count > 0, np.arange(len(corners)), -1)
    around = np.repeat(np.arange(len(corners)), count)
    first = np.cumsum(count) - count
    step = np.arange(len(around)) - first[around]
    angle = np.arctan2(normal_in[:, 1], normal_in[:, 0])[around] + (2 * step + 1) * half[around]
    spread = (distance / np.cos(half))[around]
    turns = corners[around] + spread[:, None] * np.column_stack((np.cos(angle), np.sin(angle)))
    inner = np.flatnonzero(step < count[around] - 1)
    chain = np.column_stack((turns[inner], turns[inner + 1])).reshape(-1, 4)
    whole = np.full(len(inner), math.inf)
    edges = _overlapping(np.concatenate((side, chain)))
    heading = angle - half[around]
    into = np.column_stack((-np.sin(heading), np.cos(heading)))
    heading = angle + half[around]
    onward = np.column_stack((-np.sin(heading), np.cos(heading)))
    return Outline(
        edges=edges,
        owners=np.concatenate(
            (
                np.column_stack((owner, owner[following])),
                np.column_stack((around[inner], around[inner])),
            )
        ),
        beyond=np.concatenate(
            (np.column_stack((reach, reach[following])), np.column_stack((whole, whole)))
        ),
        turns=turns,
        before=-into,
        after=onward,
        around=around,
    )


def _overlapping(edges: Array) -> Array:
    """Return edges (m, 4) a little longer at both ends, so that rounding leaves no gaps."""
    along = edges[:, 2:] - edges[:, :2]
    along *= (_OVERLAP / np.maximum(np.hypot(along[:, 0], along[:, 1]), 1e-12))[:, None]
    return np.concatenate((edges[:, :2] - along, edges[:, 2:] + along), axis=1)


def _following(sizes: Indices) -> Indices:
    """Return the index of the next corner on the same ring, for rings of these sizes."""
    following = np.arange(1, int(sizes.sum()) + 1)
    following[np.cumsum(sizes) - 1] -= sizes
    return following
