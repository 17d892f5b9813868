"""What a microcontroller has to run may stand on nothing that it does not have."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FIRMWARE = (
    "robot_agent/agent.py",
    "robot_agent/ride.py",
    "robot_agent/transitions.py",
    "robot_agent/steering.py",
    "robot_agent/clock_sync.py",
    "protocol/curve.py",
    "protocol/timeline.py",
    "protocol/phases.py",
    "protocol/timing.py",
)
ALLOWED = {"math"} | {name.removesuffix(".py").replace("/", ".") for name in FIRMWARE}


@pytest.mark.parametrize("name", FIRMWARE)
def test_a_firmware_module_imports_only_math_and_other_firmware(name):
    imported = set()
    for node in ast.walk(ast.parse((ROOT / name).read_text())):
        if isinstance(node, ast.Import):
            imported |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0
            imported.add(node.module)
    assert imported <= ALLOWED


def test_only_the_loop_catches_every_exception():
    for path in sorted((ROOT / "robot_agent").glob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ExceptHandler):
                caught = ast.unparse(node.type) if node.type else ""
                broad = caught in ("", "Exception", "BaseException")
                assert not broad or path.name == "loop.py", path
