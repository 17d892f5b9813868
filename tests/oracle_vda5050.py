"""What VDA 5050 asks of an order beyond its JSON schema, from the text of the standard alone."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from tests.oracles import naive_points


def complaints(order) -> list[str]:
    """What is wrong with an order's structure, its trajectories, its base and horizon."""
    found = []
    nodes, edges = order["nodes"], order["edges"]
    sequence = sorted([*nodes, *edges], key=lambda part: part["sequenceId"])
    if [part["sequenceId"] for part in sequence] != list(range(len(sequence))):
        found.append("sequence ids have gaps")
    if any(("nodeId" in part) != (i % 2 == 0) for i, part in enumerate(sequence)):
        found.append("nodes and edges do not take turns")
    for part in (nodes, edges):
        ids = [one.get("nodeId", one.get("edgeId")) for one in part]
        if len(set(ids)) < len(ids):
            found.append(f"ids stand twice: {ids}")
    released = [part["released"] for part in sequence]
    if not released[0] or any(later and not before for before, later in pairwise(released)):
        found.append("the base is not at the beginning, in one piece")
    if not sequence[sum(released) - 1].get("nodeId"):
        found.append("the base does not end at a node")
    for before, edge, after in zip(sequence[::2], sequence[1::2], sequence[2::2], strict=False):
        if (edge["startNodeId"], edge["endNodeId"]) != (before["nodeId"], after["nodeId"]):
            found.append(f"{edge['edgeId']} does not lead between its neighbours")
        found += _of_edge(edge, before["nodePosition"], after["nodePosition"])
    actions = [action for node in nodes for action in node["actions"]]
    if len({action["actionId"] for action in actions}) < len(actions):
        found.append("action ids stand twice")
    return found


def curve(trajectory):
    """Degree, knots, points (n, 2) and weights of a trajectory."""
    control = trajectory["controlPoints"]
    points = np.array([(point["x"], point["y"]) for point in control])
    weights = [point["weight"] for point in control]
    return trajectory["degree"], trajectory["knotVector"], points, weights


def _of_edge(edge, begin, end):
    degree, knots, points, weights = curve(edge["trajectory"])
    if len(knots) != len(points) + degree + 1:
        yield f"{edge['edgeId']}: {len(knots)} knots for {len(points)} points of degree {degree}"
        return
    if knots != sorted(knots):
        yield f"{edge['edgeId']}: knots decrease"
    if knots[: degree + 1] != [0.0] * (degree + 1) or knots[-degree - 1 :] != [1.0] * (degree + 1):
        yield f"{edge['edgeId']}: knots are not clamped from 0 to 1"
        return
    inner = knots[degree + 1 : -degree - 1]
    if any(not 0.0 < knot < 1.0 or inner.count(knot) > degree for knot in inner):
        yield f"{edge['edgeId']}: an inner knot stands too often"
    if not all(weight > 0.0 for weight in weights):
        yield f"{edge['edgeId']}: a weight is not positive"
    line = naive_points(degree, knots, points, weights, np.linspace(0.0, 1.0, 2001))
    for place, point, reached in ((begin, points[0], line[0]), (end, points[-1], line[-1])):
        if math.dist(point, (place["x"], place["y"])) > 1e-9 or math.dist(reached, point) > 1e-6:
            yield f"{edge['edgeId']}: does not end at its node"
    if not 0.0 < edge["maximumSpeed"] == edge["maxSpeed"]:
        yield f"{edge['edgeId']}: has no speed"
    length = np.hypot(*np.diff(line, axis=0).T).sum()
    if abs(length - edge["length"]) > 1e-3 * (1.0 + length):
        yield f"{edge['edgeId']}: is {length:.4f} m long, says {edge['length']:.4f} m"
