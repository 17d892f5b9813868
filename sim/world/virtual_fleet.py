"""A fleet in virtual time: unmodified fleet core and robot services on the in-memory link.

Decides: in which order coordinator, robots and link are called as virtual time passes, and how they
are put together; the effects of faults are in strikes.py.  Nothing here waits: time jumps from one
event to the next, so a minute of a fleet takes a fraction of a second.  The same seed gives the
same run.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Final, NamedTuple

from coordinator.fleet.core import Fleet
from coordinator.log.head import first_head
from coordinator.mission.mission import Mission
from coordinator.mission.mission_driver import CHECKPOINT_BYTES
from coordinator.plan.document import PlanDocument, RobotPlan
from coordinator.plan.wire import PackedPlan, packed
from coordinator.planning.planner import DEFAULT_EFFORT, plan_fleet
from coordinator.scenario.model import Scenario
from protocol.phases import GO
from protocol.timing import COMMAND_PERIOD, MILLISECOND, SECOND
from robot_agent.driver import Pose
from robot_agent.loop import PERIOD_NS
from robot_agent.service import Robot, RobotService
from robot_agent.steady_clock import SteadyClock
from sim.judging.blackbox import BlackBox
from sim.world.agenda import Action, Agenda
from sim.world.failing_body import FailingBody
from sim.world.fault_text import Fault
from sim.world.inhabitant import Inhabitant
from sim.world.memory_transport import MemoryNetwork
from sim.world.robot_clock import RobotClock
from sim.world.run_logs import RunLogs
from sim.world.strikes import CoordinatorStrikes, Strikes, Struck
from sim.world.virtual_service import VirtualService

_STAGGER: Final = 3 * MILLISECOND
_BOOT: Final = 7
_BOOTS: Final = 100_000
"""How far apart the boot ids of a robot's programs are; more than there are robots."""

PLANNING: Final = 300 * MILLISECOND
"""How long finding a plan takes, in virtual time."""


@dataclass(frozen=True)
class Flaws:
    """The greatest errors of clocks and bodies; each robot's are random, of either sign.

    drift_ppm: drift of clocks; gain: error of the wheels, as a share; noise [m]: of measured
    positions, never negative.
    """

    drift_ppm: int = 0
    gain: float = 0.0
    noise: float = 0.0


NO_FLAWS: Final = Flaws()
USUAL_FLAWS: Final = Flaws(drift_ppm=45, gain=0.01, noise=0.001)


class Past(NamedTuple):
    """The state from which a world continues: the mission, and when virtual time begins [ns].

    began_ns: the time of the first GO; boots: the boot ids of the robots, where they are known.
    """

    mission: Mission
    begin_ns: int
    began_ns: int
    boots: Mapping[str, int]


