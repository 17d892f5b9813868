"""From a scenario to a proven plan: paths, zones, schedule, wire bytes, proof, in this order.

Decides: the order of the stages, and that no plan is returned without its proof.  Must not know:
files, clocks (a timer is an argument) or links.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from contextlib import suppress
from itertools import islice, pairwise

import numpy as np
from msgspec.structs import replace

from coordinator.base.errors import InputError, PartsError, PlanError
from coordinator.curves.chords import chords_of
from coordinator.curves.nurbs import Nurbs
from coordinator.ground.tight_places import near_places
from coordinator.motion.velocity_profile import Motion, limits_on
from coordinator.paths.path_planner import Pathfinder, find_paths
from coordinator.plan.checks import LONGEST_PLAN, LONGEST_TAU
from coordinator.plan.crossings import CrossingSearch
from coordinator.plan.document import Limits, PlanDocument, Reason
from coordinator.plan.drafting import can_be_sent, draft_plan
from coordinator.plan.shares_of_tau import BRAKING_SHARE, LEAST_TAU, resolve_tau, shares_of
from coordinator.plan.wire import PackedPlan
from coordinator.planning.flow import MOST_BOTH, Flow, find_flow, is_searched
from coordinator.proof.verify import prove_messages
from coordinator.scenario.model import Scenario
from coordinator.schedule import paper_policy
from coordinator.schedule.detours import blocking_pairs, lanes, refuges
from coordinator.schedule.junctions import FEW, Junctions
from coordinator.schedule.neighbourhood_search import Improvement
from coordinator.schedule.precedence import ring_of, stuck_pairs
from coordinator.schedule.priority_order import Deadlock, find_schedule
from coordinator.schedule.refusals import BlockedError, pair_error, ring_error
from coordinator.schedule.rerouting import latest_robots, quicker_by, with_reasons
from coordinator.schedule.staircase_making import with_staircases
from coordinator.schedule.timetable import Motions
from coordinator.schedule.track import Track
from coordinator.schedule.wait_owners import with_owners
from coordinator.schedule.wait_reasons import explain_waits, unkept_priorities

DEFAULT_EFFORT = 20
LATER_EFFORT = 4
"""The greatest effort for epochs after the first.  It is too small for detours (_EFFORT_PER_WAY).
The whole fleet stands while such a plan is made: a longer search would cost about as much time as
it gains."""

NEED_PAD = 0.0005
TAU_PAD = 0.002
"""The schedule adds NEED_PAD [m] to every need and TAU_PAD [s] to tau, to allow for rounding to
the wire.  Where robots stand too near each other for that, less is added
(ground/tight_places.py)."""

_SLOW = 1.6
"""Ways in space and time on which robots take so many times as long as alone are compared with
moves from place to place; so are crowded ones of up to _MOST_WAYS robots."""

_JAM = 1.2
"""Fleets of up to FEW robots that take so many times as long as alone look for such ways, too.
Where there are none, slow plans of up to _MOST_WAYS robots are compared with such moves."""

_AT_ONCE = 1.05
_MOST_AT_ONCE = 100
"""Fleets of up to _MOST_AT_ONCE robots that start and stop at once, and so lose nothing at a rest,
compare plans that take so many times as long as alone with such moves."""

_PATIENCE = 60
_PATIENCE_PER_FLEET = 3000
_PER_DEADLOCK = 25
"""After _PATIENCE searches for detours, or _PATIENCE_PER_FLEET divided by the number of robots if
that is less, robots are made to make room for each other, if that is possible.  A search for orders
that finds none counts as _PER_DEADLOCK searches."""

_MOST_SEARCHES = 120
_MOST_SEARCHES_PER_FLEET = 24_000
"""If robots cannot make room, the search for detours goes on for so many searches, and so many
divided by the number of robots: the more there are, the longer each search takes."""

_MOST_AGAIN = 5_000_000
"""The effort for improving the first schedule of robots that make room, about 2 s."""

_MOST_WITH_ROOM = 300
"""Larger fleets that have motions look for no better ones by making room for each other: the search
over places takes longer than all else (26 s for 1,000 robots on an open floor), and finds none."""

_EFFORT_PER_WAY = 5
_WAYS = 2
_MOST_BESIDE_TO_SAVE = 1000
_MOST_WAYS = 60
"""Limits on detours that save waiting: one robot is tried per _EFFORT_PER_WAY of effort, with up to
_WAYS detours, each around at most _MOST_BESIDE_TO_SAVE places.  Fleets of more than _MOST_WAYS
robots get none, because finding their conflicts again takes long."""

Timer = Callable[[], float]


def plan_scenario(
    scenario: Scenario,
    *,
    effort: int = DEFAULT_EFFORT,
    epoch: int = 1,
    timer: Timer = lambda: 0.0,
    executor: Executor | None = None,
) -> PlanDocument:
    """Call `plan_fleet` with the same arguments and return the plan's document."""
    plan = plan_fleet(scenario, effort=effort, epoch=epoch, timer=timer, executor=executor)
    return plan.document


