"""The state of a fleet core: phase, epoch, members and times, and how they change.

Decides: how the phase changes, what the router's link means for it, and what a Command contains.
Must not know: what is heard, when the time is looked at (core.py).
"""

from __future__ import annotations

from coordinator.fleet.delay import Delay
from coordinator.fleet.epoch_times import EpochTimes
from coordinator.fleet.events import Incident, Outgoing
from coordinator.fleet.failures import Failing
from coordinator.fleet.grants import Grants, Stated
from coordinator.fleet.member import Member
from coordinator.fleet.own_outage import Absence
from coordinator.fleet.phases import FAREWELLS, RESUME_PATIENCE, TRANSITIONS, Event
from coordinator.fleet.rest_places import Standing
from coordinator.fleet.roster import Roster
from coordinator.fleet.router_link import RouterLink
from protocol import keys
from protocol.codec import encode
from protocol.messages import MOST_NAMED, Command
from protocol.phases import COMMAND_NAMES, FREEZE, GO, HOLD, OVER
from protocol.timing import COMMAND_PERIOD, MILLISECOND


class FleetState:
    """The state of one fleet; all times in ns on the coordinator's clock."""

    def __init__(
        self,
        name: str,
        boot: int,
        members: list[Member],
        times: EpochTimes,
        delay: Delay,
        grants: Grants | None,
    ) -> None:
        self.name = name
        self.boot = boot
        self.times = times
        self.epoch = self.first_epoch = times.epoch
        self.members = Roster(members)
        self.phase = HOLD
        self.incidents: list[Incident] = []
        self._sequence = 0
        self._changed_ns = 0
        self._delay = delay
        self._grants = grants
        """None when this epoch's Commands state no authority: its times have been replaced."""
        self._absence = Absence()
        self._router = RouterLink()
        self._patient_until_ns = 0
        self.is_resumed = self.superseded = False
        self._not_gone = 0
        """After a resume: the log's last epoch, if it had not started to drive; else 0."""
        self._farewells = 0

    @property
    def is_finished(self) -> bool:
        """Whether the phase is OVER and enough Commands have stated it."""
        return self.phase == OVER and self._farewells >= FAREWELLS

    @property
    def next_epoch(self) -> int:
        """The number of the next plan."""
        return max(self.epoch, self.times.epoch + 1)

    def is_settled(self, now_ns: int) -> bool:
        """Return whether a frozen fleet rests: each robot has said where it rests, or is lost."""
        if self.phase != FREEZE or now_ns < self._changed_ns + COMMAND_PERIOD:
            return False
        if self._not_gone == self.times.epoch and now_ns < self._patient_until_ns:
            unheard = [m for m in self.members.planned if m.heard_ns < self._changed_ns]
            if unheard:  # One of them may know that the epoch has started.
                return False
        waits = self._router.may_be_silent(self._changed_ns, now_ns) and self.members.is_unheard()
        if waits or self._router.is_down:
            return False
        return self.members.has_told(self.times.has_gone)

    def outrun(self, what: str, now_ns: int) -> None:
        """Stop leading if this coordinator resumed from a log that lacks what robots have done."""
        if self.is_resumed and not self.superseded:
            self._tell(
                now_ns, "fault", "", f"{what}, which the log does not hold; is it the newest log?"
            )
            self.superseded = True

    def standings(self) -> list[Standing]:
        """Return the standings of robots that have a part or have said where they rest."""
        times = self.times
        return self.members.standings(times.epoch, times.zero_ns, times.until_ns, times.has_gone)

    @property
    def revision(self) -> int:
        """How often new times have replaced the times of this epoch."""
        return self._delay.revision

    def missing(self, now_ns: int) -> list[str]:
        """Return the ids of the robots that are not armed yet."""
        return self.members.unarmed(self.epoch, now_ns)

    def _hear_router(self, up: bool, now_ns: int) -> None:
        """Freeze when the router is gone; when it is back, give the robots time to be heard."""
        if not self._router.take(up):
            return
        self._tell(now_ns, "router", "", f"the router is {'back' if up else 'gone'}")
        if up:
            self._patient_until_ns = now_ns + RESUME_PATIENCE
            for member in self.members.planned:
                member.lost = member.gone = False
        elif self.phase == GO or self.epoch != self.first_epoch:
            self._turn("robot failed", now_ns)

    def plans(self) -> list[Outgoing]:
        """Return the Plan messages of this epoch, each followed by its newest NewTimes message."""
        planned = [(keys.plan(self.name, member.id), member) for member in self.members.planned]
        return [
            Outgoing(key, payload)
            for key, member in planned
            for payload in (member.plan, member.times if member.revision else b"")
            if payload
        ]

    def _send_plan(self, member: Member, now_ns: int) -> list[Outgoing]:
        """Return a robot's Plan to send, unless it was just sent or the robot has no part."""
        if self.phase not in (HOLD, GO) or not member.plan_due(now_ns):
            return []
        return [Outgoing(keys.plan(self.name, member.id), member.plan)]

    def _give_up(self, failing: list[Failing], now_ns: int) -> None:
        """Freeze the fleet because of these robots."""
        for member, what, lost, strike in failing:
            member.lost |= lost
            if strike:
                member.struck.add(self.epoch)
            self._fail(member, f"{member.id} {what}", now_ns)

    def _fail(self, member: Member, text: str, now_ns: int) -> None:
        self._tell(now_ns, "fault", member.id, text)
        self._turn("robot failed", now_ns)

    def _turn(self, event: Event, now_ns: int) -> None:
        phase = TRANSITIONS.get((self.phase, event))
        if phase is None:
            return
        self.phase, self._changed_ns = phase, now_ns
        if phase == FREEZE:
            self._delay.drop()
            self.times.freeze(now_ns)
        if phase == GO:
            self.times.go(now_ns)
            for member in self.members.planned:
                member.set_out(self.epoch, now_ns)
        self._tell_phase(now_ns, COMMAND_NAMES[phase])

    def _command(self, now_ns: int) -> Outgoing:
        self._sequence += 1
        stated = Stated()
        if self.phase == GO and self._grants is not None:
            stated = self._grants.grant((now_ns - self.times.start_ns) // MILLISECOND)
        wanted = self.members.wanted(self.phase == FREEZE)
        command = Command(
            boot=self.boot,
            sequence=self._sequence,
            epoch=self.epoch,
            phase=self.phase,
            start_ns=self.times.start_ns if self.phase in (GO, FREEZE) else 0,
            wanted=tuple(wanted[: MOST_NAMED - len(stated.held)]),
            said_ns=now_ns,
            authority_ms=stated.authority_ms,
            held=stated.held,
        )
        return Outgoing(keys.command(self.name), encode(command))

    def _tell_phase(self, now_ns: int, text: str) -> None:
        self.incidents.append(Incident(now_ns, "phase", "", text, self.phase))

    def _tell(self, now_ns: int, kind: str, robot: str, text: str) -> None:
        self.incidents.append(Incident(now_ns, kind, robot, text))
