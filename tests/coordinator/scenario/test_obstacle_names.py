"""Obstacles outside the floor are noted, once, and change nothing."""

import json

import pytest
from typer.testing import CliRunner

from coordinator.cli.plan_commands import commands
from coordinator.scenario.model import MapPart
from coordinator.scenario.obstacle_names import note_outside
from coordinator.scenario_files.scenario_reader import parse_scenario, scenario_to_json
from tests.floors import box

FLOOR = box(0, 0, 10, 8)
INSIDE, ACROSS, TOUCHING = box(3, 3, 4, 4), box(9, 3, 12, 4), box(10, 3, 12, 4)
OUT = [box(20 + 2 * i, 3, 21 + 2 * i, 4) for i in range(7)]


@pytest.mark.parametrize(
    ("obstacles", "part", "note"),
    [
        ([INSIDE, ACROSS, TOUCHING, ()], None, ""),
        ([], None, ""),
        ([INSIDE, OUT[0]], None, "1 obstacle lies wholly outside the floor, without effect: W1"),
        (
            [OUT[0], INSIDE, OUT[1]],
            None,
            "2 obstacles lie wholly outside the floor, without effect: W0, W2",
        ),
        (
            OUT,
            None,
            "7 obstacles lie wholly outside the floor, without effect: W0, W1, W2, W3, 3 more",
        ),
        (OUT, 2, "7 obstacles lie wholly outside the floor, without effect: W0, W1, 5 of a.map"),
        (OUT, 0, "7 obstacles lie wholly outside the floor, without effect: 7 of a.map"),
    ],
)
def test_what_lies_wholly_outside_is_named(obstacles, part, note):
    brought = None if part is None else MapPart(file="a.map", first=part)
    for index in range(4):
        note = note.replace(f"W{index}", f"workspace.obstacles[{index}]")
    assert note_outside(FLOOR, obstacles, brought) == note


def test_a_round_floor_has_corners_of_its_box_outside():
    assert "1 obstacle lies" in note_outside([(0, 0), (8, 0), (0, 8)], [box(6, 6, 7, 7)], None)


def test_the_plan_tells_of_an_obstacle_outside_once_and_is_the_same_without_it(tmp_path):
    text = {
        "workspace": {"bounds": [0, 0, 10, 8], "obstacles": [OUT[0]]},
        "robots": [{"id": "R1", "start": [1, 1], "goal": [9, 7], "radius": 0.2, "max_speed": 0.5}],
    }
    read = parse_scenario(json.dumps(text).encode(), "a.json")
    (note,) = read.workspace.notes
    assert parse_scenario(scenario_to_json(read), "a.json") == read
    plans = []
    for obstacles in ([OUT[0]], []):
        text["workspace"]["obstacles"] = obstacles
        (tmp_path / "a.json").write_text(json.dumps(text))
        answer = CliRunner().invoke(
            commands, ["plan", str(tmp_path / "a.json"), "--json", "--effort", "0"]
        )
        plans.append(json.loads(answer.stdout))
        assert (note in answer.stderr) == bool(obstacles)
    assert plans[0]["notes"] == [note]
    assert plans[0]["robots"] == plans[1]["robots"]