def plan_fleet(
    scenario: Scenario,
    *,
    effort: int = DEFAULT_EFFORT,
    epoch: int = 1,
    timer: Timer = lambda: 0.0,
    executor: Executor | None = None,
) -> PackedPlan:
    """Find a plan for a scenario and return it with its messages, on which it is proven.

    Epochs after 1 get LATER_EFFORT at most.  For large fleets the executor (threads, processes or
    a cluster) does paths, zones, staircases and their proof in parts; the plan does not depend on
    it.  The document's `timing` [s] is measured with the timer; without a timer it is 0.

    Policy "safe": raises InputError for a tau below LEAST_TAU, and PlanError when no plan is found;
    a plan that is returned has passed its proof.  Policy "paper": the proof may fail; the document
    then says so and must not be driven.
    """
    limits = [Limits.of(robot) for robot in scenario.robots]
    if scenario.policy == "safe" and not isinstance(scenario.tau, str) and scenario.tau < LEAST_TAU:
        problem = f"{scenario.name}: tau: {scenario.tau:g} s is less than {LEAST_TAU} s"
        raise InputError([f"{problem}, the least with which robots never wait in a ring"])
    tau = resolve_tau(scenario.tau, shares_of(limits, scenario.link))
    stages = _Stages(scenario, tau, executor)
    effort = effort if epoch == 1 else min(effort, LATER_EFFORT)
    marks = [timer()]
    stages.find_paths()
    marks.append(timer())
    stages.find_zones(effort)
    marks.append(timer())
    motions = stages.schedule(effort)
    _check_times(scenario, tau, motions)
    marks.append(timer())
    drafted = draft_plan(
        scenario,
        stages.paths,
        motions,
        tau,
        epoch,
        stages.say(),
        stages.crossings(),
        stages.shortest,
    )
    waits = [] if scenario.policy == "paper" else stages.explain(motions)
    marks.append(timer())
    notes = [*unkept_priorities(scenario.robots, waits), *drafted.document.notes]
    document = replace(drafted.document, waits=waits, notes=notes)
    plan = PackedPlan(document, drafted.messages)
    try:
        plan = plan if scenario.policy == "paper" else with_staircases(plan, executor)
        proof = prove_messages(plan, scenario, executor)
    except PartsError as error:
        reason = "a path cannot be sent: " + "; ".join(error.problems)
        (robot,) = (one for one in scenario.robots if one.id == error.robots[-1])
        helps = "fewer via points" if robot.via else ""
        helps = "weights that differ less, or another path" if robot.path else helps
        raise PlanError(reason, blames=robot.id, helps=helps) from None
    marks.append(timer())
    names = ("paths", "zones", "schedule", "document", "proof")
    timing = {n: round(b - a, 4) for n, (a, b) in zip(names, pairwise(marks), strict=True)}
    if scenario.policy == "safe" and not proof.holds:
        raise PlanError("the plan found does not pass its proof: " + "; ".join(proof.failures))
    document = replace(document, proof=proof, timing=timing)
    return PackedPlan(document, plan.messages, plan.staircases)


def _check_times(scenario: Scenario, tau: float, motions: Sequence[Motion]) -> None:
    """Raise PlanError naming the robot that makes a plan too long to send or to prove."""
    if tau > LONGEST_TAU:
        slowest = max(scenario.robots, key=lambda robot: robot.max_speed / robot.max_accel)
        raise PlanError(
            f"{slowest.id} brakes for {slowest.max_speed / slowest.max_accel:.0f} s, so tau is "
            f"{tau:.0f} s, at most {LONGEST_TAU:.0f} s are possible",
            blames=slowest.id,
            helps="a larger max_accel or a tau by hand",
        )
    for robot, motion in zip(scenario.robots, motions, strict=True):
        if motion.finish > LONGEST_PLAN:
            raise PlanError(
                f"{robot.id} arrives after {motion.finish:.0f} s, a plan lasts at most "
                f"{LONGEST_PLAN:.0f} s",
                blames=robot.id,
                helps="more speed or a nearer goal",
            )


def _arrivals(motions: Sequence[Motion]) -> float:
    """Return the sum of arrivals [s]."""
    return sum(motion.finish for motion in motions)


