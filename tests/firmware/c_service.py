"""A robot of the virtual world that runs the C agent, over pipes (robot_agent/program.py)."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

from robot_agent.program import Program, ProgramService
from robot_agent.service import Robot


class CService(ProgramService):
    """One robot and its process; `agent` has the attributes that the world looks at."""

    def __init__(self, core: Path, *arguments, **options) -> None:
        self.program = Program(core)
        super().__init__(self.program, *arguments, **options)
        self.quiet_until_ns = 0  # Every tick is the C agent's.
        self.inbox = SimpleNamespace(waits=False)

    @property
    def agent(self):
        told = self.told
        return SimpleNamespace(
            phase=told.phase,
            ride=SimpleNamespace(follower=SimpleNamespace(s=told.place)),
            clock=SimpleNamespace(good=0),
        )

    def rest(self, _now_ns: int) -> bool:
        """Return that every tick has to be a whole one."""
        return False


class CRobots:
    """In place of World._service: robots of these names (all when empty) run the C agent."""

    def __init__(self, core: Path, names: tuple[str, ...] = ()) -> None:
        self.core, self.names = core, names
        self.services: list[CService] = []

    def wrap(self, usual):
        """Return a method for World that starts the C agent or the usual one."""

        def service(world, name, radius, body, boot, clock):
            if self.names and name not in self.names:
                return usual(world, name, radius, body, boot, clock)
            session = world._network.session(name)
            options = {"boot": boot, "clock": clock, "period_ns": world._period_ns}
            robot = Robot(name, radius)
            one = CService(self.core, robot, session, body, world.fleet.name, **options)
            self.services.append(one)
            return one

        return service

    def end(self) -> None:
        """End all processes; none may have stopped on undefined behaviour."""
        assert [one.program.close() for one in self.services] == [0] * len(self.services)
