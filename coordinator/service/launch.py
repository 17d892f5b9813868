"""One coordinator from start to end: plan, listen, log, run, report what happened.

Decides: the order of these steps, and that the log is closed whatever happens.
"""

from __future__ import annotations

import asyncio
import gc
import os
import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from functools import partial
from itertools import count
from pathlib import Path
from typing import Final

import msgspec
from msgspec.structs import replace

from coordinator.base.console import answer_json, tell_now, write_file
from coordinator.base.errors import InputError
from coordinator.base.interrupts import was_asked
from coordinator.base.own_file import is_being_written
from coordinator.desk.answers import Alarm
from coordinator.findings.info_fields import OrderSummary
from coordinator.fleet.core import Fleet
from coordinator.fleet.hold_reasons import RollCall
from coordinator.log.head import first_head, resumed
from coordinator.log.log_file import is_unfinished, read_newest
from coordinator.log.log_folder import files_of_runs, numbered_files
from coordinator.log.recorder import Recorder
from coordinator.log.records import Log
from coordinator.mission.aside_news import AsideNews
from coordinator.mission.mission import Mission
from coordinator.plan.document import PlanDocument
from coordinator.plan.plan_file import plan_name, to_json
from coordinator.plan.wire import PackedPlan
from coordinator.scenario.changes import Change, changes
from coordinator.scenario.model import Scenario
from coordinator.security.denials import denial_key, denial_record
from coordinator.security.link_admission import Gate
from coordinator.service.alarm_bell import AlarmBell
from coordinator.service.coordinator_service import Service
from coordinator.service.desk_process import DeskPlace, with_desk
from coordinator.service.meeting_place import SOMEWHERE, MeetingPlace
from coordinator.service.planning import check_is_driven, plan_here
from coordinator.service.replay import go_on, scenario_of
from coordinator.view.live_table import FleetTable
from coordinator.view.order_lines import order_line
from protocol.host_clock import host_clock_ns, time_of_day
from protocol.phases import COMMAND_NAMES, OVER, PHASE_NAMES
from protocol.shared_clock import announce_clock
from protocol.transport import Transport

LOG_SIZE: Final = 64.0
"""The usual size [MB] of the files of a log that is a folder."""

NO_LOG: Final = "--resume without --log: nothing is recorded, so no coordinator can go on from here"
UNTIL: Final = (
    "orders are taken until the mission is ended: press end mission on the page, or "
    f"`splinefleet end {SOMEWHERE}`"
)


