"""Every run of a small fleet, up to a number of faults: a search over its states, depth first.

States that are the same at the same time are one state; one that was visited with as many faults
left is not visited again.  Where a check fails, the faults that led there are told.

A search can be made in parts, by when the first fault falls and which it is; what parts have in
common is then visited by each.

Decides: which states are visited, and how often it is looked whether the fleet can still end.
"""

from __future__ import annotations

import time
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from functools import cache
from itertools import combinations, islice
from typing import Final, NamedTuple

from msgspec.structs import replace

from coordinator.plan.wire import PackedPlan, packed
from coordinator.planning.planner import plan_fleet
from coordinator.scenario.model import Scenario
from protocol.messages import Order
from protocol.phases import ARMED, BRAKING, MOVING, OVER, STOP
from tests.exploration.checks import BrokenError, Checks, Marks, marks_of
from tests.exploration.forking import Digests
from tests.exploration.world import STEP, Fault, World
from tests.scenarios import a_robot, a_scenario

LEFT_OUT: Final = frozenset(
    {"incidents", "bad_messages", "log", "_recorded", "_order_states", "_tangent_s"}
)
"""Attributes on which nothing depends that a core does: records for people and for the log, and
where a copy's curve was evaluated last, which is done anew."""

PATIENCE: Final = 900
"""A fleet without further faults ends within so many steps."""

ENDS_EVERY: Final = 2_000
"""Of so many states visited, by their digests, from one it is looked whether the fleet can still
end."""

MERGED_EVERY: Final = 3
"""A run without faults left is compared with those visited every so many steps: a comparison takes
as long as two steps."""

Way = tuple[tuple[int, Fault], ...]
"""The steps and the faults that led to a state."""

State = tuple[World, Marks, int, Way]
"""A state, its marks, how many faults are left, and what led to it."""


class Part(NamedTuple):
    """The runs whose first faults fall in one step, every `pieces`-th of what can happen there."""

    step: int
    piece: int = 0
    pieces: int = 1


@dataclass
class Found:
    """States visited, steps made, how deep, runs to the end, what broke, and what led to it."""

    states: int = 0
    steps: int = 0
    deepest: int = 0
    ends: int = 0
    seconds: float = 0.0
    is_complete: bool = True
    broken: str = ""
    way: Way = ()


@cache
def scenario_of(robots: int) -> Scenario:
    """Return a floor on which all robots cross one another's ways in its middle."""
    fields = {"radius": 0.2, "max_speed": 0.8}
    ways = (((1.0, 2.5), (4.5, 2.5)), ((2.5, 1.0), (2.5, 4.5)), ((4.0, 4.0), (1.0, 1.0)))
    made = [
        a_robot(f"R{n}", start, goal, **fields)
        for n, (start, goal) in enumerate(ways[:robots], start=1)
    ]
    return a_scenario(made, size=(5.5, 5.5))


@cache
def _plan_of(robots: int) -> PackedPlan:
    return packed(plan_fleet(scenario_of(robots)).document)


def world_of(robots: int) -> World:
    """Return a fleet that has not begun, with an order that may come: R1 is to go elsewhere.

    On the other floor there is an obstacle beside the ways.
    """
    scenario = scenario_of(robots)
    corner = ((4.6, 0.2), (5.3, 0.2), (5.3, 0.9), (4.6, 0.9))
    other_floor = replace(scenario.workspace, obstacles=(corner,))
    redirected = Order(9, "elsewhere", (4.0, 1.0), robot="R1", now=True)
    return World(scenario, _plan_of(robots), redirected, other_floor)


