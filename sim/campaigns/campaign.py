"""One run of a campaign in virtual time: what follows from its seed, and its outcome.

Decides: what a run consists of, and when it counts as a violation.  Must not know: options,
processes, files.  The same arguments give the same outcome.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from typing import Final

import msgspec
from msgspec.structs import replace

from coordinator.plan.document import PlanDocument
from coordinator.planning.planner import plan_scenario
from coordinator.scenario.model import Link, Scenario
from protocol.phases import COMMAND_NAMES
from protocol.timing import MILLISECOND, SECOND
from sim.campaigns.latencies import Latencies, latencies
from sim.campaigns.truth import Touch, arrived, excused, obstacle_touches, touches
from sim.world.fault_script import USUAL, draw_faults, write_fault
from sim.world.fault_text import Fault
from sim.world.memory_transport import DROP_NOTICE_NS, MemoryNetwork
from sim.world.run_logs import RunLogs
from sim.world.virtual_fleet import USUAL_FLAWS, World

LINKS: Final = (Link(delay=0.005), Link(delay=0.1, loss=0.1), Link(delay=0.3, loss=0.3))
"""Every seed gets one of these links, so that three plans suffice for all seeds."""

_OVERTAKING: Final = 0.1
"""The share of messages that are duplicated, and the share that later messages overtake.

Both shares are this number, or half of it on a link without loss."""

LOOK: Final = 0.2
"""How often [s] of virtual time a run is looked at."""

_PATIENCE: Final = 300.0
_AFTERMATH: Final = 1.0
_SLOW_NOTICE: Final = 10 * SECOND
"""How long the link of a robot that has lost its power counts as up."""

_PLANNING: Final = (50 * MILLISECOND, 3 * SECOND)
_PERIODS: Final = (10 * MILLISECOND, *3 * (20 * MILLISECOND,))
"""A robot's tick period is one of these at random: mostly 50 Hz, the slowest sensible rate."""


@dataclass(frozen=True)
class Wish:
    """The bounds of a campaign's random choices: kinds of faults, worst loss and delay, and tau.

    `authority` is for tests alone, see World.
    """

    kinds: tuple[str, ...] = USUAL
    loss: float = LINKS[-1].loss
    delay: float = LINKS[-1].delay
    tau: float | None = None
    authority: bool = True


class Outcome(msgspec.Struct, frozen=True):
    """The outcome of one run; `violations` are sentences, none if the run is good.

    `excused`: the robots that were not expected to arrive, and why; `said`: the coordinator's
    incidents about faults and about robots that stay; `anyway`: how many excused robots arrived
    nevertheless.
    """

    seed: int
    faults: tuple[str, ...]
    violations: tuple[str, ...]
    over: bool
    touches: tuple[Touch, ...]
    stuck: tuple[str, ...]
    arrived: int
    expected: int
    excused: dict[str, str]
    said: tuple[str, ...]
    epochs: int
    seconds: float
    latencies: Latencies
    anyway: int = 0
    obstacle_touches: tuple[Touch, ...] = ()


def run_seed(
    scenario: Scenario,
    seed: int,
    wish: Wish = Wish(),
    faults: Sequence[Fault] | None = None,
    folder: Path | None = None,
) -> Outcome:
    """Run a fleet once; its link, clocks, bodies, and faults unless given, follow from the seed.

    The logs go into `folder`, if there is one.

    Raises PlanError when the scenario has no plan.
    """
    link = Random(f"link {seed}").choice(LINKS)
    link = Link(delay=min(link.delay, wish.delay), loss=min(link.loss, wish.loss))
    planned, document = plan_for(scenario, link, wish.tau)
    if faults is None:
        names = [robot.id for robot in document.robots]
        finish = max(robot.finish_time for robot in document.robots)
        faults = draw_faults(Random(f"faults {seed}"), names, finish, wish.kinds)
    return run_one(planned, document, seed, faults, authority=wish.authority, folder=folder)


@functools.lru_cache(maxsize=16)
def plan_for(scenario: Scenario, link: Link, tau: float | None) -> tuple[Scenario, PlanDocument]:
    """Return the scenario on this link, and its plan; tau None means the whole fault budget."""
    asked = replace(scenario, link=link, tau="auto" if tau is None else tau)
    return asked, plan_scenario(asked)


