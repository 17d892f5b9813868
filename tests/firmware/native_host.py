"""The events of firmware/examples/host.c, heard by the robot with a native core in MicroPython.

Prints the words of host.c, numbers as the hexadecimal digits of their eight bytes.  To measure, it
prints nothing but the mean garbage [bytes] of a tick that hears nothing.
"""
# ruff: noqa: RUF005, T201

import gc
from binascii import hexlify, unhexlify
from struct import pack


def number(text):
    """A number that C's %a wrote, or nan."""
    if text == "nan":
        return float(text)
    digits, power = text.split("p")
    sign, digits = (-1, digits[1:]) if digits[0] == "-" else (1, digits)
    whole, _, part = digits[2:].partition(".")
    return sign * int(whole + part, 16) * 2.0 ** (int(power) - 4 * len(part))


def shown(value):
    return hexlify(pack(">d", value)).decode()


def play(make, path, measure=False):
    robot, said, heard = None, [], True
    quiet = garbage = 0
    with open(path) as events:
        for line in events:
            kind, *words = line.split()
            if kind == "robot":
                limits = tuple([number(word) for word in words[1:4]])
                robot = make(words[0], lambda *put: said.append(put), int(words[5]), limits)
            elif kind == "failed":
                robot.hear_driver_error(int(words[0]))
            elif kind != "tick":
                heard = True
                robot.hear(kind, unhexlify(words[1]) if len(words) > 1 else b"", int(words[0]))
            else:
                now_ns, pose = int(words[0]), [number(word) for word in words[1:]]
                said.clear()
                if measure:
                    gc.collect()
                before = gc.mem_alloc()
                going = robot.tick(now_ns, *pose)
                if not heard:
                    quiet, garbage = quiet + 1, garbage + gc.mem_alloc() - before
                heard = False
                if not measure:
                    tell(robot, said, going)
    if measure:
        print(garbage // max(quiet, 1))


def tell(robot, said, going):
    for put in said:
        print(put[0], hexlify(put[1]).decode())
    drive = (robot.drive_speed, robot.drive_curvature, robot.drive_distance, robot.drive_turn)
    numbers = [shown(value) for value in drive + (robot.place,)]
    print("tick", robot.phase, robot.fault, *numbers, 0 if going else 1)
