"""MovingAI benchmarks as scenarios: agents where their cells are, obstacles where cells block."""

import math

import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from coordinator.base.errors import InputError
from coordinator.exchange.movingai import Bodies, scenario_of
from coordinator.scenario_files.scenario_reader import read_scenario
from splinefleet import app

BODIES = Bodies(0.35, 1.0, 1.0, None, 0.05)
MAP = "type octile\nheight 3\nwidth 5\nmap\n..@..\n.TS.W\n.....\n"
SCEN = "version 1\n0\tm.map\t5\t3\t0\t0\t4\t0\t6\n0\tm.map\t5\t3\t1\t2\t3\t1\t3\n"


@pytest.fixture
def made(tmp_path):
    def make(scen=SCEN, grid=MAP, robots=None, cell=1.0, bodies=BODIES):
        (tmp_path / "m.map").write_bytes(grid.encode())
        (tmp_path / "m.scen").write_bytes(scen.encode())
        return scenario_of(tmp_path / "m.map", tmp_path / "m.scen", robots, cell, bodies, "m")

    return make


def problems_of(made, **asked):
    with pytest.raises(InputError) as caught:
        made(**asked)
    assert all(problem.isprintable() for problem in caught.value.problems)
    return list(caught.value.problems)


def test_agents_are_discs_at_the_centres_of_their_cells_and_y_points_upwards(made):
    scenario = made()
    assert [(robot.id, robot.start, robot.goal) for robot in scenario.robots] == [
        ("R1", (0.5, 2.5), (4.5, 2.5)),
        ("R2", (1.5, 0.5), (3.5, 1.5)),
    ]
    assert scenario.workspace.boundary == ((0.0, 0.0), (5.0, 0.0), (5.0, 3.0), (0.0, 3.0))
    # Cells that touch at a corner only are obstacles of their own.
    assert sorted(min(ring) for ring in scenario.workspace.obstacles) == [
        (1.0, 1.0),
        (2.0, 2.0),
        (4.0, 1.0),
    ]
    assert all(len(ring) == 4 for ring in scenario.workspace.obstacles)


def test_lengths_are_scaled_with_the_cell(made):
    robot = made(cell=0.5, bodies=BODIES._replace(margin=0.02)).robots[0]
    assert (robot.start, robot.goal, robot.radius) == ((0.25, 1.25), (2.25, 1.25), 0.175)


@pytest.mark.parametrize(
    "text",
    [
        SCEN.replace("version 1\n", ""),
        SCEN.replace("version 1", "Version 1.0"),
        SCEN.replace("\t", "  "),
        SCEN.replace("\n", "\r\n"),
        SCEN.replace("m.map", "maps of halls/m.map"),
        "\n" + SCEN.rstrip(),
        "﻿" + SCEN,
    ],
)
def test_forms_that_benchmarks_come_in_mean_the_same(made, text):
    assert made(text) == made()


def test_as_many_agents_are_taken_as_are_wanted(made):
    assert made(robots=1).robots == made().robots[:1]
    assert problems_of(made, robots=3) == ["m.scen: holds 2 agents, not 3"]


FAULTS = {
    "version 2": ("version 1", "line 1: 'version 2' is not 'version 1'"),
    "5\t4\t0\t0": ("5\t3\t0\t0", "line 2: is for a map of 5 x 4 cells, not 5 x 3"),
    "0\t0\t2\t0": ("0\t0\t4\t0", "line 2: goal 2, 0 is a blocked cell"),
    "0\t3\t4\t0": ("0\t0\t4\t0", "line 2: start 0, 3 is beside the map"),
    "1\t2\t-3\t1": ("1\t2\t3\t1", "line 3: goal x: '-3' is not a whole number"),
    "1\t2\t4\t0": ("1\t2\t3\t1", "line 3: goal 4, 0 is that of line 2, too"),
    "0\t0\t3\t1": ("1\t2\t3\t1", "line 3: start 0, 0 is that of line 2, too"),
    "1\t2": (
        "1\t2\t3\t1\t3",
        "line 3: 6 fields, not the 9 that are bucket, map, width, height, start x, start y, "
        "goal x, goal y, length",
    ),
}


