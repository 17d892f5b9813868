"""Measures one library on one floor: a job as JSON on stdin, times and lengths as JSON on stdout.

Run by the peers' own interpreter, which has numpy < 2 and none of our packages.  Each library is
used as its documentation shows, on polygons that neither touch nor overlap, after a floor of one
box that loads compiled code.

Job: library, boundary and polygons (counter-clockwise corners [m]), queries [[x0, y0, x1, y1]],
seconds (no query begins after this time).  Answer: prepare [s], queries [s each], lengths [m each,
null when no way was found].
"""

from __future__ import annotations

import json
import math
import sys
import time
from collections.abc import Callable
from itertools import pairwise

Ring = list[list[float]]
Ask = Callable[[float, float, float, float], float | None]

SMALL: Ring = [[4.0, 4.0], [6.0, 4.0], [6.0, 6.0], [4.0, 6.0]]
LARGE: Ring = [[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0]]


def extremitypathfinder(boundary: Ring, polygons: list[Ring]) -> Ask:
    """Prepare extremitypathfinder: the floor counter-clockwise, holes clockwise."""
    from extremitypathfinder import PolygonEnvironment

    environment = PolygonEnvironment()
    environment.store(boundary, [ring[::-1] for ring in polygons])

    def ask(x0: float, y0: float, x1: float, y1: float) -> float | None:
        return environment.find_shortest_path((x0, y0), (x1, y1), verify=False)[1]

    return ask


def pyvisgraph(_boundary: Ring, polygons: list[Ring]) -> Ask:
    """Prepare pyvisgraph, which takes no boundary; ways around separate polygons stay inside."""
    from pyvisgraph import Point, VisGraph

    graph = VisGraph()
    graph.build([[Point(x, y) for x, y in ring] for ring in polygons], status=False)

    def ask(x0: float, y0: float, x1: float, y1: float) -> float | None:
        way = graph.shortest_path(Point(x0, y0), Point(x1, y1))
        return sum(math.dist((a.x, a.y), (b.x, b.y)) for a, b in pairwise(way))

    return ask


LIBRARIES = {"extremitypathfinder": extremitypathfinder, "pyvisgraph": pyvisgraph}


def main() -> None:
    """Read the job, measure, and print the answer."""
    job = json.load(sys.stdin)
    build = LIBRARIES[job["library"]]
    build(LARGE, [SMALL])(1.0, 5.0, 9.0, 5.0)
    begin = time.perf_counter()
    ask = build(job["boundary"], job["polygons"])
    ready = time.perf_counter()
    spent: list[float] = []
    lengths: list[float | None] = []
    for query in job["queries"]:
        asked = time.perf_counter()
        if spent and asked - ready > job["seconds"]:
            break
        lengths.append(ask(*query))
        spent.append(time.perf_counter() - asked)
    json.dump({"prepare": ready - begin, "queries": spent, "lengths": lengths}, sys.stdout)


if __name__ == "__main__":
    main()
