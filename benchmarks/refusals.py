"""Whether refusals are true: refused scenes of two and three robots, searched exhaustively.

`python -m benchmarks.refusals --count 300` plans that many small random floors for each number of
robots, some of them little wider than one robot.  Each scene that is refused because robots block
each other is searched by `joint_search`: one that it solves was refused wrongly.  Times are those
of one core.

Decides: the scenes and what is counted.  Must not know: how plans are found, or the search works.
"""

from __future__ import annotations

import time
from collections import Counter
from pathlib import Path
from random import Random
from statistics import median
from typing import Final, NamedTuple

import shapely
from msgspec.structs import replace

from benchmarks.campaign import WORKERS, in_turn, parser_of, record
from benchmarks.joint_search import Found, search
from benchmarks.table import Row
from coordinator.base.errors import PlanError
from coordinator.planning.planner import plan_scenario
from coordinator.scenario.model import Robot, Scenario, Workspace
from coordinator.schedule.refusals import BlockedError
from sim.floors.layout import MARGIN

COUNT: Final = 100
ROBOTS: Final = (2, 3)
_RADII: Final = (0.1, 0.15, 0.2, 0.3, 0.4)
_SPEED: Final = 1.0
_SPARE: Final = 0.01
"""How much farther [m] than they have to be robots are from anything where they start and end."""
_TRIES: Final = 200


class Tried(NamedTuple):
    """What became of a scene: planned, closed in or blocked; the time [s]; what a search found."""

    answer: str
    planning: float
    possible: str = ""


def refusals(
    count: int = COUNT, from_seed: int = 0, jobs: int = WORKERS, kept: Path | None = None
) -> list[Row]:
    """Return a row for each number of robots, over `count` seeds."""
    numbers = range(from_seed * len(ROBOTS), (from_seed + count) * len(ROBOTS))
    found = in_turn(measure, numbers, jobs, kept)
    return [_row(robots, found[k :: len(ROBOTS)]) for k, robots in enumerate(ROBOTS)]


def measure(number: int) -> Tried:
    """Plan a scene and search it if it is refused: numbers count the robots first, then seeds."""
    seed, k = divmod(number, len(ROBOTS))
    scenario = scene(ROBOTS[k], seed)
    began = time.process_time()
    try:
        plan_scenario(scenario)
        answer = "planned"
    except BlockedError:
        answer = "blocked"
    except PlanError:
        answer = "closed in"
    planning = time.process_time() - began
    possible = search(scenario).value if answer == "blocked" else ""
    return Tried(answer, planning, possible)


def scene(robots: int, seed: int) -> Scenario:
    """Return a small floor on which robots of several sizes have room where they start and end."""
    dice = Random(f"{robots} {seed}")
    while True:
        width, height = dice.uniform(3.0, 10.0), dice.uniform(0.9, 3.0)
        floor = ((0.0, 0.0), (width, 0.0), (width, height), (0.0, height))
        boxes = []
        for _ in range(dice.randint(0, 3)):
            x, y = dice.uniform(0.0, width), dice.uniform(0.0, height)
            right = min(x + dice.uniform(0.1, 2.0), width)
            top = min(y + dice.uniform(0.1, 0.7 * height), height)
            boxes.append(((x, y), (right, y), (right, top), (x, top)))
        workspace = Workspace(boundary=floor, obstacles=tuple(boxes))
        radii = [dice.choice(_RADII) for _ in range(robots)]
        ends = [_places(workspace, radii, dice) for _ in range(2)]
        if all(len(one) == robots for one in ends):
            made = tuple(
                Robot(
                    id=f"R{k}", start=start, goal=goal, radius=radius,
                    max_speed=_SPEED, max_accel=_SPEED, max_lateral_accel=_SPEED,
                )
                for k, (start, goal, radius) in enumerate(zip(*ends, radii, strict=True))
            )  # fmt: skip
            name = f"blocked-{robots}-{seed}"
            bare = Scenario(name=name, workspace=workspace, robots=(), margin=MARGIN)
            return replace(bare, robots=made)


def _places(floor: Workspace, radii: list[float], dice: Random) -> list[tuple[float, float]]:
    """Return places for robots of these radii, one after the other; fewer if one finds none."""
    edge = shapely.LinearRing(floor.boundary)
    solid = shapely.union_all([edge, *(shapely.Polygon(one) for one in floor.obstacles)])
    _, _, width, height = edge.bounds
    taken: list[tuple[shapely.Point, float]] = []
    for radius in radii:
        need = radius + MARGIN + _SPARE
        for _ in range(_TRIES):
            x, y = round(dice.uniform(0.0, width), 2), round(dice.uniform(0.0, height), 2)
            place = shapely.Point(x, y)
            clear = all(place.distance(other) >= need + theirs for other, theirs in taken)
            if clear and place.distance(solid) >= need:
                taken.append((place, radius))
                break
    return [(place.x, place.y) for place, _ in taken]


def _row(robots: int, tries: list[Tried]) -> Row:
    answers = Counter(one.answer for one in tries)
    blocked = [one for one in tries if one.answer == "blocked"]
    possible = Counter(one.possible for one in blocked)
    times = [one.planning for one in tries if one.answer != "planned"]
    return {
        "robots": robots,
        "scenes": len(tries),
        **{name: answers[name] for name in ("planned", "closed in", "blocked")},
        **{one.value: possible[one.value] for one in Found},
        "median refusal [s]": median(times) if times else 0.0,
        "worst [s]": max(times, default=0.0),
    }


def main() -> None:
    """Run the campaign that the command line names."""
    chosen = parser_of(__doc__, COUNT).parse_args()
    rows = refusals(chosen.count, chosen.from_seed, chosen.jobs, chosen.kept)
    record("refusals", {"refused scenes, searched exhaustively": rows})


if __name__ == "__main__":
    main()
