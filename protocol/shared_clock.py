"""How a robot's program knows that it reads the same clock as its coordinator.

It does when one kernel runs both, and one time namespace of that kernel.  A running coordinator
holds a name in its kernel, made of its boot id; a robot that finds the name there shares the clock.
The name is the address of an abstract Unix socket: no file stands for it, no other machine has it,
and the kernel frees it when the process ends, however it ends.  Nothing is sent through the socket,
and nothing about it goes on the wire.

Linux alone has such names, one set for each network namespace: on other systems, and between
containers, a robot does not learn that it shares the clock.  It never takes another machine's clock
for its own.

Decides: that name.  Must not know: which clock is read, and what the answer is used for.
"""

from __future__ import annotations

import os
import socket
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress


@contextmanager
def announce_clock(boot: int) -> Iterator[None]:
    """Let robots on this machine learn that they share the clock of the coordinator `boot`.

    Where the system has no such names they do not learn it, which stops neither side.
    """
    with ExitStack() as stack:
        with suppress(OSError):
            stack.enter_context(_socket()).bind(_address(boot))
        yield


def shares_clock(boot: int) -> bool:
    """Tell whether the coordinator `boot` is running on this machine, on the same clock."""
    if sys.platform != "linux":
        return False
    try:
        with _socket() as probe:
            probe.connect(_address(boot))
    except OSError:
        return False
    return True


def _socket() -> socket.socket:
    return socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)


def _address(boot: int) -> str:
    """Return the name; it tells time namespaces apart, whose clocks differ."""
    try:
        times = os.stat("/proc/self/ns/time").st_ino
    except OSError:  # This kernel has no time namespaces.
        times = 0
    return f"\0splinefleet/clock/{times}/{boot}"