def run_one(
    scenario: Scenario,
    document: PlanDocument,
    seed: int,
    faults: Sequence[Fault],
    *,
    authority: bool = True,
    folder: Path | None = None,
    watch: Callable[[World], None] = lambda _: None,
) -> Outcome:
    """Run a planned fleet with these faults; link, clocks and bodies follow from the seed.

    `watch` is called with the world now and then, see run_world.  Its logs go into `folder`.  A
    coordinator that is to be restarted needs a log to resume from, so a temporary folder is used
    when none is given.
    """
    with ExitStack() as stack:
        if folder is None and any(fault.kind == "coordinator-restart" for fault in faults):
            folder = Path(stack.enter_context(TemporaryDirectory()))
        logs = None
        if folder is not None:
            logs = stack.enter_context(closing(RunLogs(folder, power_cuts=True)))
        world = make_world(scenario, document, seed, faults, authority=authority, logs=logs)
        over, over_ns = run_world(world, document, lambda: watch(world))
    boxes = world.blackboxes()
    found = touches(document, boxes, faults)
    with_obstacles = obstacle_touches(document, boxes, faults)
    excuses = excused(world, document, over_ns)
    there = arrived(world, document, boxes)
    expected = [robot.id for robot in document.robots if robot.id not in excuses]
    stuck = [name for name in expected if name not in there]
    violations = [] if over else [f"not OVER but {COMMAND_NAMES[world.fleet.phase]} at the end"]
    violations += [f"{name} has not arrived" for name in stuck]
    violations += [touch.text() for touch in with_obstacles]
    if is_promised(document):
        violations += [touch.text() for touch in found]
    return Outcome(
        seed=seed,
        faults=tuple(write_fault(fault) for fault in faults),
        violations=tuple(violations),
        over=over,
        touches=tuple(found),
        stuck=tuple(stuck),
        arrived=len(set(expected) & there),
        expected=len(expected),
        excused=excuses,
        said=tuple(one.text for one in world.fleet.incidents if one.kind in ("stays", "fault")),
        epochs=world.fleet.epoch,
        seconds=round((over_ns - world.began_ns) / SECOND, 3),
        latencies=latencies(world),
        anyway=len(set(excuses) & there),
        obstacle_touches=tuple(with_obstacles),
    )


def run_world(
    world: World,
    document: PlanDocument,
    watch: Callable[[], None] = lambda: None,
    step: float = LOOK,
) -> tuple[bool, int]:
    """Run a world to its end; return whether the fleet reached OVER, and since when [ns].

    The time of the last phase change counts, because a coordinator that hangs ends later than that.
    `watch` is called every `step` seconds of virtual time.  A world in which orders are still done
    goes on; one in which nothing more becomes of them does not.
    """
    finish = max(robot.finish_time for robot in document.robots)
    longest = round((_PATIENCE + 3.0 * finish * (1 + len(world.faults))) * SECOND)
    end_ns, done = world.now_ns + longest, 0
    while world.now_ns < end_ns and not world.fleet.is_finished:
        world.run(step)
        watch()
        orders = world.fleet.orders
        if orders.done != done or orders.is_quiet:
            end_ns, done = world.now_ns + longest, orders.done
    over = world.fleet.is_finished
    said = (one.now_ns for one in world.fleet.incidents if one.kind == "phase")
    over_ns = max(said, default=world.now_ns) if over else world.now_ns
    world.go_on(_AFTERMATH)
    return over, over_ns


def make_world(
    scenario: Scenario,
    document: PlanDocument,
    seed: int,
    faults: Sequence[Fault],
    *,
    authority: bool = True,
    logs: RunLogs | None = None,
) -> World:
    """Return a world on the scenario's link, with random clocks, bodies and planning times."""
    dice = Random(f"world {seed}")
    link = scenario.link
    overtaking = _OVERTAKING if link.loss > 0.0 else 0.5 * _OVERTAKING
    network = MemoryNetwork(
        seed,
        loss=link.loss,
        delay_ns=(0, round(link.delay * SECOND)),
        doubling=overtaking,
        reordering=overtaking,
        drop_notice_ns=dice.choice((DROP_NOTICE_NS, _SLOW_NOTICE)),
    )
    return World(
        scenario,
        document,
        network,
        seed=dice.randrange(1 << 32),
        faults=faults,
        flaws=USUAL_FLAWS,
        planning_ns=dice.randint(*_PLANNING),
        period_ns=dice.choice(_PERIODS),
        authority=authority,
        logs=logs,
    )


def is_promised(document: PlanDocument) -> bool:
    """Return whether the plan claims that no robots touch, whatever happens."""
    return document.proof is not None and bool(document.proof.survives)
