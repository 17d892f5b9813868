"""A day's work in virtual time: robots that get one order after another, to free docks.

A robot's next order becomes known when its last one is done; with `--queued` all orders are known
from the start, and a robot drives between two docks of its own.  Printed are how long orders take
beyond driving alone, how long a course is looked for (CPU of planning and proof), and how many
robots stand.  `--cobra` runs the experiment of Cap, Vokrinek and Kleiner (2015) on floors of the
same kind: robots of their sizes at 1 m/s that start and stop at once, tau 0.3 s and "auto"; the
extra time counts from the order on, theirs includes 3.1 to 3.2 s of standing before each task.

`python -m benchmarks orders` runs the smaller cells; `python -m benchmarks.orders --most 1000`
larger ones, `--long 10000` that many orders with 50 robots: once without black boxes, for the
memory, and once judged by rows that are 100 ms apart.

Decides: the cells and what is measured.
"""

from __future__ import annotations

import argparse
import gc
import math
import resource
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final, Literal

import numpy as np
from msgspec.structs import replace

from benchmarks.campaign import record
from benchmarks.table import Row
from coordinator.fleet.log_records import CourseRequest
from coordinator.planning.course_search import Answer
from coordinator.planning.planner import plan_scenario
from coordinator.scenario.model import Demand, Order, Scenario
from protocol.messages import ORDER_DONE
from protocol.phases import FREEZE, MOVING
from protocol.timing import MILLISECOND, SECOND
from sim.campaigns.truth import touches
from sim.floors.generator import generate
from sim.floors.layout import Kind
from sim.world.memory_transport import MemoryNetwork
from sim.world.virtual_fleet import World

FLOORS: Final[dict[str, Kind]] = {"open": "open", "office": "rooms", "warehouse": "warehouse"}
SIZES: Final = (10, 20, 50, 100, 200, 500, 1_000)
ORDERS: Final = 4
PATIENCE: Final = 300.0
"""A run ends when no order was done for this long [s of virtual time]."""

COBRA: Final = (("open", 50, 0.2), ("office", 30, 0.27), ("warehouse", 50, 0.25))
"""Floor, robots, radius [m]."""
_PUBLISHED: Final = {"open": 5.7, "office": 15.9, "warehouse": 10.4}
_PERIOD_NS: Final = 20 * MILLISECOND
_EARLY: Final = 0.2
"""Memory is measured when this share of the orders is done, and at the end."""


def day(kind: str, robots: int, seed: int, per_robot: int = ORDERS) -> Scenario:
    """Return a floor with idle robots at docks, twice as many docks as robots, and a demand."""
    made = generate(FLOORS[kind], robots, seed)
    docks = tuple(place[:2] for one in made.robots for place in (one.start, one.goal))
    demand = Demand(places=docks, per_robot=per_robot, first_within=30.0, seed=seed)
    idle = tuple(replace(one, goal=one.start, via=()) for one in made.robots)
    return replace(made, robots=idle, demand=demand)


def queued_day(kind: str, robots: int, seed: int) -> Scenario:
    """Return a floor with idle robots of ORDERS orders each, between two docks of its own."""
    made = day(kind, robots, seed)
    docks = {one.id: (one.goal, one.start) for one in generate(FLOORS[kind], robots, seed).robots}
    orders = tuple(
        Order(id=f"{name}-{count}", goal=docks[name][count % 2], robot=name)
        for count in range(ORDERS)
        for name in docks
    )
    return replace(made, demand=None, orders=orders)


class _Timed:
    """Times the searches for courses in a world: CPU [s] of each."""

    def __init__(self, world: World) -> None:
        self.seconds: list[float] = []
        searches = world.mission.dispatcher.searches
        self._search_for = searches.search_for
        searches.search_for = self._timed  # type: ignore[method-assign]

    def _timed(self, request: CourseRequest) -> Callable[[], Answer]:
        search = self._search_for(request)

        def timed() -> Answer:
            began = time.thread_time()
            answer = search()
            self.seconds.append(time.thread_time() - began)
            return answer

        return timed


