"""A robot hears a record again and must do the same; runs in MicroPython and in CPython.

The record's lines: `H time kind bytes` (heard), `T time x y heading` (a tick at that pose), `S kind
bytes` (said in that tick) and `D phase speed curvature distance turn` (what it then commands).
Floats are the hexadecimal digits of their eight bytes.
"""

import gc
import sys
from binascii import hexlify, unhexlify
from struct import pack, unpack


def number(text):
    return unpack(">d", unhexlify(text))[0]


def shown(agent):
    """What a robot commands, as in the record."""
    values = agent.drive_speed, agent.drive_curvature, agent.drive_distance, agent.drive_turn
    numbers = [hexlify(pack(">d", float(value))).decode() for value in values]
    return " ".join([str(agent.phase)] + numbers)  # noqa: RUF005


def replay(robot_class, path, measure=False):
    """How many ticks agreed, or the first difference in words.

    With `measure` also the mean garbage [bytes] of a tick that hears nothing.
    """
    said = []
    robot = robot_class("R1", lambda *put: said.append(put), 7, (0.15, 0.5, 0.5))
    ticks = expected = quiet = garbage = 0
    heard = False
    with open(path) as record:
        for line in record:
            what, *words = line.split()
            if what == "H":
                heard = True
                payload = unhexlify(words[2]) if len(words) > 2 else b""
                robot.hear(words[1], payload, int(words[0]))
            elif what == "T":
                now_ns = int(words[0])
                x, y, heading = map(number, words[1:])
                said.clear()
                before = allocated() if measure else 0
                robot.tick(now_ns, x, y, heading)
                if measure and not heard:
                    quiet, garbage = quiet + 1, garbage + gc.mem_alloc() - before
                ticks, expected, heard = ticks + 1, 0, False
            elif what == "S":
                mine = said[expected] if expected < len(said) else None
                if mine != (words[0], unhexlify(words[1])):
                    return f"tick {ticks} says {mine}, not {line}"
                expected += 1
            elif shown(robot.agent) != " ".join(words) or expected != len(said):
                return f"tick {ticks} commands {shown(robot.agent)} and says {said}, not {line}"
    return f"{ticks} ticks, {garbage // max(quiet, 1)} bytes"


def allocated():
    gc.collect()
    return gc.mem_alloc()


if __name__ == "__main__":
    from splinefleet_robot import Robot

    if len(sys.argv) > 2:
        gc.disable()
    print(replay(Robot, sys.argv[1], len(sys.argv) > 2))  # noqa: T201
