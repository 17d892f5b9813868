"""Fleets in virtual time that get orders while faults strike: whether robots touch or get stuck.

Each seed draws a floor, orders (some by name, some not, with places to pass and dwells), redirects,
cancellations, closed places, robots that join, and faults.  A run is good if no two robots touch,
no robot touches anything solid, and the fleet ends with every order done, cancelled or refused with
a reason.

`python -m benchmarks.order_campaign --count 2000 --kept FILE` runs seeds and prints a table.
Decides: what is drawn.  Must not know: how courses are found.
"""

from __future__ import annotations

import math
from collections import Counter
from itertools import combinations
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from typing import Final, NamedTuple

from msgspec.structs import replace

from benchmarks.campaign import in_turn, parser_of, record
from benchmarks.table import Row
from coordinator.planning.planner import plan_scenario
from coordinator.scenario.model import Link, Scenario
from protocol import keys
from protocol.codec import encode
from protocol.messages import (
    CANCELLED,
    END,
    ORDER_DONE,
    ORDER_STATES,
    REFUSED,
    Block,
    Cancel,
    Join,
    Message,
    Order,
    Tell,
    Unblock,
)
from protocol.phases import COMMAND_NAMES, FREEZE
from protocol.timing import MILLISECOND, SECOND
from sim.campaigns.truth import obstacle_touches
from sim.floors.generator import generate
from sim.floors.layout import Kind
from sim.judging.judge import least_separation
from sim.world.fault_script import USUAL, draw_faults, write_fault
from sim.world.memory_transport import MemoryNetwork
from sim.world.run_logs import RunLogs
from sim.world.virtual_fleet import USUAL_FLAWS, World

KINDS: Final[tuple[Kind, ...]] = ("open", "warehouse", "rooms", "polygons")
LASTS: Final = 60.0
"""Orders are given within this [s]."""

PATIENCE: Final = 400.0
"""A run has to end within so long [s] after it was told to end."""

_LINKS: Final = ((0.0, 0.005), (0.1, 0.1), (0.2, 0.2))
"""Loss and delay [s] of links."""

_PACES: Final = (1.0, 1.0, 2.0, 4.0)
_MARGINS: Final = (0.1, 0.1, 0.05, 0.02)
"""How much quicker robots are and speed up than the floor's, and margins [m]: quick robots with
little tolerance drive farther in a tick than they may be off."""


class Result(NamedTuple):
    """One run: what was wrong with it, if anything, and what happened."""

    seed: int
    problems: tuple[str, ...]
    orders: dict[str, int]
    freezes: int
    faults: tuple[str, ...]


def _script(dice: Random, scenario: Scenario) -> list[tuple[float, Message]]:
    """Return what operators say and when [s after the first GO]."""
    names = [robot.id for robot in scenario.robots]
    docks = [place[:2] for robot in scenario.robots for place in (robot.start, robot.goal)]
    said: list[tuple[float, Message]] = []
    count = dice.randint(3, 4 * len(names))
    for number in range(count):
        time, name = dice.uniform(0.5, LASTS), f"o{number}"
        order = Order(
            9,
            name,
            dice.choice(docks),
            robot=dice.choice(["", dice.choice(names)]),
            via=(dice.choice(docks),) if dice.random() < 0.1 else (),
            dwell_ms=dice.choice([0, 0, 1_500]),
            priority=dice.choice([0, 0, 5]),
            now=dice.random() < 0.2,
        )
        said.append((time, order))
        if dice.random() < 0.15:
            said.append((time + dice.uniform(0.0, 15.0), Cancel(9, name)))
    if dice.random() < 0.3:
        (x, y), time = dice.choice(docks), dice.uniform(1.0, LASTS)
        x, y, half = (
            x + dice.uniform(-1.0, 1.0),
            y + dice.uniform(-1.0, 1.0),
            dice.uniform(0.2, 0.8),
        )
        ring = (
            (x - half, y - half),
            (x + half, y - half),
            (x + half, y + half),
            (x - half, y + half),
        )
        said.append((time, Block(9, "wet", ring)))
        said.append((time + dice.uniform(5.0, 30.0), Unblock(9, "wet")))
    said.append((LASTS + 20.0, Tell(9, END)))
    return sorted(said, key=lambda one: one[0])


def _paced(made: Scenario, seed: int) -> Scenario:
    """Return a floor whose robots are as quick, and keep as much distance, as the seed draws."""
    dice = Random(f"pace {seed}")
    quicker, margin = dice.choice(_PACES), dice.choice(_MARGINS)
    robots = tuple(
        replace(
            one,
            max_speed=quicker * one.max_speed,
            max_accel=quicker * one.max_accel,
            max_lateral_accel=quicker * one.max_lateral_accel,
        )
        for one in made.robots
    )
    return replace(made, robots=robots, margin=margin)


