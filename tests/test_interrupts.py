"""Ctrl-C and SIGTERM, wherever they fall."""

import signal
import sys
import threading

import pytest

import splinefleet

PATIENCE_S = 10.0


@pytest.fixture(autouse=True)
def _handlers(monkeypatch):
    before = {number: signal.getsignal(number) for number in splinefleet._ENDING}
    monkeypatch.setattr(sys, "unraisablehook", splinefleet._missed)
    splinefleet._listen()
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


class Swallowing:
    """Asks to end where Python can only ignore what is raised."""

    def __del__(self):
        signal.raise_signal(signal.SIGINT)


def test_an_interrupt_that_python_swallows_comes_again():
    swallowing = [Swallowing()]
    swallowing.clear()
    with pytest.raises(KeyboardInterrupt):
        threading.Event().wait(PATIENCE_S)


def test_a_second_request_to_end_does_not_cut_the_closing_short():
    with pytest.raises(KeyboardInterrupt):
        signal.raise_signal(signal.SIGTERM)
    signal.raise_signal(signal.SIGINT)
    signal.raise_signal(signal.SIGTERM)


def test_other_errors_that_python_swallows_are_told_as_ever(capsys):
    class Failing:
        def __del__(self):
            raise OSError("lost")

    failing = Failing()
    del failing
    assert "OSError: lost" in capsys.readouterr().err
