"""How a mission is driven: the order in which it hears, looks at the time, plans, logs and sends.

Three shells run this code: on a real link and clock (service/coordinator_service.py), in virtual
time (sim/world/virtual_service.py), and over a log (service/replay.py).  A shell gives it a
`Journal` and a function that sends, and does the `Job`s that it returns.

Decides: what is logged before which message is sent, when a plan is requested and adopted, and what
is withheld while the log cannot be written.  Must not know: links, clocks, threads, files.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Final

from coordinator.fleet.core import Fleet
from coordinator.fleet.events import Incident, Outgoing
from coordinator.fleet.log_records import (
    NOT_RECORDED,
    TOLD_TO_GO_ON,
    TOLD_TO_STOP,
    CourseRequest,
    Found,
    Request,
    adoption_key,
    adoption_record,
    ahead_key,
    ahead_record,
    around_key,
    around_record,
    checkpoint_key,
    course_key,
    drops_key,
    drops_record,
    link_record,
    router_key,
    search_record,
    told_key,
)
from coordinator.mission.checkpoint import checkpoint_of
from coordinator.mission.intake import Arrival, Intake
from coordinator.mission.mission import Mission
from coordinator.mission.recovery import Recovery
from coordinator.mission.searches import found_of
from coordinator.plan.document import PlanDocument
from coordinator.planning.course_search import Answer
from protocol import keys
from protocol.codec import encode
from protocol.phases import FREEZE, GO, HOLD
from protocol.timing import MILLISECOND, SECOND

_TELL_DROPS: Final = SECOND
"""The least time between two records of how many messages were dropped."""

_ANSWER_TIME: Final = MILLISECOND
"""After an answer, requests for the plans stay unanswered for this long per plan in the answer."""


class Journal(ABC):
    """The log as a mission needs it."""

    @property
    def error(self) -> str | None:
        """Why nothing can be written any more; None if the log can be written."""
        return None

    @property
    def not_recorded(self) -> int:
        """How many messages were not recorded because there was no space for them."""
        return 0

    @abstractmethod
    def record(self, key: str, payload: bytes, now_ns: int, sent_ns: int | None = None) -> None:
        """Record a message that was heard or will be sent; `sent_ns` is the sender's time stamp."""

    @abstractmethod
    def keep(self, document: PlanDocument) -> None:
        """Attach a plan to the log."""

    @abstractmethod
    def sync(self) -> bool:
        """Wait until all records are on the disk; return False if they cannot be written."""

    @abstractmethod
    def hurry(self) -> None:
        """Ask for the records so far to be written to the file soon."""


CHECKPOINT_BYTES: Final = 512 * 2**10
_CHECKPOINT_SHARE: Final = 4
"""A checkpoint is recorded after so many bytes of other records, and after _CHECKPOINT_SHARE times
as many as the last checkpoint has: reading them again takes seconds, and checkpoints stay a small
part of the log."""

_SOON_MS: Final = 1_000
_AHEAD_MS: Final = 3_000
"""The log says up to which plan time robots may be told to drive: _AHEAD_MS more than they are told
then, and again _SOON_MS before they are told so much."""

Outcome = Callable[[int], None]
"""Puts what a job has found into effect, at a time [ns]."""


@dataclass(frozen=True, eq=False)
class Job:
    """Work that takes long and changes nothing, which a shell does in a thread beside the fleet.

    The shell passes the job and the outcome that `work` returned to `MissionDriver.finish`.
    """

    wanted: Request | CourseRequest
    work: Callable[[], Outcome]


