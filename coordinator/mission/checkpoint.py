"""The state of a whole mission as bytes, so that it can go on without the log before them.

Searches that are under way are given up with a checkpoint and begin again after it, in the
coordinator that writes it as in one that reads it.  Incidents, which are news for people, are left
out.

Decides: what belongs to the state.  Must not know: files, when a checkpoint is written
(mission_driver.py).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import msgspec
import numpy as np
from msgspec.structs import replace

from coordinator.base.errors import InputError
from coordinator.fleet.core import Fleet
from coordinator.fleet.state import PlainFleet
from coordinator.mission.dispatch import PlainDispatcher
from coordinator.mission.mission import Mission, book_of
from coordinator.mission.recovery import Planner
from coordinator.mission.replanning_input import Aside, Site, Why
from coordinator.plan.course import Course, PlainCourse
from coordinator.plan.document import PlanDocument
from coordinator.scenario import plain
from coordinator.scenario.model import Scenario

VERSION: Final = 1
"""Other versions are not read: what a state is changes with the code."""


class _Aside(msgspec.Struct, frozen=True):
    robot: dict[str, Any]
    why: Why
    places: bytes
    pose: tuple[float, ...] | None


class Checkpoint(msgspec.Struct, frozen=True):
    """A mission's state as plain data; `epoch` is that of its newest plan.

    `drives`: whether the plan is in force, not given up.  `rides`: the courses that places of rest
    may refer to, each with the epoch in which it was driven.
    """

    version: int
    epoch: int
    drives: bool
    fleet: PlainFleet
    robots: list[dict[str, Any]]
    aside: list[_Aside]
    rides: list[tuple[int, PlainCourse]]
    dispatcher: PlainDispatcher


_decode: Final = msgspec.msgpack.Decoder(Checkpoint)


def checkpoint_of(mission: Mission) -> bytes:
    """Give up a mission's searches for courses, and return its state."""
    site, dispatcher = mission.site, mission.dispatcher.plain()
    state = Checkpoint(
        VERSION,
        mission.document.epoch,
        mission.dispatcher.obstructions.has_site,
        mission.fleet.plain(),
        [plain.plain(robot) for robot in site.scenario.robots],
        [
            _Aside(plain.plain(one.robot), one.why, one.places.tobytes(), one.pose)
            for one in site.aside
        ],
        [
            (epoch, PlainCourse.of(Course(ride, 0.0)))
            for (_, epoch, _), ride in mission.rides.items()
        ],
        dispatcher,
    )
    return msgspec.msgpack.encode(state)


def mission_of(
    payload: bytes, scenario: Scenario, plans: Mapping[int, PlanDocument], planner: Planner
) -> Mission:
    """Return the mission whose state a checkpoint holds.

    `scenario` is that of the log, `plans` are its plans by epoch; `planner` plans later epochs.
    Raises InputError if the checkpoint cannot be read.
    """
    try:
        state = _decode.decode(payload)
        if state.version != VERSION:
            raise ValueError(f"its version is {state.version}, this is {VERSION}")
        mission = _restored(state, scenario, plans[state.epoch], planner)
        mission.documents = {n: plan for n, plan in plans.items() if n <= state.epoch}
        return mission
    except KeyError as error:
        raise InputError([f"checkpoint: the log lacks {error}, which it needs"]) from None
    except (msgspec.MsgspecError, UnicodeDecodeError, TypeError, ValueError) as error:
        raise InputError([f"checkpoint: cannot be read: {error}"]) from None


def _restored(
    state: Checkpoint, scenario: Scenario, document: PlanDocument, planner: Planner
) -> Mission:
    robots = tuple(plain.robot_of(fields) for fields in state.robots)
    aside = [
        Aside(
            plain.robot_of(one.robot),
            one.why,
            np.frombuffer(one.places).reshape(-1, 2).copy(),
            None if one.pose is None else plain.pose_of(one.pose),
        )
        for one in state.aside
    ]
    rides = {}
    for epoch, told in state.rides:
        ride = told.course().driven
        rides[ride.id, epoch, ride.plan.revision] = ride
    mission = Mission(
        Site(replace(scenario, robots=robots), tuple(aside)),
        Fleet.of_plain(state.fleet, book_of(scenario, stays=False)),
        document,
        rides,
        planner,
    )
    mission.begin(document if state.drives else None)
    mission.dispatcher.take_plain(state.dispatcher)
    return mission
