import json
import os
import time
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

from coordinator.base.errors import InputError
from coordinator.cli.plan_commands import commands
from coordinator.scenario.checks import find_problems
from coordinator.scenario.model import MapPart
from coordinator.scenario_files.maps.map_reader import read_map
from coordinator.scenario_files.scenario_reader import (
    parse_scenario,
    read_scenario,
    scenario_to_json,
)

EXAMPLES = Path(__file__).resolve().parents[4] / "examples"
ROBOT = 'robots = [{id = "R1", start = [1, 1], goal = [7, 1], radius = 0.2, max_speed = 0.5}]\n'
GRID = "type octile\nheight 4\nwidth 8\nmap\n........\n...TT...\n........\n........\n"


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "maps").mkdir()
    (tmp_path / "maps" / "yard.map").write_text(GRID)
    return tmp_path


def scenario(folder, workspace, name="site.toml"):
    text = f"{ROBOT}[workspace]\n{workspace}\n"
    return parse_scenario(text.encode(), str(folder / name))


def test_the_maps_path_is_relative_to_the_scenario_and_its_extent_is_the_floor(folder):
    read = scenario(folder, 'map = "maps/yard.map"')
    assert read.workspace.boundary == ((0, 0), (8, 0), (8, 4), (0, 4))
    assert read.workspace.obstacles == (((3, 2), (5, 2), (5, 3), (3, 3)),)
    assert read.workspace.notes[0].startswith("map yard.map: 8 x 4 cells of 1 m, 1 obstacles")


def test_bounds_and_obstacles_of_the_scenario_add_to_the_map(folder):
    more = "bounds = [-1, -1, 8, 2]\nobstacles = [[[2, 0], [3, 0], [3, 0.5]]]"
    workspace = scenario(folder, f'map = "maps/yard.map"\n{more}').workspace
    assert workspace.boundary == ((-1, -1), (8, -1), (8, 2), (-1, 2))
    assert workspace.obstacles[0] == ((2, 0), (3, 0), (3, 0.5))
    assert len(workspace.obstacles) == 2


def test_a_scenario_once_read_needs_its_map_no_more(folder):
    read = scenario(folder, 'map = "maps/yard.map"')
    written = scenario_to_json(read)
    (folder / "maps" / "yard.map").unlink()
    assert parse_scenario(written, "elsewhere.json") == read


def test_robots_are_checked_against_the_map(folder):
    with pytest.raises(InputError) as caught:
        scenario(folder, 'map = "maps/yard.map"\nobstacles = [[[6, 0], [8, 0], [8, 2], [6, 2]]]')
    (problem,) = caught.value.problems
    assert "robots[0].goal: (7, 1) m is inside workspace.obstacles[0]" in problem


def test_an_obstacle_of_the_map_is_told_by_the_maps_file_and_its_nearest_place(folder):
    own = "obstacles = [[[1, 3], [2, 3], [2, 3.5]]]"
    near = ROBOT.replace("[7, 1]", "[5.125, 2.5]")
    text = f'{near}[workspace]\nmap = "maps/yard.map"\n{own}\n'
    for again in (False, True):
        with pytest.raises(InputError) as caught:
            parse_scenario(text.encode(), str(folder / "site.toml"))
        (problem,) = caught.value.problems
        assert "is 0.125 m from the obstacle of yard.map at (5.00, 2.50) m, radius" in problem
        if not again:
            # A scenario once read tells the same without its map.
            good = scenario(folder, f'map = "maps/yard.map"\n{own}')
            assert good.workspace.from_map == MapPart(file="yard.map", first=1)
            document = json.loads(scenario_to_json(good))
            document["robots"][0]["goal"] = [5.125, 2.5]
            text = json.dumps(document)
            (folder / "maps" / "yard.map").unlink()


def test_a_faulty_part_of_a_map_in_a_scenario_once_read_is_one_line(folder):
    written = json.loads(scenario_to_json(scenario(folder, 'map = "maps/yard.map"')))
    for part in ({"file": "a"}, 3, {"file": "a\nb", "first": 0}, {"file": "a", "first": -1}):
        written["workspace"]["from_map"] = part
        with pytest.raises(InputError, match=r"^a.json: workspace.from_map: is not the name of a"):
            parse_scenario(json.dumps(written).encode(), "a.json")


# Fault: (the workspace, words of the only line).
FAULTS = {
    "a map that is a number": ("map = 3", "workspace.map: 3 is not a text in quotes"),
    "a map of no name": ('map = ""', "workspace.map: '' is not a text in quotes"),
    "a map of no kind": ('map = "maps/yard.pgm"', ".pgm is not a known kind of map"),
    "a folder": ('map = "maps.map"', "workspace.map: maps.map: is not a file"),
    "a name with a nul": ('map = "a\\u0000.map"', "is not the name of a file"),
    "a layer without a map": ('bounds = [0, 0, 8, 4]\nlayer = "W"', "workspace.map is not given"),
    "a layer of a grid": ('map = "maps/yard.map"\nlayer = "W"', "layer is not for maps of kind"),
    "a cell of no size": ('map = "maps/yard.map"\ncell = 0', "workspace.cell: 0 m is below 0.001"),
    "an error below zero": ('map = "maps/yard.map"\nmap_error = -1', "map_error: -1 m is below 0"),
    "a note of two lines": ('bounds = [0, 0, 8, 4]\nnotes = ["a\\nb"]', "not a text of one line"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_one_line_and_names_the_field(folder, name):
    workspace, words = FAULTS[name]
    (folder / "maps.map").mkdir()
    with pytest.raises(InputError) as caught:
        scenario(folder, workspace)
    (problem,) = caught.value.problems
    assert problem.startswith(f"{folder / 'site.toml'}: workspace.")
    assert words in problem


def test_a_pipe_is_no_map(tmp_path):
    os.mkfifo(tmp_path / "pipe.map")
    with pytest.raises(InputError, match=r"pipe.map: is not a file"):
        read_map(tmp_path / "pipe.map")


@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("map_*.toml")), ids=lambda path: path.stem)
def test_the_example_maps_are_read_and_told_in_the_report(path):
    read = read_scenario(path)
    answer = CliRunner().invoke(commands, ["plan", str(path), "--json", "--effort", "0"])
    assert read.workspace.notes[0] in answer.stderr
    assert len(json.loads(answer.stdout)["workspace"]["obstacles"]) == len(read.workspace.obstacles)


def test_thousands_of_obstacles_of_a_cluttered_map_are_checked_quickly(tmp_path):
    dice = np.random.default_rng(3)
    cells = dice.random((400, 400)) < 0.05
    cells[:60, :60] = cells[-60:, -60:] = False
    Image.fromarray(np.where(cells, 0, 254).astype(np.uint8)).save(tmp_path / "site.png")
    (tmp_path / "site.yaml").write_text(
        "image: site.png\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\n"
        "occupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )
    text = ROBOT.replace("[1, 1]", "[1, 19]").replace("[7, 1]", "[19, 1]")
    text = f'{text}[workspace]\nmap = "site.yaml"\n'
    read = parse_scenario(text.encode(), str(tmp_path / "site.toml"))
    assert len(read.workspace.obstacles) > 5000
    begin = time.process_time()
    assert find_problems(read) == []
    assert time.process_time() - begin < 1.0
