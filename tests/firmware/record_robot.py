"""Records a robot of robot_agent/ under examination, for another one to do the same."""

from __future__ import annotations

import struct

from robot_agent.service import RobotService
from tests.coordinator.conformance.rooms import examine


def record_robot(names=()) -> list[str]:
    """The lines of a record (micropython_replay.py) of the exchanges whose names begin so."""
    lines: list[str] = []

    class Recorded(RobotService):
        def __init__(self, robot, transport, *args, **options):
            super().__init__(robot, transport, *args, **options)
            put, tick = transport.put, self.agent.tick

            def noted_put(key, payload):
                lines.append(f"S {key.split('/')[2]} {payload.hex()}")
                put(key, payload)

            def noted_tick(now_ns, *pose):
                lines.append(f"T {now_ns} {digits(*pose)}")
                tick(now_ns, *pose)

            transport.put, self.agent.tick = noted_put, noted_tick

        def _enqueue(self, key, payload, sent_ns):
            lines.append(f"H {self._clock()} {key.split('/')[2]} {payload.hex()}")
            super()._enqueue(key, payload, sent_ns)

        def tick(self, now_ns):
            going, agent = super().tick(now_ns), self.agent
            speed, distance = agent.drive_speed, agent.drive_distance
            commands = digits(speed, agent.drive_curvature, distance, agent.drive_turn)
            lines.append(f"D {agent.phase} {commands}")
            return going

    assert examine(Recorded, names).conforms
    return lines


def digits(*numbers: float) -> str:
    return " ".join(struct.pack(">d", float(number)).hex() for number in numbers)
