"""The map of the code, docs/architecture.md, and the paths that the documents name."""

import re
from importlib.util import module_from_spec, spec_from_file_location

import pytest

from tests.test_readme import ROOT

PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
ARCHITECTURE = (ROOT / "docs" / "architecture.md").read_text()
PACKAGES = ("coordinator", "sim", "protocol", "robot_agent", "tests", "benchmarks")
PATH = r"(?:coordinator|sim|protocol|robot_agent|tests|benchmarks)/(?:[\w/-]+\.py|[\w/]+/)"


def script(path):
    spec = spec_from_file_location(path.stem, path)
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def folders(package):
    return {path.parent.name for path in (ROOT / package).glob("*/__init__.py")}


def test_the_picture_shows_the_rooms_that_there_are():
    drawing = script(ROOT / "docs" / "tools" / "draw_rooms.py")
    there = {f"{package}.{room}" for package in ("coordinator", "sim") for room in folders(package)}
    shown = drawing.rooms()
    assert there | {"robot_agent", "robot_agent.core", "protocol"} == set(shown)
    texts = re.findall(r">([a-z_]+)</text>", drawing.PICTURE.read_text())
    boxes_and_columns = sorted(2 * [name.split(".")[-1] for name in shown])
    words = ("pure", "sim", "coordinator")
    assert sorted(text for text in texts if text not in words) == boxes_and_columns


def test_the_page_says_of_every_room_what_it_decides():
    for package in ("coordinator", "sim"):
        table = ARCHITECTURE.split(f"| room of `{package}/` |")[1].split("\n\n")[0]
        assert set(re.findall(r"^\| `(\w+)` \|", table, re.MULTILINE)) == folders(package)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_every_path_that_a_document_names_exists(page):
    text = page.read_text()
    for path in re.findall(rf"`({PATH})`|(?<![\w/.])({PATH}(?<=\.py))", text):
        assert (ROOT / (path[0] or path[1])).exists(), path
    for name in re.findall(r"`([a-z_]+\.(?:py|js))`", text):
        assert (ROOT / name).exists() or any(
            path for package in PACKAGES for path in (ROOT / package).rglob(name)
        ), name


def test_what_the_map_finds_in_a_file_is_in_it():
    found = re.findall(rf"`({PATH})`:\s`(\w+)`", ARCHITECTURE)
    assert len(found) > 25
    for path, name in found:
        text = (ROOT / path).read_text()
        assert re.search(rf"^(?:def|class) {name}\b", text, re.MULTILINE), f"{path}: {name}"
