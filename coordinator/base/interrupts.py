"""Ctrl-C and SIGTERM: what a process does when it is asked to end.

While it starts there is nothing to close, and it ends at once.  While a command runs, the first
request raises KeyboardInterrupt and further ones are ignored, so that closing is not cut short.
Afterwards a request comes too late to matter.

Decides: what a request to end does at which time.  Must not know: what there is to close.  It is
imported before everything else, so it imports little.
"""

from __future__ import annotations

import _thread
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Final

INTERRUPTED: Final = 130
"""The exit code of a process that was asked to end."""

_REQUESTS: Final = (signal.SIGINT, signal.SIGTERM)

_SOON_S: Final = 0.02


class _Requests:
    """Whether the process was asked to end, and whether that has to wait."""

    asked = False
    held = False
    waiting = False


def leave_at_once() -> None:
    """From now on a request ends the process, without anything being closed."""
    _answer(lambda _number, _frame: os._exit(INTERRUPTED))


def listen() -> None:
    """From now on the first request raises KeyboardInterrupt in the main thread."""
    sys.unraisablehook = _missed
    _answer(_interrupt)


def stop_listening() -> None:
    """From now on a request does nothing: what there was to do is done."""
    _answer(_ignore)
    for number in _REQUESTS:  # the interpreter, when it ends, takes its own handlers away
        signal.signal(number, signal.SIG_IGN)
    # An interrupt that passed through exec() has Python end as if SIGINT had killed it, whatever
    # the exit code, unless another exec() comes after.
    exec("")


def was_asked() -> bool:
    """Tell whether a request has raised KeyboardInterrupt."""
    return _Requests.asked


def is_interrupt(error: BaseException | None) -> bool:
    """Tell whether an error is KeyboardInterrupt, or what C code has made of one.

    A compiled function in which it is raised returns all the same; Python then raises a
    SystemError that has it for its cause.
    """
    if isinstance(error, SystemError):
        return is_interrupt(error.__cause__ or error.__context__)
    return isinstance(error, KeyboardInterrupt)


@contextmanager
def held_back() -> Iterator[None]:
    """Let requests wait until the end of the block.

    Processes that are started in the block are not reached by requests before they listen
    themselves.  To be entered by the main thread, or before anybody listens.
    """
    before = signal.pthread_sigmask(signal.SIG_BLOCK, _REQUESTS)
    _Requests.held = True  # other threads may still receive a signal for the main thread
    try:
        yield
    finally:
        _Requests.held = False
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        if _Requests.waiting:
            _Requests.waiting = False
            signal.raise_signal(signal.SIGINT)


def _answer(handler: Callable[[int, FrameType | None], object]) -> None:
    """Answer requests from now on, those too that have come while they were held back."""
    for number in _REQUESTS:
        signal.signal(number, handler)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, _REQUESTS)


def _interrupt(_number: int, _frame: FrameType | None) -> None:
    """Interrupt the program, once."""
    if _Requests.held:
        _Requests.waiting = True
        return
    _answer(_ignore)
    _Requests.asked = True
    raise KeyboardInterrupt


def _missed(missed: sys.UnraisableHookArgs) -> None:
    """Interrupt again when the interrupt fell where Python swallows it, as in a destructor.

    Objects that an interrupt has left half made may fail in theirs; nothing is said about those.
    """
    if is_interrupt(missed.exc_value):
        listen()
        threading.Timer(_SOON_S, _thread.interrupt_main).start()
    elif not _Requests.asked:
        sys.__unraisablehook__(missed)


def _ignore(_number: int, _frame: FrameType | None) -> None:
    """Do nothing; SIG_IGN alone would make Python complain about a signal that is pending."""
