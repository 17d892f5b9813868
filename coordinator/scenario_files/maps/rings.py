"""Joining lines and curves to closed outlines, and making polygons of outlines.

Decides: which ends meet, which outlines are open, and that a polygon contains the area that its
outline encloses (or, for a floor, lies within that area).  Must not know: files and entities.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final, NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from coordinator.scenario.checks import ring_fault
from coordinator.scenario_files.maps.curve_hulls import Array, Hulls

JOIN: Final = 1e-6
"""Ends meet if their distance is less than this share of the size of the drawing."""
_FINER: Final = (1.0, 0.1, 0.01, 0.001)
"""Shares of the tolerance that are tried in turn where an outline comes near to itself."""
_STRAIGHT: Final = 1e-9
"""Corners within this distance [m] of a straight edge are removed; tangents are often in line."""
_NAMED: Final = 3
"""A message names at most this many parts of an outline."""


class Part(NamedTuple):
    """A line or curve: its name, a function from a tolerance [m] to hulls [m], and its hulls.

    `backwards`: whether its outline runs through it from its end to its beginning.
    """

    name: str
    follow: Callable[[float], Hulls]
    hulls: Hulls
    backwards: bool = False


def join(parts: Sequence[Part], problems: list[str]) -> list[list[Part]]:
    """Return the closed outlines, each as its parts in order; note in `problems` what is open."""
    if not parts:
        return []
    ends = np.array([(part.hulls[0][0], part.hulls[-1][-1]) for part in parts]).reshape(-1, 2)
    nodes = _meeting(ends, parts).reshape(-1, 2)
    alone = nodes[:, 0] == nodes[:, 1]
    outlines = [[part] for part, closed in zip(parts, alone, strict=True) if closed]
    number = int(nodes.max()) + 1
    graph = coo_array((np.ones(len(nodes)), (nodes[:, 0], nodes[:, 1])), shape=(number, number))
    group = connected_components(graph, directed=False)[1][nodes[:, 0]]
    degree = np.bincount(nodes[~alone].ravel(), minlength=number)
    order = np.flatnonzero(~alone)[np.argsort(group[~alone], kind="stable")]
    for members in np.split(order, np.flatnonzero(np.diff(group[order])) + 1):
        odd = [node for node in nodes[members].ravel() if degree[node] != 2]
        if odd:
            node = min(odd, key=lambda node: int(degree[node]))
            x, y = ends[np.flatnonzero(nodes.ravel() == node)[0]]
            reason = (
                f"open, so it encloses nothing; it ends at ({x:g}, {y:g}) m"
                if degree[node] == 1
                else f"{degree[node]} ends meet at ({x:g}, {y:g}) m, an outline must not branch"
            )
            problems.append(f"{_names([parts[i] for i in members])}: {reason}")
        elif len(members):
            outlines.append(_in_order(parts, nodes, members.tolist()))
    return outlines


def polygon_of(
    outline: Sequence[Part], tolerance: float, problems: list[str], *, grow: bool
) -> shapely.Polygon | None:
    """Return the polygon of a closed outline, or note why there is none.

    The polygon contains the enclosed area if `grow` is set and lies within it otherwise.  It
    deviates from that area by at most `tolerance` [m].
    """
    for share in _FINER:
        hulls = [hull for part in outline for hull in _hulls(part, tolerance, share)]
        rough, polygon = _polygon(hulls, grow)
        if polygon is not None:
            return polygon
    fault = None if rough is None else ring_fault(rough)
    nearness = f"its outline comes nearer to itself than {_FINER[-1] * tolerance:g} m"
    problems.append(f"{_names(outline)}: {fault or nearness}")
    return None


def _meeting(ends: Array, parts: Sequence[Part]) -> NDArray[np.int64]:
    """Return for each end the index of its node; ends that meet share a node."""
    places = np.concatenate([hull for part in parts for hull in part.hulls])
    reach = JOIN * float(np.ptp(places, axis=0).max())
    different, which = np.unique(ends, axis=0, return_inverse=True)
    pairs = KDTree(different).query_pairs(reach, output_type="ndarray")
    links = (np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1]))
    graph = coo_array(links, shape=(len(different), len(different)))
    nodes = connected_components(graph, directed=False)[1].astype(np.int64)
    return np.asarray(nodes[which.ravel()])


def _in_order(parts: Sequence[Part], nodes: NDArray[np.int64], members: list[int]) -> list[Part]:
    """Return the members of one ring in the order of walking around it."""
    at: dict[int, list[int]] = {}
    for index in members:
        for node in nodes[index].tolist():
            at.setdefault(node, []).append(index)
    index, node, outline = members[0], int(nodes[members[0], 0]), []
    for _ in members:
        backwards = bool(nodes[index, 0] != node)
        outline.append(parts[index]._replace(backwards=backwards))
        node = int(nodes[index, 0 if backwards else 1])
        index = next((other for other in at[node] if other != index), index)
    return outline


def _hulls(part: Part, tolerance: float, share: float) -> Hulls:
    hulls = part.hulls if share == 1.0 else part.follow(share * tolerance)
    return [hull[::-1] for hull in reversed(hulls)] if part.backwards else hulls


def _polygon(hulls: Hulls, grow: bool) -> tuple[shapely.Polygon | None, shapely.Polygon | None]:
    """Return the polygon of the chords, and that polygon united with (or minus) the hulls.

    Either is None where it is not a simple polygon.
    """
    corners = np.array([hull[0] for hull in hulls])
    if len(corners) < 3:
        return None, None
    chords = shapely.Polygon(corners)
    if ring_fault(chords):
        return chords, None
    following = np.roll(corners, -1, axis=0)
    bodies = [
        shapely.MultiPoint(np.vstack((hull[:-1], end))).convex_hull
        for hull, end in zip(hulls, following, strict=True)
        if len(hull) > 2
    ]
    if not bodies:
        return chords, chords
    area = shapely.union_all([chords, *bodies]) if grow else chords - shapely.union_all(bodies)
    area = shapely.simplify(area, _STRAIGHT)
    sound = area.geom_type == "Polygon" and not area.interiors and not ring_fault(area)
    return chords, area if sound else None


def _names(parts: Sequence[Part]) -> str:
    more = f" and {len(parts) - _NAMED} more" if len(parts) > _NAMED else ""
    return ", ".join(part.name for part in parts[:_NAMED]) + more
