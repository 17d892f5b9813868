"""How a robot's program detects that it reads the same clock as its coordinator.

Two programs read the same clock when they run on the same kernel in the same time namespace.  A
running coordinator binds an abstract Unix socket whose address contains its boot id; a robot that
can connect to this address shares the clock.  Such an address has no file, is not visible to other
machines, and is freed by the kernel when the process ends, however it ends.  Nothing is sent
through the socket, and nothing about it goes on the wire.

Only Linux has abstract addresses, and each network namespace has its own: on other systems, and
between containers, a robot does not detect that it shares the clock.  It never mistakes another
machine's clock for its own.

Decides: that address.  Must not know: which clock is read, and what the answer is used for.
"""

from __future__ import annotations

import os
import socket
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress


@contextmanager
def announce_clock(boot: int) -> Iterator[None]:
    """Let robots on this machine find out that they share the clock of the coordinator `boot`.

    If the system has no abstract addresses they do not find out, which does no harm.
    """
    with ExitStack() as stack:
        with suppress(OSError):
            stack.enter_context(_socket()).bind(_address(boot))
        yield


def shares_clock(boot: int) -> bool:
    """Return whether the coordinator `boot` is running on this machine, on the same clock."""
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
    """Return the address; it names the time namespace, because their clocks differ."""
    try:
        times = os.stat("/proc/self/ns/time").st_ino
    except OSError:  # This kernel has no time namespaces.
        times = 0
    return f"\0splinefleet/clock/{times}/{boot}"
