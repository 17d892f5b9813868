"""What the README and the examples promise."""

import re
from pathlib import Path

import pytest

from coordinator.planning.planner import plan_scenario
from coordinator.scenario_files.scenario_reader import parse_scenario, read_scenario

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text()


def test_the_readme_opens_with_a_picture_and_the_two_commands():
    opening = README[:2000]
    picture = re.search(r"!\[.+\]\((.+?)\)", opening)
    assert (ROOT / picture[1]).exists()
    assert "make demo" in opening
    assert "make test" in opening


def test_the_scenario_of_the_readme_has_a_proven_plan():
    (text,) = re.findall(r"```toml\n(.*?)```", README, re.DOTALL)
    paths = (ROOT / "docs" / "paths.md").read_text()
    (given,) = re.findall(r"```toml\n(.*?)```", paths, re.DOTALL)
    assert plan_scenario(parse_scenario(text.encode(), "readme.toml")).proof.holds
    others = text[: text.rindex("[[robots]]")]
    assert plan_scenario(parse_scenario((others + given).encode(), "readme.toml")).proof.holds


def test_the_readme_is_short_and_its_prose_narrow():
    lines = README.splitlines()
    assert len(lines) <= 180
    assert [line for line in lines if len(line) > 100 and not line.startswith("|")] == []


def test_the_prose_of_the_pages_is_narrow():
    for page in (ROOT / "docs").rglob("*.md"):
        lines = page.read_text().splitlines()
        assert [line for line in lines if len(line) > 110 and not line.startswith("|")] == [], page


@pytest.mark.parametrize("path", sorted((ROOT / "examples").glob("*.toml")), ids=lambda p: p.stem)
def test_every_example_has_a_proven_plan_of_short_messages(path):
    document = plan_scenario(read_scenario(path))
    assert document.proof.holds
    for robot in document.robots:
        if len(robot.path.control_points) <= 12 and len(robot.stops) <= 3:
            assert robot.wire_bytes <= 350


def test_the_links_of_the_readme_lead_somewhere():
    for target in re.findall(r"\]\(((?!http)[^)#]+)\)", README):
        assert (ROOT / target).exists(), target
