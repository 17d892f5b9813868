"""Reads the nodes of a VDA 5050 order, between which its edges lead.

Decides: what nodes may contain, and the wording of each problem.  Must not know: trajectories,
which alone decide where a robot drives.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Final

from coordinator.exchange.vda5050_finder import Finder
from coordinator.exchange.vda5050_sequence import Named, in_sequence
from coordinator.scenario.checks import COORDINATE, Quantity, show

_DEVIATION: Final = Quantity("m", from_least=True)
_ENDS: Final = ("startNodeId", "endNodeId")


def read_nodes(order: Mapping[str, Any], found: Finder) -> float:
    """Return the least deviation [m] that the nodes allow; note what is wrong with them.

    A node states its deviation as a number or as the axes of an ellipse; 0 counts as not stated.
    An order need not have nodes.
    """
    least = math.inf
    named: list[Named] = []
    for i, node in enumerate(_nodes(order, found)):
        if not isinstance(node, dict):
            found.note(f"nodes[{i}]", f"{show(node)} is not an object")
            continue
        named.append((f"nodes[{i}]", node))
        position, where = node.get("nodePosition"), f"nodes[{i}].nodePosition"
        if isinstance(position, dict):
            least = min(least, _deviation(position, where, found))
        elif position is not None:
            found.note(where, f"{show(position)} is not an object")
    in_sequence(named, found)
    return least


def check_ends(order: Mapping[str, Any], edges: list[Named], found: Finder) -> None:
    """Note edges that lead from or to a node that the order does not have."""
    nodes = order.get("nodes")
    if not nodes or not isinstance(nodes, list):
        return
    names = [node.get("nodeId") for node in nodes if isinstance(node, dict)]
    known = {name for name in names if isinstance(name, str)}
    for where, edge in edges:
        for end in _ENDS:
            name = edge.get(end)
            if name is not None and not (isinstance(name, str) and name in known):
                found.note(f"{where}.{end}", f"{show(name)} is not a node of this order")


def _nodes(order: Mapping[str, Any], found: Finder) -> list[Any]:
    return found.items(order, "nodes", "nodes") if order.get("nodes") is not None else []


def _deviation(position: Mapping[str, Any], where: str, found: Finder) -> float:
    """Return how far [m] a robot may be from a node's place; inf if the node states nothing."""
    for axis in "xy":
        if position.get(axis) is not None:
            found.number(position[axis], f"{where}.{axis}", COORDINATE)
    said = position.get("allowedDeviationXY")
    given = {"": said} if not isinstance(said, dict) else {f".{k}": said.get(k) for k in "ab"}
    least = math.inf
    for part, value in given.items():
        if value is not None:
            allowed = found.number(value, f"{where}.allowedDeviationXY{part}", _DEVIATION)
            least = min(least, allowed or math.inf)
    return least