class Explorer:
    """A search; `kinds`: the kinds of faults that happen, all by default."""

    def __init__(self, robots: int, faults: int, kinds: Collection[str] | None = None) -> None:
        self.found = Found()
        self._faults, self._kinds = faults, kinds
        self._world = world_of(robots)
        self._checks = Checks(scenario_of(robots).margin)
        self._digests = Digests(LEFT_OUT)
        self._visited: dict[bytes, int] = {}

    def explore(self, depth: int, seconds: float = float("inf"), part: Part | None = None) -> Found:
        """Visit all states up to so many steps, or as many as there is time [s] of the CPU for."""
        found, began = self.found, time.process_time()
        try:
            self._visit_all(self._begun(part), depth, began + seconds)
        except BrokenError as error:
            found.broken, found.is_complete = str(error), False
        found.states, found.seconds = len(self._visited), time.process_time() - began
        return found

    def _begun(self, part: Part | None) -> Iterator[State]:
        """Yield the states from which a part of the search begins, or all of it."""
        state = self._world, marks_of(self._world), self._faults, ()
        if part is None:
            yield state
            return
        for _ in range(part.step - 1):
            state = next(self._after(*state))
        yield from islice(self._after(*state, least=1), part.piece, None, part.pieces)

    def _visit_all(self, root: Iterator[State], depth: int, until: float) -> None:
        pending = [root]
        while pending:
            if time.process_time() > until:
                self.found.is_complete = False
                return
            state = next(pending[-1], None)
            if state is None:
                pending.pop()
            elif self._is_visited(state):
                continue
            elif state[2] == 0:
                self._drive_on(state, depth)
            elif self._goes_on(state[0], depth):
                pending.append(self._after(*state))

    def _is_visited(self, state: State) -> bool:
        """Return whether a state was visited with as many faults left; visit it."""
        world, _, left, way = state
        digest = self._digests.of(world)
        if self._visited.get(digest, -1) >= left:
            return True
        is_new = digest not in self._visited
        self._visited[digest] = left
        self.found.deepest = max(self.found.deepest, world.step_number)
        if is_new and int.from_bytes(digest[:4], "big") % ENDS_EVERY == 0:
            self._must_end(world, way)
        return False

    def _drive_on(self, state: State, depth: int) -> None:
        """Make the only run there is from a state with no faults left, until it joins another."""
        world, marks, left, way = state
        while self._goes_on(world, depth):
            self._step(world, marks, way)
            marks = marks_of(world)
            is_compared = world.step_number % MERGED_EVERY == 0 or not self._goes_on(world, depth)
            if is_compared and self._is_visited((world, marks, left, way)):
                return

    @staticmethod
    def _goes_on(world: World, depth: int) -> bool:
        return world.step_number < depth and not world.fleet.is_finished

    def _after(
        self, world: World, before: Marks, left: int, way: Way, least: int = 0
    ) -> Iterator[State]:
        """Yield the states after one, with `least` faults or more in the step, fewest first."""
        options = world.options()
        if self._kinds is not None:
            options = [one for one in options if one.kind in self._kinds]
        for count in range(least, min(left, len(options)) + 1):
            for faults in combinations(options, count):
                after = world.copy()
                told = (*way, *((world.step_number + 1, one) for one in faults))
                self._step(after, before, told, faults)
                yield after, marks_of(after), left - count, told

    def _step(self, world: World, before: Marks, way: Way, faults: Collection[Fault] = ()) -> None:
        self.found.steps += 1
        self.found.way = way
        try:
            world.step(faults)
        except AssertionError as error:
            raise BrokenError(f"a step ends with {error!r}") from error
        self._checks.look(world, before)

    def _must_end(self, state: World, way: Way) -> None:
        """Let a fleet drive on without further faults: it has to end, and nobody moves then.

        Before it sets out it may wait, for ever, for a robot that died.
        """
        world, before = state.copy(), marks_of(state)
        self.found.ends += 1
        for _ in range(PATIENCE):
            resumes = world.fleet.phase == STOP and not world.is_leaderless
            self._step(world, before, way, [Fault("stop")] if resumes else [])
            before = marks_of(world)
            if world.fleet.phase == OVER:
                break
        else:
            if world.fleet.has_gone:
                raise BrokenError("the fleet does not end any more")
            return
        while not world.fleet.is_finished:
            self._step(world, before, way)
        phases = [one.agent.phase for one in world.robots if not one.is_dead]
        if {MOVING, BRAKING, ARMED} & set(phases):
            raise BrokenError(f"the fleet has ended, and robots are in the phases {phases}")


def seconds_of(steps: int) -> float:
    """Return how long so many steps take [s]."""
    return steps * STEP / 1e9
