"""A recorded run continued in virtual time from a moment of its log: a what-if.

Decides: how the simulated robots get to where the recorded robots were.  The coordinator's state is
exact (history.py).  The robots are created anew and receive, up to the moment, the messages that
the log has for them.  Where the recorded robots reported that they rest, and whether they fell
silent, corrects their state.  Black boxes, where there are any, state exactly where every robot
was.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Final

import numpy as np

from coordinator.findings.log_proof import plans_of
from coordinator.log.head import Head
from coordinator.log.log_file import RESUMED
from coordinator.log.log_writer import WALL_OFFSET, Attachment
from coordinator.log.records import Record
from coordinator.mission.replanning_input import pose_beside
from coordinator.plan.wire import Driven, drive
from coordinator.service.replay import scenario_of
from protocol import keys
from protocol.codec import decode, encode
from protocol.messages import Clock, Command, Rest
from protocol.timing import COMMAND_PERIOD, MILLISECOND, SECOND
from robot_agent.driver import Pose
from robot_agent.loop import PERIOD_NS
from sim.judging.blackbox import Row
from sim.what_if.history import History, Known
from sim.world.body import SimulatedBody
from sim.world.fault_text import Fault
from sim.world.memory_transport import MemoryNetwork, MemorySession
from sim.world.run_logs import RunLogs
from sim.world.virtual_fleet import Past, World

LINK_NS: Final = (MILLISECOND, 3 * MILLISECOND)
"""The shortest and the longest delay of a message [ns]."""

_TOLD_AGAIN: Final = ("command", "plan")
_PLAN: Final = "plan-"


def world_of(
    history: History,
    logs: RunLogs,
    boxes: Mapping[str, Sequence[Row]],
    faults: Sequence[Fault] = (),
    seed: int = 0,
) -> World:
    """Return a world in the state at the end of a history, ready to run on.

    The history is written to `logs`, which the caller closes.  boxes: the rows of the robots' black
    boxes, where there are any.
    """
    _write_down(history, logs)
    records = list(history.records())
    ticks = math.ceil((history.until_ns - records[0].log_ns) / COMMAND_PERIOD) + 1
    begin_ns = _last_command_ns(records) - ticks * COMMAND_PERIOD
    boots = {name: one.boots[0][1].boot for name, one in history.robots.items() if one.boots}
    network = MemoryNetwork(seed, delay_ns=LINK_NS)
    world = World(
        scenario_of(history.logs[0]),
        plans_of(history.logs)[0],
        network,
        seed=seed,
        faults=faults,
        logs=logs,
        past=Past(history.mission, begin_ns, history.began_ns, boots),
    )
    _Past(world, history, network, boxes).prepare(records)
    world.go_on((history.until_ns - begin_ns) / SECOND)
    return world


def logs_for(history: History, folder: Path) -> RunLogs:
    """Return logs in `folder` with the same wall clock as the last log of a history."""
    return RunLogs(folder, int(history.logs[-1].metadata[WALL_OFFSET]))


def _write_down(history: History, logs: RunLogs) -> None:
    """Write the history to the logs, before the new run adds to them."""
    for data in history.before:
        logs.keep(data)
    last = history.logs[-1]
    offset_ns = int(last.metadata[WALL_OFFSET])
    logs.begin(_head(history))
    for record in last.records:
        logs.record(record.key, record.payload, record.log_ns, record.publish_ns - offset_ns)


def _head(history: History) -> Head:
    """Return the head of the new log: that of the old log, without later plans."""
    last, known = history.logs[-1], history.mission.documents
    until = (history.until_ns - history.began_ns) / SECOND
    metadata = {name: text for name, text in last.metadata.items() if name != WALL_OFFSET}
    names = ["scenario.json", RESUMED, *(f"{_PLAN}{epoch}.json" for epoch in sorted(known))]
    kinds = {RESUMED: "application/octet-stream"}
    files = [
        Attachment(name, kinds.get(name, "application/json"), last.attachments[name])
        for name in names
        if name in last.attachments
    ]
    return {**metadata, "what_if": f"{until:g}"}, files


def _last_command_ns(records: Sequence[Record]) -> int:
    """Return when the core sent its last Command [ns]; its further ticks count from then."""
    return max(record.log_ns for record in records if record.key.endswith("/command"))


class _Past:
    """Takes the robots of a world through a history."""

    def __init__(
        self,
        world: World,
        history: History,
        network: MemoryNetwork,
        boxes: Mapping[str, Sequence[Row]],
    ) -> None:
        self._world = world
        self._history = history
        self._boxes = boxes
        self._fleet = world.fleet.name
        self._session: MemorySession = network.session("the past")
        self._session.subscribe(keys.clock(self._fleet, "*"), self._answer)
        self._rides: dict[int, dict[str, Driven]] = {}
        self._leads = world.fleet.boot
        """The boot id of the coordinator that leads at the time: robots hear no other's time."""

    def prepare(self, records: Sequence[Record]) -> None:
        """Schedule all that happens until the end of the history, and the hand-over then."""
        for record in records:
            place = keys.split(record.key)
            if place is not None and place[1] in _TOLD_AGAIN:
                self._at(record.log_ns, partial(self._tell_again, record))
        for name in self._world.robots:
            self._prepare_robot(name, self._history.robots.get(name, Known()))
        self._at(self._history.until_ns, self._hand_over)

    def _prepare_robot(self, name: str, known: Known) -> None:
        world, until_ns = self._world, self._history.until_ns
        for now_ns, hello in known.boots[1:]:
            x, y, heading = (number / 1000.0 for number in hello.place or (0, 0, 0))
            place = None if hello.place is None else (x, y, heading)
            self._at(now_ns, partial(world.renew, name, hello.boot, place))
        for now_ns, rest in known.rests:
            self._at(now_ns, partial(self._rest, name, rest))
        if known.is_silent(until_ns):
            fault = Fault("hang" if known.linked else "kill", name, 0.0, math.inf)
            self._at(known.heard_ns, partial(world.strike, fault))
        if self._boxes.get(name):
            self._world.agenda.at(world.now_ns, self._follower(name, self._boxes[name]))

    def _tell_again(self, record: Record) -> None:
        if isinstance(command := decode("command", record.payload), Command):
            self._leads = command.boot
        self._session.put(record.key, record.payload)

    def _at(self, now_ns: int, action: Callable[[], None]) -> None:
        self._world.agenda.once(max(now_ns, self._world.now_ns), action)

    def _answer(self, key: str, payload: bytes, _sent_ns: int | None) -> None:
        """Answer a question about the time; the log's answers do not fit the new clock."""
        asked = decode("clock", payload)
        if isinstance(asked, Clock) and asked.received_ns is None:
            now_ns = self._world.now_ns
            answer = Clock(asked.boot, asked.sent_ns, now_ns, now_ns, self._leads)
            self._session.put(key, encode(answer))

    def _rest(self, name: str, rest: Rest) -> None:
        """Move a robot to where it reported that it rests."""
        document = self._world.mission.documents.get(rest.epoch)
        if document is None:
            return
        if rest.epoch not in self._rides:
            self._rides[rest.epoch] = {one.id: one for one in drive(document)}
        ride = self._rides[rest.epoch].get(name)
        if ride is not None and name not in self._boxes:
            self._world.robots[name].body.place(*place_of(ride, rest))

    def _follower(self, name: str, rows: Sequence[Row]) -> Callable[[], int]:
        """Return an action that moves a body along the rows of its black box."""
        table = np.array([row[:4] for row in rows])
        table[:, 3] = np.unwrap(table[:, 3])
        body = self._world.robots[name].body

        def follow() -> int:
            now_ns = self._world.now_ns
            t = (now_ns - self._history.began_ns) / SECOND
            if t >= table[0, 0] and body.true_pose() is not None:
                move(body, [float(np.interp(t, table[:, 0], table[:, i])) for i in (1, 2, 3)])
            return 0 if now_ns >= self._history.until_ns else now_ns + PERIOD_NS

        return follow

    def _hand_over(self) -> None:
        """Let the coordinator take over; robots continue the sequence numbers of their reports."""
        self._session.close()
        for name, known in self._history.robots.items():
            self._world.robots[name].service.agent.report_sequence = known.sequence
        self._world.take_over()


def place_of(ride: Driven, rest: Rest) -> Pose:
    """Return the pose of a robot that rests at `rest` on its path."""
    off, beyond, turn = (n / 1000.0 for n in (rest.off_mm, rest.beyond_mm, rest.turn_mrad))
    return pose_beside(ride, min(rest.s_m, ride.curve.length), off, beyond, turn)


def move(body: SimulatedBody, pose: Sequence[float]) -> None:
    """Move a body to a pose without stopping it."""
    body.x, body.y = pose[0], pose[1]
    body.heading = math.remainder(pose[2], math.tau)