class MissionDriver:
    """The driver of one mission, for a shell; all times are in ns on the coordinator's clock.

    `checkpoint_bytes`: after how many bytes of records the first checkpoint follows; None for no
    checkpoints but those of new epochs.
    """

    def __init__(
        self,
        mission: Mission,
        journal: Journal,
        send: Callable[[str, bytes], None],
        checkpoint_bytes: int | None = CHECKPOINT_BYTES,
    ) -> None:
        self.mission = mission
        self.is_withheld = False
        """True once a phase could not be logged: then nothing is sent any more."""

        self.under_way: dict[Request | CourseRequest, Job] = {}
        """The jobs whose outcomes are needed: at most one of them is a plan for an epoch."""

        members = self.fleet.members
        self.intake = Intake(self.fleet.name, self.fleet.boot, lambda robot: members[robot].boot)
        self._journal = journal
        self._send = send
        self._plans = self.fleet.plans()
        self._answers_from_ns = 0
        self._plans_key, self._orders_key, self._blocks_key = (
            kind(self.fleet.name, "") for kind in (keys.plan, keys.orders, keys.blocks)
        )
        self._order_states = {
            self._orders_key + state.id: encode(state) for state in self.fleet.orders.states()
        }
        self._logged_plans: dict[str, bytes] = {}
        """The plans that were said last, which the log has."""

        self._checkpoint_bytes = checkpoint_bytes
        self._recorded, self._due_after = 0, checkpoint_bytes or 0
        self._router_up: bool | None = None
        self._drops: dict[str, int] = {}
        self._drops_told_ns = 0
        self._phase = (0, -1)
        self._log_told = False

    @property
    def fleet(self) -> Fleet:
        """The fleet core."""
        return self.mission.fleet

    def hear(self, arrival: Arrival, now_ns: int) -> None:
        """Let the core hear a message that has passed the intake."""
        told = len(self.fleet.incidents)
        self._record(arrival.key, arrival.payload, now_ns, arrival.sent_ns)
        self._say(self.fleet.hear(arrival.key, arrival.payload, now_ns), now_ns)
        if len(self.fleet.incidents) > told:
            self._journal.hurry()  # A robot that has arrived reports it once more and then leaves.

    def hear_router(self, up: bool, now_ns: int) -> None:
        """Record whether the router between the coordinator and its robots can be reached."""
        if up != self._router_up:
            self._router_up = up
            key, news = router_key(self.fleet.name), link_record(up)
            self._record(key, news, now_ns)
            self._say(self.fleet.hear(key, news, now_ns), now_ns)

    def look(self, now_ns: int) -> list[Job]:
        """Let the core look at the time; return the jobs to start now.

        A new plan for an epoch replaces an earlier one, whose outcome is no longer needed.
        """
        if self._checkpoint_bytes is not None and self._recorded >= self._due_after:
            self.checkpoint(now_ns)
        self._state_ahead(now_ns)
        self._say(self.fleet.tick(now_ns), now_ns)
        self._look_at_log(now_ns)
        jobs = [self._job_of(request) for request in self.mission.dispatcher.look(now_ns)]
        self._record_given_up(now_ns)
        request = self.mission.request(now_ns)
        self._plans = self.fleet.plans()
        if request is not None:
            for old in [one for one in self.under_way if isinstance(one, Request)]:
                del self.under_way[old]
            jobs.append(Job(request, partial(self._solve, request)))
        self.under_way |= {job.wanted: job for job in jobs}
        return jobs

    def checkpoint(self, now_ns: int) -> None:
        """Record the mission's state, unless a plan for an epoch is being looked for.

        Searches for courses are given up, and begin again at the next look.
        """
        if any(isinstance(one, Request) for one in self.under_way):
            return
        self.under_way.clear()
        state = checkpoint_of(self.mission)
        self._record(checkpoint_key(self.fleet.name), state, now_ns)
        self._recorded = 0
        self._due_after = max(self._checkpoint_bytes or 0, _CHECKPOINT_SHARE * len(state))

    def tell(self, what: bytes, now_ns: int) -> None:
        """Stop the fleet (TOLD_TO_STOP), or let it go on (TOLD_TO_GO_ON)."""
        self._record(told_key(self.fleet.name), what, now_ns)
        turn = {TOLD_TO_STOP: self.fleet.stop, TOLD_TO_GO_ON: self.fleet.go_on}[what]
        self._say(turn(now_ns), now_ns)

    def finish(self, job: Job, outcome: Outcome, now_ns: int) -> None:
        """Put the outcome of a job into effect, unless it is no longer needed."""
        if self.under_way.get(job.wanted) is job:
            del self.under_way[job.wanted]
            outcome(now_ns)
            self._record_given_up(now_ns)
            self._plans = self.fleet.plans()

    def tell_drops(self, now_ns: int, last: bool = False) -> None:
        """Record how many messages were dropped, at most every _TELL_DROPS and at the end."""
        if not last and now_ns - self._drops_told_ns < _TELL_DROPS:
            return
        dropped = dict(self.intake.dropped)
        if self._journal.not_recorded:
            dropped[NOT_RECORDED] = self._journal.not_recorded
        if dropped != self._drops:
            self._drops, self._drops_told_ns = dropped, now_ns
            self._record(drops_key(self.fleet.name), drops_record(dropped), now_ns)

    def plans_again(self, now_ns: int) -> list[tuple[str, bytes]]:
        """Return the plans for a listener that has not heard them all, as keys and payloads.

        The list is empty if plans were requested too often, or if the plans are withheld.
        """
        plans = self._plans
        if self.is_withheld or now_ns < self._answers_from_ns:
            return []
        self._answers_from_ns = now_ns + _ANSWER_TIME * len(plans)
        return [(plan.key, plan.payload) for plan in plans]

    def orders_again(self) -> list[tuple[str, bytes]]:
        """Return what was said last of each order, as keys and payloads."""
        return list(self._order_states.items())

    def blocks_again(self) -> list[tuple[str, bytes]]:
        """Return the places that are closed, as keys and payloads."""
        name = self.fleet.name
        closed = list(self.fleet.blocks.values())
        return [(keys.blocks(name, block.id), encode(block)) for block in closed]

    def nobody_goes(self, now_ns: int) -> bool:
        """Return whether no robot is on its way, because none was sent or all rest."""
        phase = self.fleet.phase
        is_still = phase == FREEZE and self.fleet.is_settled(now_ns)
        return self.is_withheld or phase == HOLD or is_still

    def _solve(self, asked: Request) -> Outcome:
        return partial(self._adopt, asked, self.mission.solve(asked))

    def _job_of(self, asked: CourseRequest) -> Job:
        search = self.mission.dispatcher.searches.search_for(asked)
        return Job(asked, lambda: partial(self._commit, asked, search()))

    def take_found(self, asked: CourseRequest, found: Found, now_ns: int) -> None:
        """Put into effect what a log says that a search for a course found.

        Raises ValueError if a robot would refuse the course.
        """
        answer = self.mission.dispatcher.searches.recorded(asked, found)
        self.finish(self.under_way[asked], partial(self._commit, asked, answer), now_ns)

    def _commit(self, asked: CourseRequest, found: Answer, now_ns: int) -> None:
        """Put a course into effect that was looked for."""
        if self._journal.error is not None:
            return
        record = search_record(asked, found_of(found))
        self._record(course_key(self.fleet.name), record, now_ns)
        self.mission.commit(asked, found, now_ns)
        self._say([*self.fleet.new_courses(now_ns), *self.fleet.order_states()], now_ns)

    def _adopt(self, asked: Request, found: Recovery, now_ns: int) -> None:
        """Begin the next epoch, unless it cannot be logged."""
        if self._journal.error is not None:
            return
        messages = self.mission.adopt(asked, found, now_ns)
        if messages is None:
            return
        self._record(adoption_key(self.fleet.name), adoption_record(asked), now_ns)
        if found.document is not None:
            self._journal.keep(found.document)
        self._say(messages, now_ns, is_new_epoch=True)

    def _state_ahead(self, now_ns: int) -> None:
        """Have the log say up to which plan time robots may be told to drive, ahead of that."""
        fleet = self.fleet
        if fleet.phase in (HOLD, GO) and fleet.needed_ms + _SOON_MS > fleet.allowed_ms:
            until_ms = fleet.needed_ms + _AHEAD_MS
            self._record(ahead_key(fleet.name), ahead_record(until_ms), now_ns)
            if self._journal.sync():
                fleet.allowed_ms = until_ms

    def _look_at_log(self, now_ns: int) -> None:
        """Report, once, that the log cannot be written any more."""
        if self._journal.error is not None and not self._log_told:
            self._log_told = True
            text = f"{self._journal.error}; no robot is sent on its way any more"
            self.fleet.incidents.append(Incident(now_ns, "log", "", text))

    def _record(self, key: str, payload: bytes, now_ns: int, sent_ns: int | None = None) -> None:
        self._recorded += len(key) + len(payload)
        self._journal.record(key, payload, now_ns, sent_ns)

    def _record_given_up(self, now_ns: int) -> None:
        """Record which robots were given up since."""
        given_up = self.fleet.given_up_news
        for robot in given_up:
            self._record(around_key(self.fleet.name), around_record(robot), now_ns)
        given_up.clear()

    def _say(self, messages: list[Outgoing], now_ns: int, *, is_new_epoch: bool = False) -> None:
        """Log and send messages.

        A new phase, a plan, and an answer about an order or a closed place are in the log before
        anybody hears of them: people and robots act on them.  Plans and a GO that are not in the
        log are not sent: a coordinator that resumes from the log would not know of them.  A new
        epoch is in it with a checkpoint, so that nobody has to plan it again.  What the messages
        state holds without those that were given up before.
        """
        self._record_given_up(now_ns)
        logged_first = only_if_logged = False
        for message in messages:
            self._record(message.key, message.payload, now_ns)
            only_if_logged |= self._is_new_plan(message)
            logged_first |= self._is_answer(message)
        if is_new_epoch:
            self.checkpoint(now_ns)
        if messages and self._phase != (self.fleet.epoch, self.fleet.phase):
            self._phase = (self.fleet.epoch, self.fleet.phase)
            logged_first = True
            only_if_logged |= self.fleet.phase in (HOLD, GO)
        if logged_first or only_if_logged:
            is_logged = self._journal.sync()
            self.is_withheld |= only_if_logged and not is_logged
        if not self.is_withheld:
            for message in messages:
                self._send(message.key, message.payload)

    def _is_new_plan(self, message: Outgoing) -> bool:
        """Return whether a message is a plan that was not sent before; it counts as sent."""
        key, payload = message.key, message.payload
        if not key.startswith(self._plans_key) or self._logged_plans.get(key) == payload:
            return False
        self._logged_plans[key] = payload
        return True

    def _is_answer(self, message: Outgoing) -> bool:
        """Return whether a message is news of an order or of a closed place; keep an order's."""
        key, payload = message.key, message.payload
        name = key.removeprefix(self._orders_key)
        if name == key:
            return key.startswith(self._blocks_key)
        if not self.fleet.orders.has(name) or self._order_states.get(key) == payload:
            return False
        self._order_states[key] = payload
        return True
