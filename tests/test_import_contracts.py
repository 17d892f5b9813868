"""The import contracts hold, and each is broken by an import that it forbids."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("protocol", "coordinator", "robot_agent", "sim")

WHOLE = "Packages import only what stands below them"
ROOMS = "Rooms of the coordinator import only what stands below them"
RINGS = "No ring among modules, rooms or packages"
PURE = "Pure rooms know no event loop, link, thread, clock or log file, directly or not"
PROOF = "The proof shares nothing with what it judges, directly or not"


@pytest.fixture
def tree(tmp_path):
    """The packages and what is asked of them, in a copy."""
    ignored = shutil.ignore_patterns("__pycache__")
    for package in PACKAGES:
        shutil.copytree(ROOT / package, tmp_path / package, ignore=ignored)
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    return tmp_path


def broken(tree: Path) -> str:
    """Return what import-linter says of the contracts in a copy, in one line each."""
    program = "from importlinter.cli import lint_imports_command; lint_imports_command()"
    done = subprocess.run(
        [sys.executable, "-c", program, "--no-cache", "--no-logo"],
        cwd=tree,
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode in (0, 1), done.stderr
    return "\n".join(line for line in done.stdout.splitlines() if line.endswith("BROKEN"))


def test_the_contracts_hold(tree):
    assert broken(tree) == ""


@pytest.mark.parametrize(
    ("contract", "written"),
    [
        (WHOLE, {"robot_agent/odd.py": "import coordinator.base.errors"}),
        (WHOLE, {"coordinator/base/odd.py": "import sim.world"}),
        (ROOMS, {"coordinator/curves/odd.py": "import coordinator.schedule.track"}),
        (ROOMS, {"coordinator/attic/__init__.py": ""}),
        (
            PROOF,
            {
                "coordinator/proof/odd.py": "import coordinator.plan.odd",
                "coordinator/plan/odd.py": "import coordinator.schedule.track",
            },
        ),
        (
            PURE,
            {
                "coordinator/fleet/odd.py": "import coordinator.base.odd",
                "coordinator/base/odd.py": "import time",
            },
        ),
        (
            RINGS,
            {
                "coordinator/curves/odd.py": "import coordinator.curves.even",
                "coordinator/curves/even.py": "import coordinator.curves.odd",
            },
        ),
    ],
)
def test_a_wrong_import_breaks_its_contract(tree, contract, written):
    for name, text in written.items():
        file = tree / name
        file.parent.mkdir(exist_ok=True)
        file.write_text(f"{text}\n", encoding="utf-8")
    assert f"{contract} BROKEN" in broken(tree).splitlines()
