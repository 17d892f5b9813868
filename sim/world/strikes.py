"""The effects of faults on robots and the coordinator in virtual time.

Decides: what each kind of fault does from outside the robot's program, and when it ends.  Must not
know: plans, or how a fleet reacts.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Final, NamedTuple, TypeAlias

from protocol.timing import SECOND
from sim.world.agenda import Agenda
from sim.world.fault_text import Fault
from sim.world.inhabitant import Inhabitant
from sim.world.memory_transport import MemoryNetwork
from sim.world.random_traffic import RATE, noise

_Deed: TypeAlias = Callable[[str], None]

_BABBLE_NS: Final = round(SECOND / RATE)


@dataclass(frozen=True)
class Struck:
    """A fault that has happened: when, and the phases of the fleet and of its robot just before.

    `robot_phase` is -1 for a robot that had no part in the epoch or was no longer active, and for
    the coordinator.
    """

    fault: Fault
    now_ns: int
    fleet_phase: int
    robot_phase: int
    epoch: int


class CoordinatorStrikes(NamedTuple):
    """The callbacks for when the coordinator wakes from a hang, dies, and comes back."""

    wake: Callable[[], None]
    die: Callable[[], None]
    come_back: Callable[[], None]


class Strikes:
    """Applies faults to the robots of a world and to its coordinator.

    `start_again` starts a new program of a dead robot, where the robot stands.
    """

    def __init__(
        self,
        agenda: Agenda,
        network: MemoryNetwork,
        robots: Mapping[str, Inhabitant],
        fleet: str,
        coordinator: CoordinatorStrikes,
        start_again: Callable[[str], None],
    ) -> None:
        self._agenda = agenda
        self._network = network
        self._robots = robots
        self._fleet = fleet
        self._coordinator = coordinator
        self._until: dict[tuple[str, str], float] = {}
        self._babblers = 0
        self._lasting: Final[dict[str, tuple[_Deed, _Deed]]] = {
            "hang": (self._hang, self._wake),
            "restart": (self._kill, start_again),
            "stall": (self._stall, self._unstall),
            "cut": (network.cut, network.heal),
            "clock-pause": (self._pause, self._unpause),
        }

    @property
    def coordinator_hangs(self) -> bool:
        """Return whether the coordinator is inactive: it hangs or is dead."""
        if not self._until:
            return False
        return self._is_under("coordinator-hang", "") or self._is_under("coordinator-restart", "")

    def strike(self, fault: Fault) -> None:
        """Begin a fault; a fault of a dead robot is ignored."""
        if not fault.robot:
            self._strike_coordinator(fault)
            return
        robot, name = self._robots[fault.robot], fault.robot
        if robot.dead:
            return
        robot.wake(self._agenda.now_ns)
        if fault.kind == "kill":
            self._kill(name)
        elif fault.kind in self._lasting:
            begin, end = self._lasting[fault.kind]
            self._last(fault, partial(begin, name), partial(end, name))
        elif fault.kind == "clock-jump":
            robot.own_clock.set(round(fault.value * SECOND))
        elif fault.kind == "slow":
            robot.body.slow(fault.value)
        elif fault.kind == "skid" and robot.body.speed > 0.0:
            robot.body.skid(fault.value)
        elif fault.kind == "skid":
            return  # A base that stands still does not slip.
        elif fault.kind == "driver-error":
            robot.body.fail()
        elif fault.kind == "corrupt":
            self._babble(fault)
        else:
            raise ValueError(f"{fault.kind!r} is not a kind of fault in virtual time")

    def _strike_coordinator(self, fault: Fault) -> None:
        """Let the coordinator hang, or die and come back; a dead coordinator does not hang."""
        hang, restart = ("coordinator-hang", ""), ("coordinator-restart", "")
        if fault.kind == "coordinator-restart":
            self._until.pop(hang, None)
            begin = (lambda: None) if self._is_under(*restart) else self._coordinator.die
            self._last(fault, begin, self._coordinator.come_back)
        elif not self._is_under(*restart):
            self._last(fault, lambda: None, self._wake_coordinator)

    def _wake_coordinator(self) -> None:
        if not self.coordinator_hangs:
            self._coordinator.wake()

    def _last(self, fault: Fault, begin: Callable[[], None], end: Callable[[], None]) -> None:
        """Begin a fault and end it after its value [s].

        If faults of the same kind overlap, the latest end counts.
        """
        what = (fault.kind, fault.robot)
        over_ns = self._agenda.now_ns + fault.value * SECOND
        self._until[what] = max(over_ns, self._until.get(what, 0.0))
        begin()
        if over_ns < math.inf:
            due_ns = math.ceil(over_ns)
            self._agenda.once(due_ns, partial(self._end, what, end))

    def _end(self, what: tuple[str, str], end: Callable[[], None]) -> None:
        if self._is_under(*what):
            return
        if what[1]:
            self._robots[what[1]].wake(self._agenda.now_ns)
        end()

    def _is_under(self, kind: str, robot: str) -> bool:
        return self._agenda.now_ns < self._until.get((kind, robot), 0.0)

    def _kill(self, name: str) -> None:
        self._until.pop(("hang", name), None)
        self._robots[name].dead = True
        self._network.drop(name)

    def _hang(self, name: str) -> None:
        self._robots[name].hung = True
        self._network.hold(name)

    def _wake(self, name: str) -> None:
        if not any(self._is_under(kind, name) for kind in ("hang", "clock-pause")):
            self._robots[name].hung = False
            self._network.release(name)

    def _stall(self, name: str) -> None:
        self._robots[name].body.stall(True)

    def _unstall(self, name: str) -> None:
        self._robots[name].body.stall(False)

    def _pause(self, name: str) -> None:
        """Stop a robot's whole computer: its program and its clock."""
        self._hang(name)
        self._robots[name].own_clock.stop()

    def _unpause(self, name: str) -> None:
        self._robots[name].own_clock.go_on()
        self._wake(name)

    def _babble(self, fault: Fault) -> None:
        """Put random bytes on a robot's keys for a while."""
        self._babblers += 1
        session = self._network.session(f"babbler {self._babblers}")
        end_ns = self._agenda.now_ns + round(fault.value * SECOND)
        messages = noise(self._fleet, fault.robot, round(1000.0 * fault.time))

        def put() -> int:
            if self._agenda.now_ns >= end_ns:
                session.close()
                return 0
            session.put(*next(messages))
            return self._agenda.now_ns + _BABBLE_NS

        self._agenda.at(self._agenda.now_ns, put)
