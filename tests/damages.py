"""Plans damaged at random, and whether the proof and the dense sampler agree about them.

The proof has to refuse exactly what the sampler finds unsafe by more than 2 mm.  Between 2 mm and
what the proof accepts either answer is right: there it may be the stricter one.
"""

from __future__ import annotations

from dataclasses import dataclass
from random import Random

from msgspec.structs import replace

from coordinator.base.errors import InputError
from coordinator.plan.document import PlanDocument
from coordinator.plan.plan_file import to_json
from coordinator.plan.wire import drive
from coordinator.proof.verify import prove_document
from coordinator.scenario.margin import TOLERANCE
from tests.oracle_dense import closest
from tests.oracles import tracks

UNSAFE = -2e-3
SAFE = 5e-4 - TOLERANCE
"""Sampled slack [m] below which a plan has to be refused, above which it must not be.

The sampler's least is up to half a millimetre above the true one: it looks every 20 ms.
"""


@dataclass(frozen=True)
class Judged:
    """One plan: what was done to it, the sampled slack [m], and whether it was refused for it."""

    damage: str
    slack: float
    refused: bool

    @property
    def agreed(self) -> bool:
        return self.refused if self.slack < UNSAFE else not self.refused or self.slack < SAFE

    @property
    def between(self) -> bool:
        return UNSAFE <= self.slack < SAFE


def judge(document: PlanDocument, damage: str = "none") -> Judged:
    """Ask both about one document."""
    sampled = closest(tracks(to_json(document)), document.tau, document.margin)
    failures = prove_document(document).failures
    return Judged(damage, sampled.slack, any("apart near" in failure for failure in failures))


def damaged(document: PlanDocument, seed: int) -> tuple[PlanDocument, str] | None:
    """A document with one thing changed, and what it was; None where there is nothing to change."""
    dice = Random(f"damage-{seed}")
    kind = dice.choice(("stop removed", "stop shortened", "starts earlier", "radius", "profile"))
    robots = list(document.robots)
    ready = [
        index
        for index, robot in enumerate(robots)
        if robot.stops or not kind.startswith("stop")
        if robot.start_time > 0.0 or kind != "starts earlier"
    ]
    if not ready:
        return None
    index = dice.choice(ready)
    robots[index] = _DAMAGES[kind](robots[index], dice)
    try:
        return _agreeing(replace(document, robots=robots)), kind
    except InputError:
        return None


def _without_a_stop(robot, dice):
    stops = list(robot.stops)
    stops.pop(dice.randrange(len(stops)))
    return replace(robot, stops=stops)


def _with_a_shorter_stop(robot, dice):
    stops = list(robot.stops)
    k = dice.randrange(len(stops))
    stop = stops[k]
    depart = stop.arrive + dice.random() * (stop.depart - stop.arrive)
    stops[k] = replace(stop, depart=depart)
    return replace(robot, stops=stops)


def _starting_earlier(robot, dice):
    return replace(robot, start_time=robot.start_time * dice.random())


def _wider(robot, dice):
    return replace(robot, radius=robot.radius + 10.0 ** dice.uniform(-4.0, -0.7))


def _faster_or_slower(robot, dice):
    factor = dice.uniform(0.8, 1.2)
    return replace(robot, profile=[(s, v * factor) for s, v in robot.profile])


_DAMAGES = {
    "stop removed": _without_a_stop,
    "stop shortened": _with_a_shorter_stop,
    "starts earlier": _starting_earlier,
    "radius": _wider,
    "profile": _faster_or_slower,
}


def _agreeing(document: PlanDocument) -> PlanDocument:
    """The document with the times and speeds that its wire bytes give."""
    robots = []
    for robot, driven in zip(document.robots, drive(document), strict=True):
        line = driven.timeline
        arrivals = line.arrivals[1:] if robot.start_time > 0.0 else line.arrivals
        stops = [
            replace(stop, arrive=arrive, depart=max(stop.depart, arrive))
            for stop, arrive in zip(robot.stops, arrivals, strict=True)
        ]
        robots.append(replace(robot, finish_time=line.finish, stops=stops))
    return replace(document, robots=robots)
