"""Cores with one mistake each, that the explorer has to find.

Each takes a pytest.MonkeyPatch and patches one real function.  `BROKEN` says which faults are
needed to find the mistake, and what is found.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import numpy as np
import pytest

from coordinator.fleet.core import Fleet
from coordinator.fleet.grants import Grants
from coordinator.fleet.log_records import course_key
from coordinator.mission.mission_driver import MissionDriver
from coordinator.schedule.authority import Authority
from protocol.phases import GO
from protocol.timing import LATE_STEP_MS
from robot_agent.core.agent import Agent
from robot_agent.core.clock_sync import ClockSync
from robot_agent.core.leader import Leader
from robot_agent.core.ride import Ride

Patch = Callable[[pytest.MonkeyPatch], None]


def authority_goes_one_step_too_far(patch: pytest.MonkeyPatch) -> None:
    """A robot that another one holds is granted a reporting step more than the rule allows."""
    grant = Authority.grant

    def too_much(rule: Authority, now_ms: int, headroom_ms: int, most_ms: int) -> None:
        grant(rule, now_ms, headroom_ms, most_ms)
        wanted = np.minimum(rule.wanted(now_ms, headroom_ms), most_ms)
        rule.granted[:] = np.maximum(rule.granted, np.minimum(wanted, rule.granted + LATE_STEP_MS))
        np.maximum(rule.told, rule.granted, out=rule.told)

    patch.setattr(Authority, "grant", too_much)


def authority_is_told_before_it_is_logged(patch: pytest.MonkeyPatch) -> None:
    """Robots are told to drive beyond the plan time up to which the log says so."""
    patch.setattr(MissionDriver, "_state_ahead", _ahead_unsaid)


def _ahead_unsaid(driver: MissionDriver, _now_ns: int) -> None:
    driver.fleet.allowed_ms = driver.fleet.needed_ms


def messages_are_logged_after_they_are_sent(patch: pytest.MonkeyPatch) -> None:
    """What is said goes to the robots first, and then to the log."""
    say = MissionDriver._say

    def hasty(driver: MissionDriver, messages: Any, now_ns: int, **options: bool) -> None:
        for message in messages:
            driver._send(message.key, message.payload)
        say(driver, messages, now_ns, **options)

    patch.setattr(MissionDriver, "_say", hasty)


def a_course_is_sent_before_it_is_logged(patch: pytest.MonkeyPatch) -> None:
    """What a search found is put into effect without a word of it in the log."""
    record = MissionDriver._record

    def forgetful(driver: MissionDriver, key: str, *rest: Any) -> None:
        if key != course_key(driver.fleet.name):
            record(driver, key, *rest)

    patch.setattr(MissionDriver, "_record", forgetful)


def an_older_revision_is_taken(patch: pytest.MonkeyPatch) -> None:
    """A robot that hears an older course again takes it in place of the newer one."""
    hear = Agent.hear_plan

    def forgetful(agent: Agent, boot: int, epoch: int, *plan: Any) -> None:
        if agent.ride is not None and plan[1] < agent.revision and agent.epoch == epoch:
            agent.revision = agent.holds = plan[1]
        hear(agent, boot, epoch, *plan)

    patch.setattr(Agent, "hear_plan", forgetful)


def an_old_command_is_obeyed(patch: pytest.MonkeyPatch) -> None:
    """A robot obeys a Command of its coordinator whatever its sequence."""
    counts = Leader.counts

    def obedient(leader: Leader, term: int, boot: int, sequence: int, *rest: Any) -> bool:
        is_own = (term, boot) == (leader.term, leader.boot)
        return is_own or counts(leader, term, boot, sequence, *rest)

    patch.setattr(Leader, "counts", obedient)


def a_course_is_granted_before_it_is_confirmed(patch: pytest.MonkeyPatch) -> None:
    """A redirected robot is granted its new course as if it had said that it drives it."""
    patch.setattr(Grants, "_run_along", lambda grants, _, coming: grants._rule.part(coming.slot))


def a_foreign_coordinator_tells_the_time(patch: pytest.MonkeyPatch) -> None:
    """A robot believes an answer about the time from whoever answers first."""
    hear = Agent.hear_clock
    patch.setattr(
        Agent, "hear_clock", lambda agent, _, *stamps: hear(agent, agent._leader.boot, *stamps)
    )


def the_progress_of_a_mute_robot_grows_with_time(patch: pytest.MonkeyPatch) -> None:
    """The coordinator takes robots that are on time to go on, whether it hears of them or not."""
    tick = Fleet.tick

    def hopeful(fleet: Fleet, now_ns: int) -> Any:
        if fleet.phase == GO:
            passed_ms = fleet.times.plan_ms(now_ns) - 1_000
            rule = fleet.grants._rule
            for slot in np.flatnonzero(fleet.grants._numbers >= 0).tolist():
                rule.know(slot, passed_ms)
        return tick(fleet, now_ns)

    patch.setattr(Fleet, "tick", hopeful)


def a_robot_brakes_too_late_for_its_authority(patch: pytest.MonkeyPatch) -> None:
    """A robot takes no heed of where its authority ends."""
    patch.setattr(Ride, "_within_authority", lambda _ride, room: room)


def a_successor_forgets_what_was_told(patch: pytest.MonkeyPatch) -> None:
    """A coordinator that takes over counts on no more than what robots have passed."""

    def forgetful(grants: Grants, _until_ms: int) -> None:
        known = grants._rule.progress
        grants._rule.told[:] = grants._rule.granted[:] = known

    patch.setattr(Grants, "lose_sight", forgetful)


def reports_claim_a_step_too_much(patch: pytest.MonkeyPatch) -> None:
    """A robot rounds its lateness down."""
    reckon = Ride.reckon

    def boastful(ride: Ride, now_ms: int) -> None:
        reckon(ride, now_ms)
        ride.late = max(ride.late - 2, 0)

    patch.setattr(Ride, "reckon", boastful)


def an_old_answer_tells_the_time(patch: pytest.MonkeyPatch) -> None:
    """A robot takes an answer about the time as one to its newest question."""
    add = ClockSync.add

    def careless(clock: ClockSync, _sent: int, *stamps: int) -> bool:
        return add(clock, clock._asked_ns, *stamps)

    patch.setattr(ClockSync, "add", careless)


BROKEN: Final[dict[Patch, tuple[int, tuple[str, ...], str]]] = {
    authority_goes_one_step_too_far: (0, (), "has yet to pass"),
    authority_is_told_before_it_is_logged: (0, (), "the log"),
    messages_are_logged_after_they_are_sent: (0, (), "is not in the log"),
    a_course_is_sent_before_it_is_logged: (1, ("order",), "is not in the log"),
    an_older_revision_is_taken: (2, ("order", "replay"), "went back"),
    an_old_command_is_obeyed: (1, ("delay",), "leader"),
    a_course_is_granted_before_it_is_confirmed: (1, ("order",), "has not confirmed"),
    a_foreign_coordinator_tells_the_time: (1, ("stranger",), "takes its clock for better"),
    an_old_answer_tells_the_time: (1, ("clock twice",), "takes its clock for better"),
    the_progress_of_a_mute_robot_grows_with_time: (1, ("hang", "die"), "is not as far"),
    a_robot_brakes_too_late_for_its_authority: (1, ("die",), "has passed its authority"),
    a_successor_forgets_what_was_told: (1, ("take over",), "more than the coordinator knows"),
    reports_claim_a_step_too_much: (1, ("hang", "stop"), "is not as far"),
}
"""Each mistake: how many faults of which kinds show it, and what is said of it."""
