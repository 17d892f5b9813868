"""Ctrl-C and SIGTERM, wherever they fall."""

import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from coordinator.base import interrupts

PATIENCE_S = 10.0
SHORT_S = 0.05
ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture
def _listening(monkeypatch):
    before = {number: signal.getsignal(number) for number in interrupts._REQUESTS}
    monkeypatch.setattr(sys, "unraisablehook", sys.unraisablehook)
    monkeypatch.setattr(interrupts._Requests, "asked", False)
    interrupts.listen()
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


class Swallowing:
    """Asks to end where Python can only ignore what is raised."""

    def __del__(self):
        signal.raise_signal(signal.SIGINT)


class SwallowingForC(Swallowing):
    """Has the interrupt arrive as C code hands it on."""

    def __del__(self):
        try:
            super().__del__()
        except KeyboardInterrupt as error:
            raise SystemError("returned a result with an exception set") from error


@pytest.mark.usefixtures("_listening")
@pytest.mark.parametrize("kind", [Swallowing, SwallowingForC])
def test_an_interrupt_that_python_swallows_comes_again(kind):
    swallowing = [kind()]
    swallowing.clear()
    with pytest.raises(KeyboardInterrupt):
        _wait()


def _wait():
    """Wait in short stretches: an interrupt that comes again cuts none of them short."""
    for _ in range(round(PATIENCE_S / SHORT_S)):
        threading.Event().wait(SHORT_S)


@pytest.mark.usefixtures("_listening")
def test_a_second_request_to_end_does_not_cut_the_closing_short():
    with pytest.raises(KeyboardInterrupt):
        signal.raise_signal(signal.SIGTERM)
    signal.raise_signal(signal.SIGINT)
    signal.raise_signal(signal.SIGTERM)


@pytest.mark.usefixtures("_listening")
def test_other_errors_that_python_swallows_are_told_as_ever(capsys):
    class Failing:
        def __del__(self):
            raise OSError("lost")

    failing = Failing()
    del failing
    assert "OSError: lost" in capsys.readouterr().err


@pytest.mark.usefixtures("_listening")
@pytest.mark.parametrize("thread", [False, True])
def test_a_request_that_is_held_back_comes_when_the_block_ends(thread):
    done = []

    def work():
        with interrupts.held_back():
            _receive_in_a_thread() if thread else os.kill(os.getpid(), signal.SIGINT)
            done.append("everything")

    with pytest.raises(KeyboardInterrupt):
        work()
    assert done == ["everything"]


def _receive_in_a_thread():
    """Have another thread receive the signal, as may happen: what is masked is a thread's own."""

    def receive():
        signal.pthread_sigmask(signal.SIG_UNBLOCK, interrupts._REQUESTS)
        signal.raise_signal(signal.SIGINT)

    answer = threading.Thread(target=receive)
    answer.start()
    answer.join()


def test_a_process_that_starts_is_not_reached_before_it_listens():
    with interrupts.held_back():
        process = subprocess.Popen(
            [sys.executable, "-c", "input(); import splinefleet; splinefleet.main()", "--help"],
            cwd=ROOT,
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
        )
    process.send_signal(signal.SIGINT)
    assert process.communicate(b"\n", timeout=60.0) == (None, b"")
    assert process.returncode == 130


PROGRAM = """
import atexit, ctypes, signal, sys
import splinefleet

{}
splinefleet._gathered = lambda: command
splinefleet.main()
"""

IN_A_KERNEL = """
import numba, numpy

end = getattr(ctypes.CDLL(None), "raise")
end.argtypes = [ctypes.c_int]
ending = int(signal.SIGINT)

@numba.njit(nogil=True)
def kernel(numbers):
    end(ending)
    return 1.0, numbers.copy()

kernel.compile("(float64[::1],)")

def command(**_):
    kernel(numpy.zeros(3))
"""

IN_PYTHON = """
def command(**_):
    signal.raise_signal(signal.SIGINT)
"""

IN_EXEC = """
def command(**_):
    exec("signal.raise_signal(signal.SIGINT)")
"""

IN_A_CONSTRUCTOR = """
class HalfMade:
    def __init__(self):
        signal.raise_signal(signal.SIGINT)
        self.whole = True

    def __del__(self):
        assert self.whole

def command(**_):
    HalfMade()
"""

WHEN_DONE = """
def command(**_):
    atexit.register(signal.raise_signal, signal.SIGINT)
"""

CLOSING_FAILS = """
def command(**_):
    try:
        signal.raise_signal(signal.SIGINT)
    finally:
        raise RuntimeError("nothing is left")
"""

A_BUG = """
def command(**_):
    raise RuntimeError("nothing is left")
"""


@pytest.fixture
def run(tmp_path):
    """Run a program as a module and return its exit code and what it says on stderr."""

    def run_it(program, *arguments):
        (tmp_path / "program.py").write_text(program)
        done = subprocess.run(
            [sys.executable, "-m", "program", *arguments],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            timeout=60.0,
            env=os.environ | {"PYTHONPATH": str(ROOT)},
        )
        return done.returncode, done.stderr

    return run_it


@pytest.mark.parametrize(
    "where",
    [IN_PYTHON, IN_A_KERNEL, IN_EXEC, IN_A_CONSTRUCTOR],
    ids=["python", "kernel", "exec", "constructor"],
)
def test_a_command_that_is_interrupted_ends_with_130_and_says_nothing(run, where):
    assert run(PROGRAM.format(where)) == (130, "")


def test_a_request_after_the_command_changes_nothing(run):
    assert run(PROGRAM.format(WHEN_DONE)) == (0, "")


def test_what_fails_while_a_command_is_closed_is_told_in_a_line(run):
    told = "while ending: RuntimeError: nothing is left\n"
    assert run(PROGRAM.format(CLOSING_FAILS)) == (130, told)


def test_a_bug_that_nobody_asked_for_has_its_traceback(run):
    code, told = run(PROGRAM.format(A_BUG))
    assert code == 1
    assert told.startswith("Traceback")


IMPORTING = """
import signal, sys

asking = sys.argv.pop(1)


class Asking:
    def find_spec(self, name, path=None, target=None):
        if name == asking:
            signal.raise_signal(signal.SIGINT)


sys.meta_path.insert(0, Asking())
import splinefleet

splinefleet.main()
"""


@pytest.mark.parametrize(
    "module", ["typer", "msgspec", "rich.console", "numpy", "numba", "coordinator.planning.planner"]
)
def test_a_program_that_is_interrupted_while_it_imports_ends_with_130(run, module):
    assert run(IMPORTING, module, "plan", ROOT / "examples" / "paper_five.toml") == (130, "")