class Coordinator:
    """The coordinator of one scenario's fleet; its clock is `speed` times as fast as real time."""

    def __init__(
        self, scenario: Scenario, *, effort: int, speed: float, events: bool, stays: bool = False
    ) -> None:
        self.scenario = scenario
        self.effort = effort
        self.speed = speed
        self._events = events
        self._stays = stays
        self._told = 0
        self._log_failed: Callable[[str], None] = lambda _: None
        self._roll_call = RollCall()
        self._aside_news = AsideNews(speed)
        self._before, self._began_ns = b"", 0
        self._gate: Gate | None = None
        self._reach = SOMEWHERE

    def clock(self) -> int:
        """Return the coordinator's time [ns]: the host's clock times `speed`."""
        return int(host_clock_ns() * self.speed)

    def run(
        self,
        place: MeetingPlace,
        log: Path | None,
        plan_file: Path | None,
        patience: float,
        resume: Path | None = None,
        keys: Path | None = None,
        log_size: float = LOG_SIZE,
        *,
        with_scenario: bool = False,
        desk: DeskPlace | None = None,
    ) -> int:
        """Run to the end and return the exit code; `resume` is the log to resume from.

        `desk`: where the operator's page is served, if it is.

        `with_scenario`: whether the scenario may have another floor than the log.  Then the fleet
        freezes and is planned anew.

        `keys` is a fleet's folder of keys; if it is given, only holders of these keys can connect.
        If `log` is a folder, its files are about `log_size` MB long; by default it is `resume` if
        that is a folder.

        Raises InputError, PlanError and TransportError before anything moves.
        """
        check_is_driven(self.scenario)
        if log is None and resume is not None and resume.is_dir():
            log = resume
        if log is not None:
            _check_place(log, resume)
        elif resume is not None:
            self._say("warning", text=NO_LOG)
        if keys is not None:
            robots = [robot.id for robot in self.scenario.robots]
            self._gate = Gate(keys, self.scenario.name, robots)
            for warning in self._gate.warnings:
                self._say("warning", text=warning)
        self._reach = place.options(keys)
        boot = int.from_bytes(os.urandom(4), "little")
        if resume is None:
            mission = self._begin(boot, plan_file)
        else:
            mission = self._go_on(boot, resume, with_scenario=with_scenario)
        fleet, document = mission.fleet, mission.document
        with ExitStack() as stack:
            if self._gate is not None:
                stack.callback(self._gate.close)
            stack.enter_context(announce_clock(boot))
            link = stack.enter_context(place.open(self._gate))
            transport: Transport = link
            if desk is not None:

                def told(address: str, text: str) -> None:
                    self._say("page", address=address, text=text)

                transport = stack.enter_context(with_desk(link, document, desk, told))
                self._log_failed = transport.tell_log_failed
                if self._stays:
                    self._say("until", text=UNTIL)
            recorder = self._recorder(log, document, boot, resume, log_size)
            try:
                self._say("listening", endpoint=place.endpoint, text=str(place))
                times = partial(self._time_of_day, fleet)
                with FleetTable(document, times) as table:
                    service = Service(
                        mission,
                        transport,
                        recorder,
                        self.clock,
                        self.speed,
                        self._watcher(mission, table, recorder),
                        lambda document: self._keep(document, plan_file, table),
                        link.has_router if place.routed else None,
                    )
                    gc.collect()
                    gc.freeze()  # What is there by now stays: to look through it takes 50 ms.
                    arrived = asyncio.run(service.run(patience))
                self._tell_incidents(fleet)
                self._summarise(fleet, arrived, service.driver.intake.dropped)
            finally:
                recorder.close()
                if was_asked() and fleet.has_gone and fleet.phase != OVER:
                    self._tell_interrupted(log)
        return 0 if arrived else 1

    def _tell_interrupted(self, log: Path | None) -> None:
        """Say what the robots do now that their coordinator ends before they have."""
        how = (
            f"a coordinator with --resume {log} goes on" if log else "there is no log to go on from"
        )
        self._say("interrupted", text=f"robots now stop where their authority ends; {how}")

    def _begin(self, boot: int, plan_file: Path | None) -> Mission:
        plan = plan_here(self.scenario, self.effort)
        if plan_file is not None:
            write_file(plan_file, to_json(plan.document))
        return Mission.of_plan(self.scenario, plan, boot, self._plan_again, stays=self._stays)

    def _go_on(self, boot: int, resume: Path, *, with_scenario: bool = False) -> Mission:
        """Resume the mission in the log of a coordinator that has died."""
        self._began_ns = self.clock()
        try:
            for file in numbered_files(resume) if resume.is_dir() else [resume]:
                if file.is_file() and is_being_written(file):
                    why = "a coordinator is writing it; end that one first, also if it hangs"
                    raise InputError([f"{file}: {why}"])
            log, self._before = read_newest(resume)
            scenario = self._scenario_on(log, resume, with_scenario)
            mission = go_on(log, boot, self._began_ns, scenario)
        except InputError as error:
            raise InputError([f"--resume: {problem}" for problem in error.problems]) from None
        self._stays = mission.fleet.orders.stays
        self.scenario = scenario
        speed = log.metadata.get("speed", str(self.speed))
        if speed != str(self.speed):
            raise InputError([f"--resume: {resume} is the log of a fleet at --speed {speed[:40]}"])
        if not self._events:
            self._told = len(mission.fleet.incidents) - 1
        for remark in log.remarks:
            self._say("warning", text=f"{resume}: {remark}")
        self._aside_news.news(mission, self._began_ns)  # The log's coordinator has told these.
        count = sum(not member.has_arrived for member in mission.fleet.members.planned)
        under_way = "1 robot is" if count == 1 else f"{count or 'no'} robots are"
        self._say("resumed", text=f"goes on from {resume}: {under_way} under way")
        return mission

    def _scenario_on(self, log: Log, resume: Path, with_scenario: bool) -> Scenario:
        """Return the scenario of a log, with the floor that it may have now.

        It has the robots in the order in which replay plans them.  Raises InputError if anything
        else differs.
        """
        try:
            planned = scenario_of(log)
        except KeyError:
            raise InputError([f"{resume} holds no scenario"]) from None
        if planned.name != self.scenario.name:
            raise InputError([f"{resume} is the log of fleet {planned.name}"])
        changed = changes(planned, self.scenario)
        others = [one for one in changed if not one.field.startswith("workspace.")]
        if others or (changed and not with_scenario):
            hint = "" if others else "; --with-scenario plans the fleet anew on the new floor"
            raise InputError([_changed(resume, one) + hint for one in others or changed])
        return replace(planned, workspace=self.scenario.workspace) if changed else planned

    def _plan_again(self, scenario: Scenario, epoch: int) -> PackedPlan:
        return plan_here(scenario, self.effort, epoch)

    def _keep(self, document: PlanDocument, first: Path | None, table: FleetTable) -> None:
        """Write a later plan beside the first one, report it, and give it to the live table."""
        table.follow(document)
        if first is not None:
            name = plan_name(document.epoch).removeprefix("plan")
            file = first.with_name(f"{first.stem}{Path(name).stem}{first.suffix}")
            try:
                write_file(file, to_json(document))
            except InputError as error:  # Do not stop: robots wait for this plan or drive already.
                self._say("warning", text=str(error))
        count = len(document.robots)
        who = "1 robot goes" if count == 1 else f"{count} robots go"
        text = f"epoch {document.epoch}: {who} on"
        self._say("planned", text=text)

    def _recorder(
        self,
        log: Path | None,
        document: PlanDocument,
        boot: int,
        resume: Path | None,
        log_size: float = LOG_SIZE,
    ) -> Recorder:
        head = first_head(
            self.scenario,
            document,
            boot=boot,
            effort=self.effort,
            speed=self.speed,
            stays=self._stays,
        )
        path = log if log is not None else Path(os.devnull)
        goes_on = resume is not None and path.is_dir() and path.samefile(resume)
        if resume is not None:
            head = resumed(head, b"" if goes_on else self._before, self._began_ns)
        is_folder = path.is_dir() or not (path.exists() or path.suffix)
        if not goes_on and (path.is_file() or (path.is_dir() and files_of_runs(path))):
            earlier = _moved_away(path)
            self._say("warning", text=f"{path} is there already; it is now {earlier}")
        if is_folder:
            path.mkdir(exist_ok=True)
        metadata, attachments = head
        return Recorder(
            path,
            metadata=metadata,
            wall_offset_ns=time.time_ns() - self.clock(),
            attachments=attachments,
            most_bytes=round(log_size * 1e6),
        )

    def _watcher(
        self, mission: Mission, table: FleetTable, recorder: Recorder
    ) -> Callable[[Fleet, int], None]:
        bell = AlarmBell(self._told)

        def watch(fleet: Fleet, now_ns: int) -> None:
            self._tell_denials(recorder, now_ns)
            self._tell_incidents(fleet)
            self._tell_aside(mission, now_ns)
            for alarm, text in bell.news(fleet, now_ns, time.time()):
                self._tell_alarm(alarm, text)
            waiting = self._roll_call.news(fleet, now_ns)
            if waiting:
                self._say("waiting", text=waiting)
            table.watch(fleet, now_ns)

        return watch

    def _tell_alarm(self, alarm: Alarm, text: str) -> None:
        """Report an alarm; people have read in the line before it that an order is refused."""
        is_refusal = alarm.is_lasting and alarm.order != ""
        if self._events or not is_refusal:
            self._say("alarm", **{**msgspec.structs.asdict(alarm), "text": text})

    def _tell_incidents(self, fleet: Fleet) -> None:
        """Report the incidents since the last call."""
        for incident in fleet.incidents[self._told :]:
            if incident.kind == "log":
                self._log_failed(incident.text)
            order, facts = incident.order, {}
            text = incident.text
            if order is not None:
                text = order_line(order, partial(self._time_of_day, fleet))
                facts = {"order": msgspec.to_builtins(OrderSummary.of(order))}
            self._say(
                incident.kind,
                robot=incident.robot,
                text=text,
                now_ns=incident.now_ns,
                start_ns=fleet.times.start_ns,
                phase=None if incident.phase is None else COMMAND_NAMES[incident.phase],
                **facts,
            )
        self._told = len(fleet.incidents)

    def _time_of_day(self, fleet: Fleet, since_go_ms: int) -> str:
        """Return the local time of the day at a time since the first GO [ms]."""
        ahead = (since_go_ms - fleet.since_go_ms(self.clock())) / 1000.0 / self.speed
        return time_of_day(time.time() + ahead)

    def _tell_denials(self, recorder: Recorder, now_ns: int) -> None:
        """Report the parties that the gate has refused, and record them in the log."""
        for denial in [] if self._gate is None else self._gate.news():
            recorder.record(denial_key(self.scenario.name), denial_record(denial), now_ns)
            self._say("denied", who=denial.who, cause=denial.cause, text=denial.text)

    def _tell_aside(self, mission: Mission, now_ns: int) -> None:
        """Report robots that have no part in a new epoch."""
        for robot, text in self._aside_news.news(mission, now_ns):
            self._say("aside", robot=robot, text=text)

    def _say(self, event: str, *, text: str, **facts: object) -> None:
        """Tell an event; the commands that its text names get the options that reach this fleet."""
        text = text.replace(SOMEWHERE, self._reach)
        if self._events:
            answer_json({"event": event, "text": text, **facts})
        elif event == "listening":
            tell_now(f"{self.scenario.name}: {text}")
        elif event != "report":
            tell_now(text)

    def _summarise(self, fleet: Fleet, arrived: bool, dropped: Mapping[str, int]) -> None:
        """Report how every robot ended; times count from the first GO."""
        robots = [
            {
                "id": member.id,
                "phase": "lost" if member.lost else PHASE_NAMES[member.phase],
                "arrived": None
                if member.done_ns is None
                else fleet.since_go_ms(member.done_ns) / 1000.0,
                "rest_s": member.rest_s,
            }
            for member in fleet.members.values()
        ]
        if self._events:
            counts = {"bad_messages": fleet.bad_messages, "dropped": dropped}
            answer_json({"event": "summary", "arrived": arrived, "robots": robots, **counts})
            return
        for robot in robots:
            when = robot["arrived"]
            text = (
                f"arrived {when} s after the first GO"
                if when is not None
                else f"ended {robot['phase']}"
            )
            tell_now(f"{robot['id']}: {text}")
        if dropped:
            tell_now(
                "dropped: " + ", ".join(f"{count} {cause}" for cause, count in dropped.items())
            )


def _changed(log: Path, change: Change) -> str:
    """Return words that say how the scenario differs from the one of the log's plan."""
    before, now = ("none" if one is None else one for one in (change.before, change.after))
    return f"{log} was planned with {change.field} {before}, but the scenario now has {now}"


def _check_place(log: Path, resume: Path | None) -> None:
    """Raise InputError if a log cannot be written to its place without losing another one."""
    is_same = resume is not None and log.resolve() == resume.resolve()
    if is_same and not log.is_dir():
        raise InputError([f"--log: {log} is the log to resume from; name another file"])
    if not is_same and is_unfinished(log):
        raise InputError([f"--log: {log} holds a run that has not ended; --resume resumes it"])


def _moved_away(path: Path) -> Path:
    """Rename a file or folder to the first free name of NAME.1, NAME.2, ...; return that name."""
    names = (path.with_name(f"{path.name}.{number}") for number in count(1))
    return path.rename(next(name for name in names if not name.exists()))
