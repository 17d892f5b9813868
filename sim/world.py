"""A fleet in virtual time: unmodified fleet core and robot services on the in-memory link.

Decides: the order in which virtual time reaches everybody.  Nothing here waits: a minute of a fleet
takes a fraction of a second, and the same seed gives the same run.
"""

from __future__ import annotations

import random
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from coordinator.fleet import Fleet, Outgoing
from coordinator.muster import muster
from coordinator.plan import PlanDocument, RobotPlan
from protocol import keys
from protocol.phases import FREEZE, GO, PHASE_NAMES
from protocol.timing import COMMAND_PERIOD, MILLISECOND, SECOND
from robot_agent.loop import PERIOD_NS
from robot_agent.service import Robot, RobotService
from sim.blackbox import BlackBox
from sim.body import SimulatedBody
from sim.memory_transport import MemoryNetwork

_STAGGER: Final = 3 * MILLISECOND
_BOOT: Final = 7
_COORDINATOR: Final = "coordinator"


@dataclass(eq=False)
class Inhabitant:
    """One robot of the world: its service, its body, its own clock, what it truly did."""

    service: RobotService
    body: SimulatedBody
    ahead_ns: int
    dead_from_ns: int | None = None
    rows: list[tuple[float, float, float, float, str]] = field(default_factory=list)

    def tick(self, now_ns: int, start_ns: int) -> None:
        """Let one control period pass; a dead robot's motors stop by their watchdog."""
        own_ns = now_ns + self.ahead_ns
        if self.dead_from_ns is not None and now_ns >= self.dead_from_ns:
            self.body.step(own_ns)
        else:
            self.service.tick(own_ns)
        pose, ride = self.body.true_pose(), self.service.agent.ride
        if pose is not None and ride is not None and start_ns and now_ns >= start_ns:
            time = (now_ns - start_ns) / SECOND
            phase = PHASE_NAMES[self.service.agent.phase]
            self.rows.append((time, pose[0], pose[1], ride.follower.s, phase))

    def blackbox(self) -> BlackBox:
        """Return what the robot truly did."""
        numbers = np.array([row[:4] for row in self.rows]).reshape(-1, 4)
        phases = tuple(row[4] for row in self.rows)
        return BlackBox(numbers[:, 0], numbers[:, 1:3], numbers[:, 3], phases)


class World:
    """A proven plan, its robots and a link; `kills` maps robots to plan times of death [s]."""

    def __init__(
        self,
        document: PlanDocument,
        network: MemoryNetwork,
        *,
        seed: int = 0,
        kills: Mapping[str, float] | None = None,
    ) -> None:
        self.fleet: Fleet = muster(document, _BOOT)
        self.now_ns = SECOND
        self.bytes_to_coordinator = 0
        self._network = network
        self._kills = dict(kills or {})
        self._arrivals: list[tuple[str, bytes]] = []
        self._session = network.session(_COORDINATOR)
        for kind in (keys.hello, keys.report, keys.clock):
            self._session.subscribe(kind(self.fleet.name, "*"), self._enqueue)
        chance = random.Random(seed)
        self.robots = {
            robot.id: self._inhabitant(robot, boot, chance.randrange(-SECOND, SECOND))
            for boot, robot in enumerate(document.robots, start=1)
        }

    def run(self, seconds: float) -> None:
        """Let time pass until the fleet is finished or settled, at most `seconds`."""
        end = self.now_ns + round(seconds * SECOND)
        while self.now_ns < end and not self.fleet.is_finished:
            self.step()
            if self.fleet.phase == FREEZE and self.fleet.is_settled(self.now_ns):
                return

    def step(self) -> None:
        """Let one millisecond pass: messages arrive at any, robots tick at their own."""
        self.now_ns += MILLISECOND
        self._network.advance(self.now_ns)
        for key, payload in self._arrivals:
            self.bytes_to_coordinator += len(payload)
            self._send(self.fleet.hear(key, payload, self.now_ns))
        self._arrivals.clear()
        if self.now_ns % COMMAND_PERIOD == 0:
            self._send(self.fleet.tick(self.now_ns))
        if self.fleet.phase == GO:
            for name, time in self._kills.items():
                self.robots[name].dead_from_ns = self.fleet.start_ns + round(time * SECOND)
        for index, robot in enumerate(self.robots.values()):
            if (self.now_ns - index * _STAGGER) % PERIOD_NS == 0:
                robot.tick(self.now_ns, self.fleet.start_ns)

    def blackboxes(self) -> dict[str, BlackBox]:
        """Return what every robot truly did."""
        return {name: robot.blackbox() for name, robot in self.robots.items()}

    def _inhabitant(self, plan: RobotPlan, boot: int, ahead_ns: int) -> Inhabitant:
        accel = plan.limits.max_accel if plan.limits is not None else None
        body = SimulatedBody(float("inf") if accel is None else accel)
        session = self._network.session(plan.id)
        robot = Robot(plan.id, plan.radius)
        service = RobotService(
            robot,
            session,
            body,
            self.fleet.name,
            lambda: self.now_ns,
            boot=boot,
            clock=lambda: self.now_ns + ahead_ns,
        )
        return Inhabitant(service, body, ahead_ns)

    def _enqueue(self, key: str, payload: bytes, _sent_ns: int | None) -> None:
        self._arrivals.append((key, payload))

    def _send(self, messages: list[Outgoing]) -> None:
        for message in messages:
            self._session.put(message.key, message.payload)
