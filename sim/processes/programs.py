"""The command lines of the programs of a run on this machine.

Decides: which options they are started with.  Must not know: processes, when they are started.
"""

from __future__ import annotations

import shlex
import sys
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Final

from coordinator.scenario.model import Robot
from protocol.key_files import KeyFiles, read_key_files

_COMMAND: Final = (sys.executable, "-m", "splinefleet")
_GIVE_UP_S: Final = 300.0
"""A robot ends when it has heard no coordinator for this long [s], even if this program is gone.
On a busy machine a coordinator that is started again takes a minute to be heard."""


class Programs:
    """The programs of a run in `folder`; with `keys`, a folder of keys, their links use TLS.

    `cores`: by robot, the program that decides in place of the agent's core.
    """

    def __init__(
        self,
        folder: Path,
        fleet: str,
        speed: float,
        effort: int,
        keys: Path | None,
        cores: Mapping[str, Path] = MappingProxyType({}),
    ) -> None:
        self._folder = folder
        self._fleet = fleet
        self._effort = effort
        self._keys = keys
        self._cores = cores
        self._both = [f"--speed={speed}", *([] if keys is None else [f"--keys={keys}"])]

    def endpoint(self, port: int) -> str:
        """Return the endpoint of a port of this machine."""
        return f"{'tcp' if self._keys is None else 'tls'}/127.0.0.1:{port}"

    def keys_of(self, robot: str) -> KeyFiles | None:
        """Return a robot's keys, if the run has any; TransportError when they are not usable."""
        return None if self._keys is None else read_key_files(self._keys, "robot", robot)

    def coordinator(self, *options: str) -> list[str]:
        """Return the command of a coordinator that prints its events as JSON lines.

        One of the options must state where it listens or connects.
        """
        return [*_COMMAND, *self._coordinator(*options), "--json"]

    def coordinator_for_people(self, *options: str) -> str:
        """Return the same command as a person types it: it prints lines, not JSON."""
        return shlex.join(["splinefleet", *self._coordinator(*options)])

    def way_back(self, robot: str, endpoint: str, pose: tuple[float, float, float]) -> str:
        """Return the commands that a person types to start a robot at a pose and to admit it."""
        reach = [robot, f"--connect={endpoint}", f"--fleet={self._fleet}"]
        place = [f"{number:.3f}" for number in pose]
        box = f"--blackbox={self._folder / 'blackbox' / f'{robot}.csv'}"
        agent = ["splinefleet", "agent", *reach, *self._both, box, "--at", *place]
        keys = [] if self._keys is None else [f"--keys={self._keys}"]
        admit = ["splinefleet", "admit", *reach, *keys]
        return f"`{shlex.join(agent)}`, then `{shlex.join(admit)}`"

    def _coordinator(self, *options: str) -> list[str]:
        scenario, effort = self._folder / "scenario.json", f"--effort={self._effort}"
        return ["coordinator", str(scenario), *options, *self._both, effort]

    def agent(self, robot: Robot, endpoint: str, faulty: bool) -> list[str]:
        """Return the command of a robot that reaches its coordinator at an endpoint."""
        return [
            *_COMMAND,
            "agent",
            robot.id,
            f"--connect={endpoint}",
            f"--fleet={self._fleet}",
            f"--radius={robot.radius}",
            f"--max-speed={robot.max_speed}",
            f"--max-accel={robot.max_accel}",
            f"--blackbox={self._folder / 'blackbox' / f'{robot.id}.csv'}",
            *self._both,
            f"--give-up={_GIVE_UP_S}",
            *(["--driver=sim.processes.scripted_body:FaultyBody"] if faulty else []),
            *([f"--core={self._cores[robot.id]}"] if robot.id in self._cores else []),
            "--quiet",
        ]