def run(scenario: Scenario, name: str, row_period_ns: int | None = 1) -> Row:
    """Run a scenario until all orders are over, and return its row of the table.

    `row_period_ns`: the time between two rows of the black boxes that are judged; None for none.
    """
    document = plan_scenario(scenario)
    world = World(
        scenario,
        document,
        MemoryNetwork(1),
        period_ns=_PERIOD_NS,
        row_period_ns=row_period_ns or 10**15,
    )
    gc.collect()
    gc.freeze()  # As the coordinator does, or its searches pay for the objects of the plan.
    timed, began = _Timed(world), time.process_time()
    fleet, stands, done, since = world.fleet, list[float](), 0, 0
    early, wanted = math.nan, _number_of_orders(scenario)
    while not fleet.is_finished and world.now_ns - since < PATIENCE * SECOND:
        world.run(1.0)
        agents = [robot.service.agent for robot in world.robots.values()]
        driving = sum(a.phase == MOVING and a.drive_speed > 0.0 for a in agents)
        stands.append(1.0 - driving / len(agents))
        if fleet.orders.done > done:
            done, since = fleet.orders.done, world.now_ns
        if math.isnan(early) and done >= _EARLY * wanted:
            early = _memory()
    cpu, memory = time.process_time() - began, _memory()
    tasks = [one for one in fleet.orders.tasks.values() if not one.makes_room]
    over = [one for one in tasks if one.state == ORDER_DONE]
    extra, free_ms = list[int](), dict[str, int]()
    for one in sorted(over, key=lambda one: one.arrived_ms or 0):
        since_ms = max(one.released_ms, free_ms.get(one.robot, 0))
        free_ms[one.robot] = one.arrived_ms or 0
        extra.append(free_ms[one.robot] - since_ms - (one.alone_ms or 0))
    minutes = (world.now_ns - world.began_ns) / SECOND / 60.0
    search = np.percentile(timed.seconds, [50, 99]) * 1000.0 if timed.seconds else (0.0, 0.0)
    return {
        "floor": name,
        "robots": len(scenario.robots),
        "orders": len(tasks),
        "done": len(over),
        "touch": len(touches(document, world.blackboxes())) if row_period_ns else "not judged",
        "freezes": sum(one.phase == FREEZE for one in fleet.incidents),
        "orders/min": len(over) / minutes,
        "extra s": float(np.mean(extra)) / 1000.0 if extra else math.nan,
        "p95": float(np.percentile(extra, 95)) / 1000.0 if extra else math.nan,
        "alone s": float(np.mean([one.alone_ms or 0 for one in over])) / 1000.0,
        "search ms": float(search[0]),
        "p99 ms": float(search[1]),
        "CPU ms/order": 1000.0 * cpu / max(len(over), 1),
        "stand": float(np.mean(stands)),
        "MB early": early,
        "MB": memory,
    }


def _number_of_orders(scenario: Scenario) -> int:
    """Return how many orders a scenario gives, without those that make room."""
    demand = scenario.demand
    wanted = 0 if demand is None else demand.per_robot * len(scenario.robots)
    return wanted + len(scenario.orders)


def _memory() -> float:
    """Return the memory that this process has now [MB]."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * resource.getpagesize() / 2**20


def cobra() -> list[Row]:
    """Return rows of the experiment, for tau 0.3 s and "auto"."""
    rows = []
    taus: tuple[float | Literal["auto"], ...] = (0.3, "auto")
    for kind, robots, radius in COBRA:
        for tau in taus:
            made = day(kind, robots, 1)
            fast = tuple(
                replace(
                    one,
                    radius=min(radius, one.radius),
                    max_speed=1.0,
                    max_accel=math.inf,
                    max_lateral_accel=math.inf,
                    max_turn_rate=math.inf,
                )
                for one in made.robots
            )
            row = run(replace(made, robots=fast, tau=tau), kind)
            rows.append({"tau": str(tau), "COBRA s": _PUBLISHED[kind], **row})
    return rows


def orders(
    floors: Sequence[str] = tuple(FLOORS),
    most: int = 50,
    made: Callable[[str, int, int], Scenario] = day,
) -> list[Row]:
    """Return rows of a day's work on these floors, with up to so many robots."""
    return [run(made(kind, n, 1), kind) for kind in floors for n in SIZES if n <= most]


def main(arguments: Sequence[str] | None = None) -> None:
    """Run cells and print them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--most", type=int, default=50, help="most robots")
    parser.add_argument("--floor", choices=tuple(FLOORS), help="one floor alone")
    parser.add_argument("--long", type=int, default=0, help="so many orders with 50 robots")
    parser.add_argument("--queued", action="store_true", help="orders known from the start")
    parser.add_argument("--cobra", action="store_true")
    asked = parser.parse_args(arguments)
    if asked.cobra:
        record("cobra", {"COBRA's experiment on floors of the same kind": cobra()})
        return
    if asked.long:
        scenario = day("open", 50, 1, asked.long // 50)
        rows = [run(scenario, "open", None), run(scenario, "open", 100 * MILLISECOND)]
        record("orders_long", {f"{asked.long} orders": rows})
        return
    floors = [asked.floor] if asked.floor else list(FLOORS)
    if asked.queued:
        rows = orders(floors, asked.most, queued_day)
        record("orders_queued", {"four orders a robot, known from the start": rows})
        return
    record("orders", {"a day's work: four orders a robot": orders(floors, asked.most)})


if __name__ == "__main__":
    main()
