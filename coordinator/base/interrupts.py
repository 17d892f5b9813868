"""Ctrl-C and SIGTERM: what a process does when it is asked to end.

While the process starts, there is nothing to close, and a request ends it at once.  While a command
runs, the first request raises KeyboardInterrupt and further ones are ignored, so that they do not
cut the clean-up short.  After the command has finished, requests are ignored.

Decides: the effect of a request to end at each stage.  Must not know: what there is to close.  This
module is imported before all others, so it imports little.
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
    """State: whether a request was raised, whether requests are held back, whether one waits."""

    asked = False
    held = False
    waiting = False


def leave_at_once() -> None:
    """End the process without any clean-up on every request from now on."""
    _answer(lambda _number, _frame: os._exit(INTERRUPTED))


def listen() -> None:
    """Raise KeyboardInterrupt in the main thread on the first request from now on."""
    sys.unraisablehook = _missed
    _answer(_interrupt)


def stop_listening() -> None:
    """Ignore requests from now on: the command has finished."""
    _answer(_ignore)
    for number in _REQUESTS:  # the interpreter removes Python handlers when it shuts down
        signal.signal(number, signal.SIG_IGN)
    # After an interrupt has passed through exec(), Python ends as if SIGINT had killed it, whatever
    # the exit code, unless another exec() follows.
    exec("")


def was_asked() -> bool:
    """Return whether a request has raised KeyboardInterrupt."""
    return _Requests.asked


def is_interrupt(error: BaseException | None) -> bool:
    """Return whether an error is a KeyboardInterrupt, or a SystemError that one has caused.

    A compiled function in which KeyboardInterrupt is raised still returns a value; Python then
    raises a SystemError whose cause or context is the KeyboardInterrupt.
    """
    if isinstance(error, SystemError):
        return is_interrupt(error.__cause__ or error.__context__)
    return isinstance(error, KeyboardInterrupt)


@contextmanager
def held_back() -> Iterator[None]:
    """Delay requests until the end of the block.

    Requests do not reach processes started in the block until these call `listen` themselves.
    Enter the block in the main thread, or before `listen` has been called.
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
    """Install a handler for requests; it also gets one that came while they were blocked."""
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
    """Repeat an interrupt that was raised where Python swallows it, as in a destructor.

    After an interrupt, the destructors of half-initialized objects may fail; these errors are not
    reported.
    """
    if is_interrupt(missed.exc_value):
        listen()
        threading.Timer(_SOON_S, _thread.interrupt_main).start()
    elif not _Requests.asked:
        sys.__unraisablehook__(missed)


def _ignore(_number: int, _frame: FrameType | None) -> None:
    """Do nothing; SIG_IGN alone would make Python complain about a signal that is pending."""
