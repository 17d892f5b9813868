"""A fleet in virtual time: unmodified fleet core and robot services on the in-memory link.

Decides: the order in which virtual time reaches everybody, and how fleet, robots and link are put
together; what faults do is in strikes.py.  Nothing here waits: time jumps from one event to the
next, a minute of a fleet takes a fraction of a second, and the same seed gives the same run.
"""

from __future__ import annotations

import math
import random
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Final

from coordinator.fleet import Fleet
from coordinator.log_head import first_head
from coordinator.mission import Mission
from coordinator.plan import PlanDocument, RobotPlan
from coordinator.planner import plan_scenario
from coordinator.scenario import Scenario
from protocol.phases import GO
from protocol.timing import COMMAND_PERIOD, MILLISECOND, SECOND
from robot_agent.loop import PERIOD_NS
from robot_agent.service import Robot, RobotService
from robot_agent.skewed_clock import skewed_clock
from sim.agenda import Action, Agenda
from sim.blackbox import BlackBox
from sim.failing_body import FailingBody
from sim.faults import Fault
from sim.inhabitant import Inhabitant
from sim.memory_transport import MemoryNetwork
from sim.run_logs import RunLogs
from sim.strikes import CoordinatorStrikes, Strikes, Struck
from sim.virtual_service import VirtualService

_STAGGER: Final = 3 * MILLISECOND
_BOOT: Final = 7
_COORDINATOR: Final = "coordinator"

PLANNING: Final = 300 * MILLISECOND
"""How long a plan takes to be found, in virtual time."""

EFFORT: Final = 5


@dataclass(frozen=True)
class Flaws:
    """How far clocks and bodies may be off; drawn for every robot, either way.

    drift_ppm: of clocks; gain: of wheels, as a share; noise [m]: of measured places, from 0.
    """

    drift_ppm: int = 0
    gain: float = 0.0
    noise: float = 0.0


NO_FLAWS: Final = Flaws()
USUAL_FLAWS: Final = Flaws(drift_ppm=45, gain=0.01, noise=0.001)


