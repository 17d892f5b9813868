"""Finds the faults that a log tells of, and who has them: a robot, the coordinator or the router.

Decides: what counts as a fault, and who is blamed for silence and lost links.  Must not know: how
a log is read, what else is summed up.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping

from coordinator.findings.info_fields import FaultSummary, Summary
from coordinator.fleet.log_records import LINK_UP, request_of
from coordinator.fleet.member import WITHOUT
from coordinator.fleet.phases import AWAY
from protocol import phases
from protocol.messages import Report
from protocol.timing import REPORT_TIMEOUT


class Faults:
    """The faults of one log, which fill in `Summary.faults` and those of its robots."""

    def __init__(
        self,
        summary: Summary,
        seconds: Callable[[int], float],
        heard: Mapping[str, tuple[int, int]],
    ) -> None:
        """heard: when [ns] robots were heard last in the logs before, and in which phase.

        seconds: gives the time [s] in the summary of a time [ns] in the log.
        """
        self._summary, self._seconds = summary, seconds
        self._heard = dict(heard)
        self._reported: dict[str, int] = {}
        self._unfit: dict[str, str] = {}
        self._quiet: set[str] = set()
        """Robots that have lost their links or fell silent, and were not heard since."""

        self._commanded_ns = self._here_ns = 0
        """When the coordinator spoke last, and when it spoke again after it was away."""
        self._away_ns = 0
        """For how long it was away then; 0 if links are not lost by so short an absence."""
        self._is_away_told = False

        self._has_router: bool | None = None

    def tell(self, log_ns: int, robot: str, fault: str, kind: str) -> None:
        """Record a fault of a robot, or of none (`robot` is empty)."""
        self._summary.faults.append(FaultSummary(self._seconds(log_ns), robot, fault, kind))

    def end(self) -> None:
        """Blame robots that were left where they stand for that, unless they arrived."""
        for name, robot in self._summary.robots.items():
            if robot.arrived is None:
                robot.fault = self._unfit.get(name, robot.fault)

    def hear_report(self, report: Report, robot: str, log_ns: int) -> None:
        """Take in a report: who is heard is not silent, and says its fault itself."""
        told = self._summary.robot(robot)
        self._heard[robot] = (log_ns, report.phase)
        if robot in self._quiet:
            self._quiet.discard(robot)
            told.fault = None
        if report.fault == self._reported.get(robot, phases.NO_FAULT):
            return
        self._reported[robot] = report.fault
        told.fault = phases.fault_name(report.fault) if report.fault != phases.NO_FAULT else None
        if told.fault is not None and report.phase != phases.IDLE:
            self.tell(log_ns, robot, told.fault, "report")

    def hear_coordinator(self, log_ns: int) -> None:
        """Take in that the coordinator spoke: links that were lost while it did not are its own."""
        away_ns = log_ns - self._commanded_ns
        if away_ns > AWAY:
            self._here_ns = log_ns
            self._away_ns = away_ns if self._commanded_ns and away_ns > REPORT_TIMEOUT else 0
            self._is_away_told = False
            if self._away_ns and self._excuse_links(self._commanded_ns):
                self._tell_away()
        self._commanded_ns = log_ns

    def _tell_away(self) -> None:
        if not self._is_away_told:
            away = self._away_ns / 1e9
            self.tell(self._here_ns, "", f"the coordinator was away for {away:.1f} s", "away")
        self._is_away_told = True

    def hear_router(self, payload: bytes, log_ns: int) -> None:
        """Take in whether the coordinator reaches its router: links lost with it are its own."""
        is_up = payload == LINK_UP
        if self._has_router and not is_up:
            self._excuse_links(log_ns - REPORT_TIMEOUT)
            self.tell(log_ns, "", "the router is gone", "router")
        self._has_router = is_up

    def _excuse_links(self, since_ns: int) -> bool:
        """Blame no robot for links that were lost since then; return whether any were."""
        since = self._seconds(since_ns)
        lost = [one for one in self._summary.faults if one.kind == "link" and one.t >= since]
        self._summary.faults = [one for one in self._summary.faults if one not in lost]
        for one in lost:
            self._summary.robot(one.robot).fault = None
        return bool(lost)

    def lose_link(self, robot: str, log_ns: int) -> bool:
        """Take in that a robot lost its link while the fleet was under way.

        Return whether that counts: the router is there, and the robot has not arrived.  Links that
        a coordinator lost while it was away are told to it when it is back.
        """
        if self._away_ns and log_ns - self._here_ns < REPORT_TIMEOUT:
            self._tell_away()
            return False
        _, phase = self._heard.get(robot, (0, phases.IDLE))
        if self._has_router is False or phase == phases.DONE:
            return False
        self._quiet.add(robot)
        fault = self._summary.robot(robot).fault = "lost its link"
        self.tell(log_ns, robot, fault, "link")
        return True

    def find_silent(self, log_ns: int, of_phases: Collection[int]) -> None:
        """Record which robots that were last in one of these phases have been silent for too long.

        Nobody is heard while the coordinator itself is away, and sends no Command.
        """
        for robot, (heard_ns, phase) in self._heard.items():
            silent_ns = log_ns - max(heard_ns, self._here_ns)
            is_known = robot in self._quiet or self._summary.robot(robot).fault is not None
            if not is_known and phase in of_phases and silent_ns > REPORT_TIMEOUT:
                self._quiet.add(robot)
                fault = self._summary.robot(robot).fault = "fell silent"
                self.tell(log_ns, robot, fault, "silence")

    def find_unfit(self, payload: bytes, log_ns: int) -> None:
        """Record robots that a new epoch leaves out although they are heard."""
        request = request_of(payload)
        for one in request.told if request is not None else ():
            if one.state not in ("unfit", "overloaded"):
                self._unfit.pop(one.robot, None)
            elif one.robot not in self._unfit:
                self._unfit[one.robot] = f"left where it stands: {WITHOUT[one.state]}"
                self.tell(log_ns, one.robot, self._unfit[one.robot], "unfit")