def _is_jam(motions: Sequence[Motion], tracks: Sequence[Track]) -> bool:
    """Return whether robots lose so much time that other kinds of plans are looked for."""
    most = _JAM if len(tracks) <= _MOST_WAYS else _SLOW
    return _arrivals(motions) > most * sum(track.alone for track in tracks)


class _Stages:
    """The stages of one planning run, and the data that each stage leaves for the next."""

    def __init__(self, scenario: Scenario, tau: float, executor: Executor | None) -> None:
        self.scenario = scenario
        self.executor = executor
        self.tau = tau
        self.pathfinder = Pathfinder(scenario)
        self.near = near_places(scenario, NEED_PAD)
        self.paths: list[Nurbs] = []
        self.shortest: list[Nurbs] = []
        self.tracks: list[Track] = []
        self.notes: list[str] = []
        self._junctions: Junctions | None = None
        self._crossings: CrossingSearch | None = None
        self._searched = 0
        self._cannot_make_room = False

    def find_paths(self) -> None:
        """Find every robot's path as if it were alone on the floor."""
        self.paths = find_paths(self.pathfinder, self.executor)
        self.shortest = list(self.paths)

    def find_zones(self, effort: int) -> None:
        """Find where the robots conflict on these paths, unless they will hardly drive on them."""
        self.tracks = [self._track(index, path) for index, path in enumerate(self.paths)]
        count = len(self.tracks)
        if count <= MOST_BOTH or self.scenario.policy == "paper" or not is_searched(count, effort):
            self._crossings = self._look_for_crossings()

    @property
    def junctions(self) -> Junctions:
        """The tracks with the zones between them, which are found when they are asked for."""
        if self._junctions is None:
            self._junctions = self._meet(self.tracks)
        return self._junctions

    @junctions.setter
    def junctions(self, junctions: Junctions) -> None:
        self._junctions = junctions

    def schedule(self, effort: int) -> list[Motion]:
        """Return the robots' motions; raises PlanError when none are found."""
        scenario = self.scenario
        if scenario.policy == "paper":
            limits = [track.limits for track in self.tracks]
            return paper_policy.schedule(scenario, self.paths, limits, self.tau)
        priorities = [robot.priority for robot in scenario.robots]
        finder, tracks, motions = self.pathfinder, list(self.tracks), None
        refusal: PlanError | None = None
        if len(priorities) <= MOST_BOTH:
            try:
                motions = self._in_order(priorities, effort)
            except PlanError as error:
                refusal = error
            if motions is not None and len(motions) <= FEW and not _is_jam(motions, tracks):
                return motions
        flow = find_flow(finder, tracks, self.shortest, self._track, self._meet, self.tau, effort)
        if flow is None:
            if refusal is not None:
                raise refusal
            motions = self._in_order(priorities, effort) if motions is None else motions
            is_large = len(motions) > _MOST_WITH_ROOM
            is_slow = _is_jam(motions, tracks) or self._rests_would_help(motions)
            if effort <= LATER_EFFORT or is_large or not is_slow:
                return motions
            return self._or_with_room(motions, priorities)
        if motions is not None and not flow.is_better_than(motions):
            return motions
        is_slow = _arrivals(flow.motions) > _SLOW * sum(track.alone for track in self.tracks)
        is_slow |= effort > LATER_EFFORT and self._rests_would_help(flow.motions)
        if is_slow or (flow.is_crowded and len(tracks) <= _MOST_WAYS):
            rests = self._several_legs(priorities)
            if rests is not None and not flow.is_better_than(rests):
                return rests
        return self._on(flow, priorities, effort)

    def _rests_would_help(self, motions: Sequence[Motion]) -> bool:
        """Return whether robots that lose nothing at rests take longer than alone."""
        robots = self.scenario.robots
        if len(robots) > _MOST_AT_ONCE or any(math.isfinite(one.max_accel) for one in robots):
            return False
        return _arrivals(motions) > _AT_ONCE * sum(track.alone for track in self.tracks)

    def _on(self, flow: Flow, priorities: list[int], effort: int) -> list[Motion]:
        """Return motions on a flow's paths; few robots may drive there as fast as they can."""
        self.paths, self.tracks, self.junctions = flow.paths, flow.tracks, flow.junctions
        if len(flow.motions) <= FEW:
            again = find_schedule(self.junctions, priorities, effort)
            if not isinstance(again, Deadlock) and _arrivals(again) < _arrivals(flow.motions):
                flow = dataclasses.replace(flow, motions=with_owners(self.junctions, again))
        self.notes = [flow.told()]
        return flow.motions

    def _or_with_room(self, motions: list[Motion], priorities: list[int]) -> list[Motion]:
        """Return motions in which robots make room for each other if they arrive earlier so."""
        before = self.paths, self.tracks, self.junctions, self.notes
        rests = self._several_legs(priorities)
        if rests is not None and _arrivals(rests) < _arrivals(motions):
            return rests
        self.paths, self.tracks, self.junctions, self.notes = before
        return motions

    def _in_order(self, priorities: list[int], effort: int) -> list[Motion]:
        """Return motions on the paths that look at nobody; reroute robots until some order works.

        Raises PlanError when no detour helps.
        """
        rerouted: set[tuple[int, int]] = set()
        count = max(len(priorities), 1)
        patience = min(_PATIENCE, _PATIENCE_PER_FLEET // count)
        most = _MOST_SEARCHES + _MOST_SEARCHES_PER_FLEET // count
        while True:
            pairs = stuck_pairs(self.junctions)
            if not pairs:
                result = find_schedule(self.junctions, priorities, effort)
                if not isinstance(result, Deadlock):
                    improved = self._improved(result, priorities, effort)
                    return with_owners(self.junctions, improved)
                self._searched += _PER_DEADLOCK
                pairs = blocking_pairs(self.junctions, result)
            solved = False
            for pair in pairs:
                motions = self._several_legs(priorities) if self._searched > patience else None
                if motions is not None:
                    return motions
                if self._searched > most:
                    break
                solved |= self._reroute(pair, rerouted)
            if not solved:
                motions = self._several_legs(priorities)
                if motions is not None:
                    return motions
                from coordinator.planning.several_legs import keeping_robots

                robots = self.scenario.robots
                kept = [robots[index].id for index in keeping_robots(self.scenario)]
                raise self._refusal(pairs).kept_by(kept)

    def _refusal(self, pairs: list[tuple[int, int]]) -> BlockedError:
        """Return the error for a fleet in which these pairs block each other."""
        ring = ring_of(self.junctions)
        if len(ring) > 2 and self._block_each_other(ring):
            return ring_error(self.scenario, self.junctions, ring)
        for pair in pairs:
            if self._block_each_other(pair):
                return pair_error(self.scenario, self.junctions, pair)
        return pair_error(self.scenario, self.junctions, pairs[0], among_others=True)

    def _several_legs(self, priorities: list[int]) -> list[Motion] | None:
        """Return motions in which robots make room for each other; None if none are found."""
        # The search over places is seldom needed, and importing it takes as long as a small plan.
        from coordinator.planning.several_legs import find_legs, first_motions

        if self._cannot_make_room or all(robot.is_idle for robot in self.scenario.robots):
            return None
        self._cannot_make_room = True
        tau, best = self.tau + TAU_PAD, math.inf
        for legs, is_clear in find_legs(self.scenario, self.pathfinder, tau):
            paths = [one.path for one in legs]
            tracks = [self._track(index, path) for index, path in enumerate(paths)]
            junctions = self._meet(tracks)
            first = first_motions(legs, tracks, tau)
            table = Motions(junctions.lengths(), first)
            order = sorted(range(len(first)), key=lambda index: first[index].finish)
            Improvement(junctions, table, order, priorities).plan_all_again(_MOST_AGAIN)
            motions = table.all()
            is_sent = can_be_sent(self.scenario, paths, motions, self.tau)
            if is_sent and _arrivals(motions) < best:
                best, found = _arrivals(motions), motions
                self.paths, self.tracks, self.junctions = paths, tracks, junctions
            if is_sent and is_clear:
                break
        if best == math.inf:
            return None
        self.notes = ["robots make room for each other: they rest on their ways and go on"]
        return with_owners(self.junctions, found, all_waits=True)

    def _improved(self, motions: list[Motion], priorities: list[int], effort: int) -> list[Motion]:
        """Give robots detours where these are quicker; then schedule a small fleet once more."""
        before = self.junctions
        count = len(motions)
        if count <= _MOST_WAYS:
            motions = self._go_around(motions, effort // _EFFORT_PER_WAY)
        if self.junctions is before:
            return motions
        motions = with_reasons(self.junctions, motions)
        if count > FEW:
            return motions
        again = find_schedule(self.junctions, priorities, effort)
        if isinstance(again, Deadlock) or _arrivals(again) > _arrivals(motions):
            return motions
        return again

    def _go_around(self, motions: list[Motion], tries: int) -> list[Motion]:
        """Give the robots that wait longest a detour where it is quicker; try `tries` robots."""
        for mover, other in latest_robots(self.junctions, motions)[:tries]:
            beside = lanes(self.scenario, mover, other, self.paths[other], _MOST_BESIDE_TO_SAVE)
            for discs in islice(beside, _WAYS):
                with suppress(PlanError):
                    path = self.pathfinder.path(mover, discs)
                    track = self._track(mover, path)
                    better = quicker_by(self.junctions, motions, mover, track)
                    if better is None:
                        continue
                    saved = motions[mover].finish - better[1][mover].finish
                    self.junctions, motions = better
                    self.paths[mover], self.tracks[mover] = path, track
                    names = [self.scenario.robots[index].id for index in (mover, other)]
                    self.notes.append(
                        f"{names[0]} goes around {names[1]}'s path: {saved:.1f} s earlier than "
                        "by waiting"
                    )
                    break
        return motions

    def crossings(self) -> CrossingSearch:
        """Return where the paths cross; search again if a path has changed since."""
        if self._crossings is None or self._crossings.curves != tuple(self.paths):
            self._crossings = self._look_for_crossings()
        return self._crossings

    def _look_for_crossings(self) -> CrossingSearch:
        """Start the search for crossings of robots that share a zone; it runs during scheduling."""
        zones = self.junctions.zones
        pairs = np.unique(np.column_stack((zones.a, zones.b)), axis=0)
        return CrossingSearch(self.paths, pairs, self.executor)

    def explain(self, motions: Sequence[Motion]) -> list[Reason]:
        """Return why the robots wait."""
        return explain_waits(self.junctions, motions, [r.id for r in self.scenario.robots])

    def say(self) -> list[str]:
        """Return what the plan's reader should know: maps, reroutes, places that paths cross."""
        crossed = [
            sentence
            for index, path in enumerate(self.paths)
            for sentence in self.pathfinder.crossed_places(index, path)
        ]
        return [*self.scenario.workspace.notes, *self.notes, *crossed]

    def _reroute(self, pair: tuple[int, int], rerouted: set[tuple[int, int]]) -> bool:
        """Give one robot of a pair a path that lets both pass; return whether one was found."""
        for mover, other in (pair, pair[::-1]):
            if (mover, other) in rerouted:
                continue
            rerouted.add((mover, other))
            for path, how in self._other_ways(mover, other):
                if self._pass_each_other(mover, other, path):
                    self._take(mover, path)
                    names = [self.scenario.robots[index].id for index in (mover, other)]
                    self.notes.append(f"{names[0]} {how} {names[1]}'s path to let it pass")
                    return True
        return False

    def _other_ways(self, mover: int, other: int) -> Iterator[tuple[Nurbs, str]]:
        """Yield paths that leave room for the other robot: beside its path, then by a refuge."""
        theirs, finder = self.paths[other], self.pathfinder
        for discs in lanes(self.scenario, mover, other, theirs):
            with suppress(PlanError):
                if len(discs):
                    self._searched += 1
                    yield finder.path(mover, discs), "keeps beside"
        for refuge in refuges(self.scenario, finder.floor, mover, other, theirs):
            with suppress(PlanError):
                self._searched += 1
                yield finder.path(mover, refuge=refuge), "steps aside from"

    def _pass_each_other(self, mover: int, other: int, path: Nurbs) -> bool:
        pair = self._meet([self._track(mover, path), self.tracks[other]], (mover, other))
        return not isinstance(find_schedule(pair, (0, 0), effort=0), Deadlock)

    def _block_each_other(self, indices: Sequence[int]) -> bool:
        """Return whether these robots have no order that works even without the other robots."""
        alone = self._meet([self.tracks[index] for index in indices], tuple(indices))
        return isinstance(find_schedule(alone, [0] * len(indices), effort=0), Deadlock)

    def _take(self, index: int, path: Nurbs) -> None:
        self.paths[index], self.tracks[index] = path, self._track(index, path)
        self.junctions = self.junctions.with_track(index, self.tracks[index])

    def _track(self, index: int, path: Nurbs) -> Track:
        robot = self.scenario.robots[index]
        speed = self.scenario.planned_speed(robot)
        share = 1.0 if self.scenario.policy == "paper" else BRAKING_SHARE
        limits = limits_on(
            path, speed, share * robot.max_accel, robot.max_lateral_accel, robot.max_turn_rate
        )
        return Track(limits, chords_of(path, self.near.errors[index]))

    def _meet(self, tracks: list[Track], indices: tuple[int, ...] | None = None) -> Junctions:
        robots = self.scenario.robots
        chosen = range(len(robots)) if indices is None else indices
        radii = [robots[i].radius - self.near.less[i] for i in chosen]
        margin = self.scenario.margin + NEED_PAD
        return Junctions(tracks, radii, margin, self.tau + TAU_PAD, self.executor)
