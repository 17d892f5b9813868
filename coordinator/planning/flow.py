"""Paths and motions that are found together, and made to agree on exact conflict zones.

Decides: for which fleets ways in space and time are searched and how long, who gets another way if
two motions turn out to meet, and whether the result is worth its bends.  Must not know: how ways
are searched (coordinator/bends), wire bytes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

from coordinator.curves.nurbs import Nurbs
from coordinator.motion.velocity_profile import Motion
from coordinator.paths.path_planner import Pathfinder
from coordinator.schedule.given_motions import meeting, place_again
from coordinator.schedule.junctions import Junctions
from coordinator.schedule.neighbourhood_search import Improvement
from coordinator.schedule.timetable import Motions
from coordinator.schedule.track import Track
from coordinator.schedule.wait_owners import with_owners

MOST_BOTH: Final = 24
"""Fleets of up to so many robots are planned on their shortest ways as well."""

_WORTH: Final = 0.5
_WORTH_SHARE: Final = 0.005
"""Ways in space and time have to lower the sum of arrivals by _WORTH [s], and by this share."""

_LAST: Final = 0.5
"""How much the last arrival counts beside the mean one, for fleets of up to MOST_BOTH robots."""

_LEAST_EFFORT: Final = 5
_ROBOTS: Final = 15
_ROUNDS: Final = 0.5
_PLACED: Final = 10
"""The least effort; how many robots, and how many rounds of improvement, per unit of effort.  The
time of the search grows faster than the number of robots.  Large fleets get fewer rounds, _PLACED
per unit of effort divided by their robots: a round is long and gains little there."""

_REPAIRS: Final = 3
"""How often robots get other ways because they meet others on exact zones."""


@dataclass(frozen=True, eq=False)
class Flow:
    """Paths and motions of a fleet, with the tracks and zones of these paths.

    aside: how many of the paths are not the shortest ones.  is_crowded: whether robots had to be
    placed anew for one that found no motion among them.
    """

    paths: list[Nurbs]
    tracks: list[Track]
    junctions: Junctions
    motions: list[Motion]
    aside: int
    is_crowded: bool

    def is_better_than(self, motions: Sequence[Motion]) -> bool:
        """Return whether the paths are worth their bends, compared with other motions."""
        was, now = cost_of(motions), cost_of(self.motions)
        return now < was - max(_WORTH, _WORTH_SHARE * was)

    def told(self) -> str:
        """Return how many robots bend and slow down, in words."""
        slower = sum(
            motion.limits is not track.limits
            for motion, track in zip(self.motions, self.tracks, strict=True)
        )
        return (
            f"robots that leave their shortest ways so that others can pass: {self.aside}; "
            f"that drive more slowly than they could: {slower}"
        )


def cost_of(motions: Sequence[Motion]) -> float:
    """Return the sum of arrivals [s]; for few robots the last one's share counts as well."""
    arrivals = [motion.finish for motion in motions]
    share = _LAST if len(arrivals) <= MOST_BOTH else 0.0
    return (sum(arrivals) + share * len(arrivals) * max(arrivals)) / (1.0 + share)


def is_searched(count: int, effort: int) -> bool:
    """Return whether ways in space and time are searched for so many robots."""
    return effort >= _LEAST_EFFORT and 1 < count <= _ROBOTS * effort


def find_flow(
    finder: Pathfinder,
    shortest: Sequence[Track],
    paths: Sequence[Nurbs],
    track_of: Callable[[int, Nurbs], Track],
    meet: Callable[[list[Track]], Junctions],
    tau: float,
    effort: int,
) -> Flow | None:
    """Return ways in space and time for a fleet whose shortest paths and tracks are given.

    track_of: makes the track of a robot on a path; meet: finds the zones between tracks.  None if
    the fleet is too large for the effort, or if a robot finds no way.
    """
    # Small plans should not pay for the import of kernels that they do not need.
    from coordinator.bends.flow_search import FlowSearch

    if not is_searched(len(paths), effort):
        return None
    priorities = [robot.priority for robot in finder.scenario.robots]

    def are_apart(tracks: Sequence[Track]) -> Callable[[Sequence[Motion]], bool]:
        zones = meet(list(tracks))
        return lambda motions: not meeting(zones, Motions(zones.lengths(), motions), priorities)

    extra = (_LAST, are_apart) if len(paths) <= MOST_BOTH else ()
    search = FlowSearch(finder, paths, shortest, track_of, tau, *extra)
    rounds = min(int(_ROUNDS * effort), _PLACED * effort // len(paths))
    courses = search.run(rounds if len(set(priorities)) == 1 else 0)
    if courses is None:
        return None
    junctions, firm = meet([one.track for one in courses]), list(priorities)
    for repairs in range(_REPAIRS + 1):
        motions = Motions(junctions.lengths(), [one.motion for one in courses])
        met = meeting(junctions, motions, firm)
        if not met or repairs == _REPAIRS:
            break
        before, courses = courses, search.place_again(met)
        for index in met:
            if courses[index] is before[index]:
                firm[index] += 1  # It has no other course: next time the other one looks for one.
            else:
                junctions = junctions.with_track(index, courses[index].track)
    if not place_again(junctions, motions, met, priorities):
        return None
    owned = _without_needless_rests(junctions, motions, priorities)
    return Flow(
        [one.path for one in courses],
        [one.track for one in courses],
        junctions,
        owned,
        sum(one.path is not path for one, path in zip(courses, paths, strict=True)),
        search.is_crowded,
    )


def _without_needless_rests(
    junctions: Junctions, motions: Motions, priorities: Sequence[int]
) -> list[Motion]:
    """Plan robots again that have a wait which no zone forces; return all motions with owners."""
    found = motions.all()
    order = sorted(range(len(found)), key=lambda one: (-priorities[one], found[one].finish))
    owned = with_owners(junctions, found, all_waits=True)
    needless = [one for one in order if any(wait.owner < 0 for wait in owned[one].waits)]
    if not needless:
        return owned
    Improvement(junctions, motions, order, priorities).plan_again(needless)
    return with_owners(junctions, motions.all(), all_waits=True)