class World:
    """A proven plan, its robots, a link, and faults at times counted from the first GO.

    `authority` is for tests alone: without it Commands let robots drive as far as their plans go.
    `row_period_ns` is the time between two rows of a black box; by default there is one per tick.
    `effort` is the planning effort of all plans, the first one included; it is recorded in `logs`,
    which the caller closes.  In a world with a `past` the coordinator sends nothing before
    `take_over`, and the logs must be open already.  `checkpoint_bytes` as for MissionDriver.
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
        row_period_ns: int = 1,
        authority: bool = True,
        effort: int = DEFAULT_EFFORT,
        logs: RunLogs | None = None,
        past: Past | None = None,
        stays: bool = False,
        checkpoint_bytes: int = CHECKPOINT_BYTES,
    ) -> None:
        if past is None:
            mission = Mission.of_plan(
                scenario, packed(document), _BOOT, partial(_plan, effort), stays=stays
            )
            past = Past(mission, SECOND, 0, {})
            if logs is not None:
                logs.begin(first_head(scenario, document, boot=_BOOT, effort=effort, stays=stays))
        self.began_ns = past.began_ns
        self.struck: list[Struck] = []
        self._period_ns = period_ns
        self._row_period_ns = row_period_ns
        self.faults = tuple(faults)
        self.agenda = Agenda(past.begin_ns)
        self._network = network
        self.coordinator = VirtualService(
            past.mission,
            network,
            lambda: self.now_ns,
            planning_ns,
            logs=logs,
            authority=authority,
            checkpoint_bytes=checkpoint_bytes,
        )
        if not past.began_ns:
            self.coordinator.begin()
        chance = random.Random(seed)
        self.robots = {
            robot.id: self._inhabitant(
                robot.id,
                robot.radius,
                _accel(robot),
                past.boots.get(robot.id, boot),
                flaws,
                chance,
            )
            for boot, robot in enumerate(document.robots, start=1)
        }
        self._strikes = Strikes(
            self.agenda,
            network,
            self.robots,
            self.fleet.name,
            self._coordinator_strikes(),
            self._start_again,
        )
        self.agenda.at(self.now_ns + COMMAND_PERIOD, self._tick_fleet)
        at_once: dict[int, list[Inhabitant]] = {}
        for index, robot in enumerate(self.robots.values()):
            at_once.setdefault(index * _STAGGER % period_ns, []).append(robot)
        for later_ns, some in at_once.items():
            self.agenda.at(self.now_ns + later_ns, self._ticker(some))

    @property
    def mission(self) -> Mission:
        """The coordinator's mission."""
        return self.coordinator.mission

    @property
    def fleet(self) -> Fleet:
        """The fleet core."""
        return self.coordinator.fleet

    @property
    def now_ns(self) -> int:
        """Virtual time [ns], which the coordinator's clock shows."""
        return self.agenda.now_ns

    def run(self, seconds: float) -> None:
        """Let time pass until the fleet is finished, at most `seconds`."""
        agenda, coordinator = self.agenda, self.coordinator
        end_ns = agenda.now_ns + round(seconds * SECOND)
        while agenda.now_ns < end_ns and not coordinator.driver.mission.fleet.is_finished:
            self.step()
        self._wake_all()

    def go_on(self, seconds: float) -> None:
        """Let `seconds` pass, whether or not the fleet is finished."""
        agenda = self.agenda
        end_ns = agenda.now_ns + round(seconds * SECOND)
        while agenda.now_ns < end_ns:
            self.step()
        self._wake_all()

    def _wake_all(self) -> None:
        for robot in self.robots.values():
            robot.wake(self.agenda.now_ns)

    def step(self) -> None:
        """Jump to the next event: a delivery, a tick, a fault or the end of one."""
        agenda, network = self.agenda, self._network
        due_ns, arriving_ns = agenda.next_ns(), network.next_due_ns()
        if arriving_ns is not None and arriving_ns < due_ns:
            due_ns = arriving_ns
        if due_ns > agenda.now_ns:
            agenda.now_ns = due_ns
        network.advance(agenda.now_ns)
        if self.coordinator.has_arrivals and not self._strikes.coordinator_hangs:
            self.coordinator.take_arrivals()
        agenda.happen()

    def strike(self, fault: Fault) -> None:
        """Begin a fault now."""
        self._note_strike(fault)
        self._strikes.strike(fault)

    def take_over(self) -> None:
        """Start the coordinator of a world with a past; from now on faults begin when due."""
        self.coordinator.begin()
        self._expect_faults()

    def renew(self, name: str, boot: int, place: Pose | None) -> None:
        """Start a robot's program again, with its body and its estimated pose at `place`."""
        robot = self.robots[name]
        robot.wake(self.now_ns)
        if not robot.dead:
            self._network.drop(name)
        robot.dead = robot.hung = False
        robot.body.stop()
        if place is not None:
            robot.body.place(*place)
        radius = robot.service.robot.radius
        robot.run(self._service(name, radius, robot.body, boot, robot.clock))

    def _start_again(self, name: str) -> None:
        """Start another program of a robot where it stands, with a boot id of its own."""
        robot = self.robots[name]
        self.renew(name, robot.service.boot + _BOOTS, robot.body.true_pose())

    def add(self, name: str, radius: float, accel: float, boot: int) -> None:
        """Start the program of a robot that is not in the scenario, without flaws."""
        robot = self._inhabitant(name, radius, accel, boot, NO_FLAWS, random.Random(boot))
        self.robots[name] = robot
        self.agenda.at(self.now_ns, self._ticker([robot]))

    def blackboxes(self) -> dict[str, BlackBox]:
        """Return every robot's black box."""
        self._wake_all()
        return {name: robot.blackbox() for name, robot in self.robots.items()}

    def _inhabitant(
        self,
        name: str,
        radius: float,
        accel: float,
        boot: int,
        flaws: Flaws,
        chance: random.Random,
    ) -> Inhabitant:
        agenda = self.agenda

        def truth() -> int:
            return agenda.now_ns

        ahead_ns = chance.randrange(-SECOND, SECOND)
        body = FailingBody(
            accel,
            wheel_gain=1.0 + chance.uniform(-flaws.gain, flaws.gain),
            noise=chance.uniform(0.0, flaws.noise),
            seed=boot,
            clock=truth,
        )
        drift_ppm = chance.randint(-flaws.drift_ppm, flaws.drift_ppm)
        own_clock = RobotClock(truth, ahead_ns, drift_ppm)
        clock = SteadyClock(own_clock)
        service = self._service(name, radius, body, boot, clock)
        return Inhabitant(
            service,
            body,
            own_clock,
            clock,
            self._period_ns,
            row_period_ns=self._row_period_ns,
        )

    def _service(
        self, name: str, radius: float, body: FailingBody, boot: int, clock: Callable[[], int]
    ) -> RobotService:
        return RobotService(
            Robot(name, radius),
            self._network.session(name),
            body,
            self.fleet.name,
            boot=boot,
            clock=clock,
            period_ns=self._period_ns,
        )

    def _ticker(self, robots: Sequence[Inhabitant]) -> Action:
        """Return the action of robots that tick at the same times."""
        agenda, period_ns = self.agenda, self._period_ns

        def tick() -> int:
            now_ns, began_ns = agenda.now_ns, self.began_ns
            for robot in robots:
                robot.tick(now_ns, began_ns)
            return now_ns + period_ns

        return tick

    def _tick_fleet(self) -> int:
        if not self._strikes.coordinator_hangs:
            self._look()
        return self.now_ns + COMMAND_PERIOD

    def _look(self) -> None:
        """Let the coordinator look at the time; at its first GO, schedule the faults."""
        self.coordinator.look()
        if self.fleet.phase == GO and not self.began_ns:
            self.began_ns = self.fleet.times.start_ns
            self._expect_faults()

    def _expect_faults(self) -> None:
        for fault in self.faults:
            due_ns = self.began_ns + round(fault.time * SECOND)
            self.agenda.once(due_ns, partial(self.strike, fault))

    def _note_strike(self, fault: Fault) -> None:
        robot = self.robots.get(fault.robot)
        fleet = self.fleet
        works = robot is not None and not (robot.dead or robot.hung)
        has_part = works and fault.robot in fleet.members and fleet.members[fault.robot].planned
        phase = robot.service.agent.phase if robot is not None and has_part else -1
        self.struck.append(Struck(fault, self.now_ns, fleet.phase, phase, fleet.epoch))

    def _coordinator_strikes(self) -> CoordinatorStrikes:
        return CoordinatorStrikes(
            self._coordinator_back, self.coordinator.die, self.coordinator.come_back
        )

    def _coordinator_back(self) -> None:
        """Look at the time first, then at the messages that have arrived, as the service does."""
        self._look()
        self.coordinator.take_arrivals()


def _plan(effort: int, scenario: Scenario, epoch: int) -> PackedPlan:
    return plan_fleet(scenario, effort=effort, epoch=epoch)


def _accel(robot: RobotPlan) -> float:
    """Return a robot's greatest acceleration [m/s^2]; inf if its plan states none."""
    accel = robot.limits.max_accel if robot.limits is not None else None
    return math.inf if accel is None else accel
