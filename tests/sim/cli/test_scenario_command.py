"""The scenario command: files, formats, and one line for what cannot be made."""

import math

import pytest
import typer
from typer.testing import CliRunner

from coordinator.base.errors import InputError
from coordinator.scenario.checks import find_problems
from coordinator.scenario_files.scenario_reader import parse_scenario, scenario_to_json
from sim.cli.run_commands import commands
from sim.floors.generator import CROWDED, KINDS, generate
from sim.floors.layout import Kind


def ask(*arguments):
    return CliRunner().invoke(commands, ["scenario", *map(str, arguments)])


def test_the_command_writes_toml_json_or_to_stdout(tmp_path):
    expected = generate("rooms", 5, 9, (12.0, 10.0), headings=True, vias=1, mixed=True)
    asked = "--robots 5 --seed 9 --size 12 10 --headings --vias 1 --mixed"
    printed = ask("rooms", *asked.split())
    assert printed.exit_code == 0
    assert printed.stdout.startswith(f"# Made by: splinefleet scenario rooms {asked}\n")
    assert parse_scenario(printed.stdout.encode(), "stdout.toml") == expected
    for name in ("a.toml", "b.JSON"):
        made = ask("rooms", *asked.split(), "-o", tmp_path / name)
        assert made.exit_code == 0
        assert made.stdout == ""
        told = f"wrote {tmp_path / name}: rooms-5-9, 5 robots, "
        assert " ".join(made.stderr.split()).startswith(" ".join(told.split()))
    assert (tmp_path / "a.toml").read_bytes() == printed.stdout_bytes
    assert (tmp_path / "b.JSON").read_bytes() == scenario_to_json(expected)


def problem_of(*arguments):
    with pytest.raises(typer.TyperException) as caught:
        commands(["scenario", *map(str, arguments)], standalone_mode=False)
    (line,) = caught.value.format_message().splitlines()
    return line


@pytest.mark.parametrize(
    ("name", "nearest"), [("fly", "polygons"), ("warehose", "warehouse"), ("Maze", "maze")]
)
def test_an_unknown_kind_is_answered_in_one_line_with_the_nearest_and_the_list(name, nearest):
    line = problem_of(name)
    assert f"{name!r} is not a kind of floor, the nearest one is " in line
    assert name == "fly" or f"the nearest one is {nearest}; " in line
    assert line.endswith(f"the kinds are {', '.join([*KINDS, *CROWDED])}")


@pytest.mark.parametrize("name", ["hall", "hall.yaml", "hall.toml.txt"])
def test_a_scenario_goes_into_toml_or_json_and_nothing_else(tmp_path, name):
    assert f"{name} does not end in .toml or .json" in problem_of("open", "-o", tmp_path / name)
    assert list(tmp_path.iterdir()) == []


def test_no_folder_is_made_for_a_scenario(tmp_path):
    said = problem_of("open", "-o", tmp_path / "new" / "hall.toml")
    assert said.endswith(f"there is no folder {tmp_path / 'new'}")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ("circle --robots 10000 --mixed", "need a floor 9234 m long for circle, at most 8000 m"),
        ("maze --obstacles 4", "--obstacles: can be chosen for "),
        ("corridors --obstacles 99", "--obstacles: 99 walls do not fit, "),
        ("polygons --obstacles 9999 --size 5 5", "polygons fit on a floor of 5 m x 5 m"),
        ("u-traps --size 3 3", "--size: the floor is too small for traps"),
        ("ring --size 2 9", "--size: a ring needs more than"),
        ("circle --robots 40 --size 9 9", "40 do not fit around a floor of 9 m x 9 m, "),
        ("open --robots 1 --vias 20 --size 2 2", "--vias: a robot has room for"),
    ],
)
def test_what_cannot_be_made_is_told_in_one_line(arguments, said):
    result = ask(*arguments.split())
    assert isinstance(result.exception, InputError)
    (problem,) = result.exception.problems
    assert said in problem


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ("open --robots 20000", "'--robots': Input should be less than or equal to 10000"),
        ("open --size 5 0", "'--size': 5 m x 0 m is not from 1 m to 8000 m each way"),
        ("open --size nan 5", "'--size': nan m x 5 m is not from"),
    ],
)
def test_a_number_out_of_range_is_told_before_anything_is_made(arguments, said):
    assert said in problem_of(*arguments.split())


def test_all_that_cannot_be_made_is_told():
    with pytest.raises(InputError) as told:
        generate("bays", 0, 1, (-4.0, math.nan), obstacles=3, headings=True, vias=3)
    assert [one.partition(":")[0] for one in told.value.problems] == [
        "--robots",
        "--size",
        "--obstacles",
        "--headings",
        "--vias",
    ]


def test_too_many_robots_are_told_how_many_fit_and_those_do():
    with pytest.raises(InputError) as told:
        generate("open", 300, 1, (8.0, 8.0))
    fitting = int(str(told.value).split(", only ")[-1].removesuffix(" do"))
    assert 5 <= fitting < 40
    assert find_problems(generate("open", fitting, 1, (8.0, 8.0))) == []


def test_the_kinds_of_the_command_are_those_of_the_generator():
    assert (*KINDS, *CROWDED) == Kind.__args__
