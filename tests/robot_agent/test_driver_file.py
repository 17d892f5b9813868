"""Which driver `agent --driver` finds, and what it tells of one that it does not."""

import os
import sys

import pytest
from typer.testing import CliRunner

from robot_agent.commands import commands

BASE = """
import wheels_of_base
from sim.world.body import SimulatedBody

class Base(SimulatedBody):
    pass

class Arm:
    pass
"""


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """A folder with a driver, `our_base.py`, that imports a module beside it; it is the cwd."""
    (tmp_path / "our_base.py").write_text(BASE)
    (tmp_path / "wheels_of_base.py").write_text("WHEELS = 2\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    yield tmp_path
    for name in ("our_base", "wheels_of_base", "splinefleet_driver"):
        sys.modules.pop(name, None)


def told(driver):
    """What an agent with this driver tells; one that was found gets on to refusing its place."""
    words = ["R1", "--connect", "tcp/127.0.0.1:1", "--at", "nan", "0", "0", "--driver", driver]
    done = CliRunner().invoke(commands, words, env={"COLUMNS": "10000"})
    assert done.exit_code == 2
    assert "Traceback" not in done.output
    return done.output


@pytest.mark.parametrize("place", ["our_base.py", "./our_base.py", "{folder}/our_base.py"])
def test_a_driver_is_found_in_a_file_named_by_its_path(folder, place):
    assert "is not a place" in told(place.format(folder=folder) + ":Base")


def test_a_driver_is_found_in_a_file_of_another_folder_together_with_the_modules_beside_it(
    folder, monkeypatch
):
    (folder / "elsewhere").mkdir()
    monkeypatch.chdir(folder / "elsewhere")
    assert "is not a place" in told("../our_base.py:Base")


def test_a_driver_is_found_in_a_module_of_the_search_path(folder, monkeypatch):
    monkeypatch.syspath_prepend(folder)
    assert "is not a place" in told("our_base:Base")
    assert "is not a place" in told("sim.world.body:SimulatedBody")


def test_a_file_of_the_name_of_a_module_in_use_takes_its_place_for_nobody(folder):
    (folder / "json.py").write_text("from sim.world.body import SimulatedBody as Base\n")
    assert "is not a place" in told("json.py:Base")
    assert sys.modules["json"].__file__ != str(folder / "json.py")


def test_a_file_that_is_not_there_is_told_with_the_place_looked_at(folder):
    assert f"--driver: bases/our.py:Base: no file {folder}/bases/our.py" in line(
        "bases/our.py:Base"
    )


def test_a_module_that_is_not_there_is_told_with_the_places_looked_at():
    said = line("nowhere_base:Base")
    assert "no module nowhere_base in " in said
    assert all(place in said for place in sys.path if os.path.isdir(place))
    assert said.endswith("a file is named as in nowhere_base.py:Base")


def test_a_module_missing_in_a_package_is_told_with_the_packages_folder():
    import sim

    said = line("sim.nobody:Base")
    assert f"no module sim.nobody in {sim.__path__[0]};" in said


@pytest.mark.parametrize("place", ["our_base.py:Base", "our_base:Base"])
def test_a_driver_that_imports_what_is_not_there_says_so_and_where(folder, monkeypatch, place):
    monkeypatch.syspath_prepend(folder)
    (folder / "wheels_of_base.py").write_text("\n\nimport no_such_bus\n")
    said = line(place)
    assert f"{folder}/wheels_of_base.py, line 3: no module no_such_bus in " in said
    assert str(folder) in said.partition(" in ")[2]


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("from sim.world.body import Bodi\n", "line 1: ImportError: cannot import name 'Bodi'"),
        ("x = 1\nclass Base(\n", "line 2: SyntaxError: "),
        ("x = 1\ny = zz\n", "line 2: NameError: name 'zz' is not defined"),
        ("import sys\nsys.exit(3)\n", "line 2: SystemExit: 3"),
    ],
)
def test_a_driver_file_that_fails_says_at_which_line_and_why(folder, text, what):
    (folder / "our_base.py").write_text(text)
    assert f"{folder}/our_base.py, {what}" in line("our_base.py:Base")


def test_of_a_class_that_is_not_there_the_classes_that_are_get_told():
    assert "our_base.py:Bass: no Bass, it has SimulatedBody, Base, Arm" in line("our_base.py:Bass")
    said = line("sim.world.body:Body")
    assert "sim.world.body:Body: no Body, it has " in said
    assert "SimulatedBody" in said
    assert "no Base, it has no class" in line("wheels_of_base.py:Base")


@pytest.mark.parametrize("place", ["our_base", "our_base.py", ":Base", "our_base.py:", ""])
def test_a_driver_is_a_module_or_file_and_a_class(place):
    assert f"{place!r} is not MODULE:CLASS or FILE.py:CLASS" in line(place)


def test_what_is_no_driver_is_told_so():
    assert "our_base.py:Arm: Arm() takes no arguments" in line("our_base.py:Arm")
    assert "builtins:float is not a Driver" in line("builtins:float")


def line(driver):
    """The one line that the command line tells of a driver that does not work."""
    import splinefleet
    from coordinator.cli.usage import usage_line

    words = ["agent", "R1", "--connect", "tcp/127.0.0.1:1", "--driver", driver]
    done = CliRunner().invoke(splinefleet.app, words, standalone_mode=False)
    said = usage_line(done.exception)
    assert "\n" not in said
    assert said.startswith("--driver: ")
    return said
