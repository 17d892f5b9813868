"""Drivers named by their module or file, and what is said of those that are not there."""

import math
import sys

import pytest
from typer.testing import CliRunner

from robot_agent.driver_loading import NoDriverError, load_driver
from sim.body import SimulatedBody
from splinefleet import app

GOOD = """
from sim.body import SimulatedBody
from gears import RATIO

class Base(SimulatedBody):
    ratio = RATIO

class Other:
    def __init__(self, max_accel):
        pass

class Broken:
    def __init__(self, max_accel):
        raise OSError("no motor on can0")
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with a driver in a file, and one beside it that the driver imports."""
    (tmp_path / "wheels.py").write_text(GOOD)
    (tmp_path / "gears.py").write_text("RATIO = 5")
    (tmp_path / "bad.py").write_text("import no_such_library\n")
    (tmp_path / "typo.py").write_text("def x(:\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    before = set(sys.modules)
    yield tmp_path
    for name in set(sys.modules) - before:
        del sys.modules[name]


def test_a_module_names_a_driver():
    assert type(load_driver("sim.body:SimulatedBody", 0.5)) is SimulatedBody


@pytest.mark.parametrize("absolute", [False, True])
def test_a_file_names_a_driver_that_imports_what_lies_beside_it(folder, absolute):
    file = folder / "wheels.py" if absolute else "wheels.py"
    assert load_driver(f"{file}:Base", math.inf).ratio == 5


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("wheels.py", "wheels.py is neither MODULE:CLASS nor FILE.py:CLASS"),
        (":Base", ":Base is neither MODULE:CLASS nor FILE.py:CLASS"),
        ("absent.py:Base", "absent.py: there is no such file in {}"),
        ("wheels.py:Bse", "wheels.py has no Bse; it has Base, Other, Broken"),
        ("wheels.py:Other", "wheels.py:Other is no robot_agent.driver.Driver"),
        (
            "wheels.py:Broken",
            "wheels.py:Broken(inf) failed: OSError: no motor on can0 ({}/wheels.py, line 14)",
        ),
        (
            "bad.py:Base",
            "bad.py cannot be imported: "
            "ModuleNotFoundError: No module named 'no_such_library' ({}/bad.py, line 1)",
        ),
        (
            "typo.py:Base",
            "typo.py cannot be imported: SyntaxError: invalid syntax ({}/typo.py, line 1)",
        ),
    ],
)
def test_a_driver_that_cannot_be_had_is_told_with_what_was_looked_for_and_where(folder, name, said):
    with pytest.raises(NoDriverError) as caught:
        load_driver(name, math.inf)
    assert str(caught.value) == said.format(folder)


@pytest.mark.parametrize("missing", ["wheels", "robot_agent.wheels"])
def test_a_module_that_is_not_there_is_told_with_the_folders_that_were_looked_through(missing):
    with pytest.raises(NoDriverError) as caught:
        load_driver(f"{missing}:Base", math.inf)
    assert str(caught.value).startswith(f"there is no module {missing} in ")
    assert sys.path[-1] in str(caught.value)
    assert str(caught.value).endswith("and wheels.py:CLASS names a file")


@pytest.mark.usefixtures("folder")
def test_the_command_says_so_in_one_line_and_ends_with_2():
    result = CliRunner().invoke(
        app, ["agent", "R1", "--connect", "tcp/127.0.0.1:1", "--driver", "wheels.py:Bse"]
    )
    assert result.exit_code == 2
    assert "wheels.py has no Bse; it has Base, Other, Broken" in result.output