@pytest.mark.parametrize("put", FAULTS)
def test_a_fault_is_told_with_its_line(made, put):
    gone, sentence = FAULTS[put]
    assert f"m.scen: {sentence}" in problems_of(made, scen=SCEN.replace(gone, put))


def test_all_faults_of_both_files_and_the_options_are_told_at_once(made):
    scen = SCEN.replace("4\t0\t6", "x\t0\t6").replace("1\t2\t3", "9\t2\t3")
    assert problems_of(made, scen=scen, bodies=BODIES._replace(tau=99.0)) == [
        "--tau: 99.0 s is above 60 s",
        "m.scen: line 2: goal x: 'x' is not a whole number",
        "m.scen: line 3: start 9, 2 is beside the map",
    ]
    assert problems_of(made, scen="", grid=MAP.replace(".TS", "?TS")) == [
        "m.map: line 6, column 1: '?' is not one of . G S @ O T W",
        "m.scen: holds 0 agents, not 1",
    ]


def test_discs_that_are_too_large_for_their_cells_are_told(made):
    problems = problems_of(made, bodies=BODIES._replace(radius=0.5))
    assert problems[0].startswith("m.scen: robots[0].start: (0.5, 2.5) m is 0.5 m from the edge")


CELLS = st.integers(1, 8).flatmap(
    lambda width: st.lists(
        st.text(alphabet=".GS@OTW", min_size=width, max_size=width), min_size=1, max_size=8
    )
)


@settings(derandomize=True, max_examples=100, deadline=None)
@given(rows=CELLS)
def test_obstacles_are_the_blocked_cells_and_nothing_else(tmp_path_factory, rows):
    folder = tmp_path_factory.getbasetemp()
    height, width = len(rows), len(rows[0])
    free = [(x, y) for y in range(height) for x in range(width) if rows[y][x] in ".GS"]
    text = f"type octile\nheight {height}\nwidth {width}\nmap\n" + "\n".join(rows) + "\n"
    (folder / "h.map").write_text(text)
    lines = [f"0 h.map {width} {height} {x} {y} {x} {y} 0" for x, y in free]
    (folder / "h.scen").write_text("\n".join(lines))
    if not free:
        return
    scenario = scenario_of(folder / "h.map", folder / "h.scen", None, 1.0, BODIES, "h")
    polygons = [shapely.Polygon(ring) for ring in scenario.workspace.obstacles]
    assert all(polygon.is_valid for polygon in polygons)
    blocked = shapely.union_all(polygons)
    assert math.isclose(blocked.area, width * height - len(free), abs_tol=1e-9)
    assert math.isclose(sum(polygon.area for polygon in polygons), blocked.area, abs_tol=1e-9)
    starts = {robot.start for robot in scenario.robots}
    for y in range(height):
        for x in range(width):
            centre = (x + 0.5, height - y - 0.5)
            assert (centre in starts) == (rows[y][x] in ".GS")
            assert blocked.covers(shapely.Point(centre)) == (rows[y][x] not in ".GS")


@pytest.mark.parametrize("command", [["import"], ["import", "movingai"]])
def test_the_command_writes_a_scenario_that_reads_back(tmp_path, made, command):
    expected = made()
    options = ["-o", str(tmp_path / "m.toml"), str(tmp_path / "m.map"), str(tmp_path / "m.scen")]
    done = CliRunner().invoke(app, [*command, *options])
    assert done.exit_code == 0, done.output
    read = read_scenario(tmp_path / "m.toml")
    assert (read.robots, read.workspace.obstacles) == (
        expected.robots,
        expected.workspace.obstacles,
    )


def test_the_command_gives_small_cells_a_small_margin(tmp_path, made):
    made()
    out = str(tmp_path / "m.json")
    options = ["--cell", "0.2", "--robots", "1", "--max-accel", "inf", "--tau", "0.5", "-o", out]
    files = [str(tmp_path / "m.map"), str(tmp_path / "m.scen")]
    done = CliRunner().invoke(app, ["import", *files, *options])
    assert done.exit_code == 0, done.output
    read = read_scenario(tmp_path / "m.json")
    assert (read.margin, read.tau) == (pytest.approx(0.01), 0.5)
    assert read.robots[0].max_accel == math.inf