class World:
    """A proven plan, its robots, a link and what goes wrong, at times counted from the first GO.

    `freezes` is for tests alone: without it every FREEZE says GO instead, and nothing is planned.
    `effort`: of later plans; with `logs`, which the caller closes, the first one's too.
    """

    def __init__(
        self,
        scenario: Scenario,
        document: PlanDocument,
        network: MemoryNetwork,
        *,
        seed: int = 0,
        faults: Sequence[Fault] = (),
        flaws: Flaws = NO_FLAWS,
        planning_ns: int = PLANNING,
        period_ns: int = PERIOD_NS,
        freezes: bool = True,
        effort: int = EFFORT,
        logs: RunLogs | None = None,
    ) -> None:
        mission = Mission(scenario, document, _BOOT, partial(_plan, effort))
        self.began_ns = 0
        self.struck: list[Struck] = []
        self._agenda = Agenda(SECOND)
        self._period_ns = period_ns
        self._network = network
        self.faults = tuple(faults)
        if logs is not None:
            logs.begin(first_head(scenario, document, boot=_BOOT, effort=effort))
        self.coordinator = VirtualService(
            mission, network, lambda: self.now_ns, planning_ns, logs=logs, freezes=freezes
        )
        chance = random.Random(seed)
        self.robots = {
            robot.id: self._inhabitant(robot, boot, flaws, chance)
            for boot, robot in enumerate(document.robots, start=1)
        }
        self._strikes = Strikes(
            self._agenda, network, self.robots, self.fleet.name, self._coordinator_strikes()
        )
        self._agenda.at(self.now_ns + COMMAND_PERIOD, self._tick_fleet)
        for index, robot in enumerate(self.robots.values()):
            self._agenda.at(self.now_ns + index * _STAGGER % period_ns, self._ticker(robot))

    @property
    def mission(self) -> Mission:
        """What the coordinator knows."""
        return self.coordinator.mission

    @property
    def fleet(self) -> Fleet:
        """The fleet core."""
        return self.coordinator.fleet

    @property
    def now_ns(self) -> int:
        """Virtual time, which is the coordinator's [ns]."""
        return self._agenda.now_ns

    def run(self, seconds: float) -> None:
        """Let time pass until the fleet is finished, at most `seconds`."""
        end_ns = self.now_ns + round(seconds * SECOND)
        while self.now_ns < end_ns and not self.fleet.is_finished:
            self.step()

    def go_on(self, seconds: float) -> None:
        """Let time pass whatever the fleet's state."""
        end_ns = self.now_ns + round(seconds * SECOND)
        while self.now_ns < end_ns:
            self.step()

    def step(self) -> None:
        """Jump to the next event: a delivery, a tick, a fault or the end of one."""
        due_ns, arriving_ns = self._agenda.next_ns(), self._network.next_due_ns()
        if arriving_ns is not None and arriving_ns < due_ns:
            due_ns = arriving_ns
        self._agenda.now_ns = max(due_ns, self.now_ns)
        self._network.advance(self.now_ns)
        if not self._strikes.coordinator_hangs:
            self.coordinator.take_arrivals()
        self._agenda.happen()

    def blackboxes(self) -> dict[str, BlackBox]:
        """Return what every robot truly did."""
        return {name: robot.blackbox() for name, robot in self.robots.items()}

    def _inhabitant(
        self, plan: RobotPlan, boot: int, flaws: Flaws, chance: random.Random
    ) -> Inhabitant:
        accel = plan.limits.max_accel if plan.limits is not None else None
        ahead_ns = chance.randrange(-SECOND, SECOND)
        body = FailingBody(
            math.inf if accel is None else accel,
            wheel_gain=1.0 + chance.uniform(-flaws.gain, flaws.gain),
            noise=chance.uniform(0.0, flaws.noise),
            seed=boot,
        )
        drift_ppm = chance.randint(-flaws.drift_ppm, flaws.drift_ppm)
        clock = skewed_clock(lambda: self.now_ns, ahead_ns, drift_ppm)
        service = RobotService(
            Robot(plan.id, plan.radius),
            self._network.session(plan.id),
            body,
            self.fleet.name,
            lambda: self.now_ns,
            boot=boot,
            clock=clock,
            period_ns=self._period_ns,
        )
        return Inhabitant(service, body, clock)

    def _ticker(self, robot: Inhabitant) -> Action:
        def tick() -> int:
            robot.tick()
            if self.began_ns and self.now_ns >= self.began_ns:
                robot.note(self.now_ns - self.began_ns)
            return self.now_ns + self._period_ns

        return tick

    def _tick_fleet(self) -> int:
        if not self._strikes.coordinator_hangs:
            self._look()
        return self.now_ns + COMMAND_PERIOD

    def _look(self) -> None:
        """Let the coordinator look at the time; from its first GO on faults strike."""
        self.coordinator.look()
        if self.fleet.phase == GO and not self.began_ns:
            self.began_ns = self.fleet.times.start_ns
            for fault in self.faults:
                due_ns = self.began_ns + round(fault.time * SECOND)
                self._agenda.once(due_ns, partial(self._strike, fault))

    def _strike(self, fault: Fault) -> None:
        robot = self.robots.get(fault.robot)
        fleet = self.fleet
        works = robot is not None and not (robot.dead or robot.hung)
        has_part = works and fleet.members[fault.robot].planned
        phase = robot.service.agent.phase if robot is not None and has_part else -1
        self.struck.append(Struck(fault, self.now_ns, fleet.phase, phase, fleet.epoch))
        self._strikes.strike(fault)

    def _coordinator_strikes(self) -> CoordinatorStrikes:
        return CoordinatorStrikes(
            self._coordinator_back, self.coordinator.die, self.coordinator.come_back
        )

    def _coordinator_back(self) -> None:
        """Look at the time first, then at what has arrived meanwhile, as the service does."""
        self._look()
        self.coordinator.take_arrivals()


def _plan(effort: int, scenario: Scenario, epoch: int) -> PlanDocument:
    return plan_scenario(scenario, effort=effort, epoch=epoch)