def run_seed(seed: int) -> Result:
    """Run one seed."""
    dice = Random(f"orders {seed}")
    made = _paced(generate(dice.choice(KINDS), dice.randint(2, 8), seed % 40), seed)
    joins = made.robots[-1] if len(made.robots) > 2 and dice.random() < 0.4 else None
    robots = tuple(
        replace(one, goal=one.start, via=()) if dice.random() < 0.7 else one
        for one in made.robots
        if one is not joins
    )
    scenario = replace(made, robots=robots)
    script = _script(dice, made)
    if joins is not None:
        x, y = joins.start[:2]
        place = (x, y, dice.uniform(-3.0, 3.0))
        said = Join(9, joins.id, place, joins.radius, joins.max_speed, joins.max_accel)
        script = sorted([*script, (dice.uniform(0.5, 20.0), said)], key=lambda one: one[0])
    names = [robot.id for robot in robots]
    faults = draw_faults(Random(f"faults {seed}"), names, LASTS, USUAL) if seed % 3 else ()
    loss, delay = dice.choice(_LINKS)
    scenario = replace(scenario, link=Link(delay=delay, loss=loss))
    network = MemoryNetwork(seed, loss=loss, delay_ns=(0, round(delay * SECOND)))
    document = plan_scenario(scenario)
    with TemporaryDirectory() as folder:
        logs = RunLogs(Path(folder), power_cuts=True)
        world = World(
            scenario,
            document,
            network,
            seed=seed,
            faults=faults,
            flaws=USUAL_FLAWS,
            planning_ns=dice.randint(50, 1_500) * MILLISECOND,
            period_ns=20 * MILLISECOND,
            logs=logs,
            stays=True,
        )
        _drive(world, script, joins.id if joins is not None else "", seed)
        logs.close()
    return _judged(world, scenario, joins, seed, tuple(write_fault(one) for one in faults))


def _drive(world: World, script: list[tuple[float, Message]], joins: str, seed: int) -> None:
    """Let operators say what they say until it has an effect, and let the fleet come to its end."""
    session = world._network.session("operator")
    kinds = {Tell: keys.tell, Block: keys.block, Unblock: keys.block, Join: keys.roster}
    while not world.began_ns and world.now_ns < 60 * SECOND:
        world.run(0.5)
    said: list[Message] = []
    end_ns = world.began_ns + round((LASTS + 20.0 + PATIENCE) * SECOND)
    while world.now_ns < end_ns and not world.fleet.is_finished:
        now = (world.now_ns - world.began_ns) / SECOND
        while script and script[0][0] <= now:
            _, message = script.pop(0)
            if isinstance(message, Unblock):
                said = [one for one in said if not isinstance(one, Block)]
            said.append(message)
            if isinstance(message, Join):
                world.add(joins, message.radius_m, message.max_accel_mps2, 900 + seed % 90)
        for message in said[-4:]:  # They are repeated, because links lose some.
            key = kinds.get(type(message), keys.order)(world.fleet.name)
            session.put(key, encode(message))
        world.run(0.5)
    world.go_on(1.0)


def _judged(
    world: World, scenario: Scenario, joins: object, seed: int, faults: tuple[str, ...]
) -> Result:
    fleet = world.fleet
    problems = (
        [] if fleet.is_finished else [f"not OVER but {COMMAND_NAMES[fleet.phase]} at the end"]
    )
    states: Counter[str] = Counter()
    for name, task in fleet.orders.tasks.items():
        states[ORDER_STATES[task.state]] += 1
        if task.state not in (ORDER_DONE, CANCELLED, REFUSED):
            problems.append(f"{name} of {task.robot} is {ORDER_STATES[task.state]}: {task.reason}")
        elif task.state == REFUSED and not task.reason:
            problems.append(f"{name} is refused without a reason")
    boxes = world.blackboxes()
    radius = {robot.id: robot.radius for robot in scenario.robots}
    if joins is not None:
        radius[joins.id] = joins.radius  # type: ignore[attr-defined]
    for a, b in combinations([name for name, box in boxes.items() if len(box.t)], 2):
        since = max(boxes[a].t[0], boxes[b].t[0]) if joins is not None else -math.inf
        apart, time = least_separation(
            boxes[a].between(since, math.inf, 0.0), boxes[b].between(since, math.inf, 0.0)
        )
        if apart < radius[a] + radius[b]:
            problems.append(f"{a} and {b} touch at {time:.2f} s: {apart:.4f} m")
    document = world.mission.documents[1]
    known = {one.id: boxes[one.id] for one in document.robots}
    problems += [touch.text() for touch in obstacle_touches(document, known, world.faults)]
    freezes = sum(one.phase == FREEZE for one in fleet.incidents)
    return Result(seed, tuple(problems), states, freezes, faults)


def main() -> None:
    """Run seeds and print what was wrong."""
    asked = parser_of(__doc__, 100).parse_args()
    seeds = range(asked.from_seed, asked.from_seed + asked.count)
    results = in_turn(run_seed, seeds, asked.jobs, asked.kept)
    states: Counter[str] = Counter()
    for one in results:
        states.update(one.orders)
    bad = [one for one in results if one.problems]
    total: Row = {
        "runs": len(results),
        "bad": len(bad),
        "freezes": sum(one.freezes for one in results),
        **states,
    }
    rows: list[Row] = [
        {"seed": one.seed, "problem": problem, "faults": " ".join(one.faults)}
        for one in bad
        for problem in one.problems
    ]
    record("order_campaign", {"orders among faults": [total], "what was wrong": rows})


if __name__ == "__main__":
    main()
