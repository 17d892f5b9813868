"""The page as one string, and the server that hands it out: self-contained, small, escaped."""

import json
import re
from functools import cache
from html.parser import HTMLParser
from pathlib import Path

import msgspec
import pytest

from coordinator.base.errors import InputError
from coordinator.log.blackbox_attachments import packed
from coordinator.log.log_file import RESUMED
from coordinator.log.log_writer import Attachment
from coordinator.log.recorder import Recorder
from coordinator.plan.plan_file import to_json
from coordinator.planning.planner import plan_scenario
from coordinator.scenario_files.scenario_reader import read_scenario
from coordinator.view.page import page_of
from coordinator.view.scene import Scene
from coordinator.view.scene_plan import scene_of_plan
from coordinator.view.scene_reader import read_scene
from protocol import keys
from protocol.codec import encode
from protocol.messages import Command
from protocol.phases import FREEZE, GO
from protocol.timing import SECOND

EXAMPLES = Path(__file__).resolve().parents[3] / "examples"


@cache
def document():
    return plan_scenario(read_scenario(EXAMPLES / "paper_five.toml"), effort=0)


def scene(**changes):
    return msgspec.structs.replace(scene_of_plan(document()), **changes)


class Elements(HTMLParser):
    """All elements with their attributes, and the text of each script."""

    def __init__(self, page):
        super().__init__()
        self.found, self.scripts, self._open = [], [], None
        self.feed(page)

    def handle_starttag(self, tag, attributes):
        self.found.append((tag, dict(attributes)))
        if tag == "script":
            self.scripts.append("")
            self._open = dict(attributes)

    def handle_endtag(self, tag):
        if tag == "script":
            self._open = None

    def handle_data(self, data):
        if self._open is not None:
            self.scripts[-1] += data


def test_the_page_asks_for_nothing_outside_of_itself():
    page = page_of(scene())
    for tag, attributes in Elements(page).found:
        for name in ("src", "href", "action", "srcset", "data"):
            assert attributes.get(name, "data:,") == "data:,", tag
    assert not re.search(r"https?:|//[a-z]|@import|url\(|XMLHttp|WebSocket", page)
    asked = re.findall(r"(?:fetch|EventSource)\((.{5})", page)
    assert asked == ["`api/", '"api/'], "only the server that it comes from, if that is live"
    (policy,) = re.findall(r'Content-Security-Policy" content="([^"]*)"', page)
    assert "default-src 'none'" in policy
    assert "connect-src 'none'" in policy
    assert "connect-src 'self'" in page_of(scene(), live=True)


def test_the_data_reads_back_as_the_scene():
    data, _ = Elements(page_of(scene())).scripts
    assert msgspec.json.decode(data, type=Scene) == scene()
    assert json.loads(data)["name"] == "paper-five"


def test_nothing_in_the_data_ends_the_script_or_becomes_an_element():
    name = '</script><img src=x onerror="1"><!-- {{style}} & \u2028'
    page = page_of(scene(name=name))
    elements = Elements(page)
    assert json.loads(elements.scripts[0])["name"] == name
    assert len(elements.scripts) == 2
    assert not [tag for tag, _ in elements.found if tag == "img"]
    assert "<title>&lt;/script&gt;" in page


def test_the_page_of_the_paper_is_far_below_a_megabyte():
    page = page_of(scene())
    assert len(page.encode()) < 120_000
    assert len(page_of(scene(robots=[], epochs=[])).encode()) < 120_000


def test_the_parts_are_hand_sized_files():
    for part in (
        Path(__file__).resolve().parents[3] / "coordinator" / "view" / "page_files"
    ).iterdir():
        lines = part.read_text().splitlines()
        assert len(lines) < 300, part.name
        assert max(map(len, lines)) <= 120, part.name


def test_every_control_has_a_name():
    found = Elements(page_of(scene())).found
    labelled = {attributes.get("for") for tag, attributes in found if tag == "label"}
    for tag, attributes in found:
        if tag == "canvas":
            assert attributes["role"] == "img"
            assert attributes["aria-label"]
        if tag == "input" and attributes["type"] == "range":
            assert attributes["aria-label"] or attributes["id"] in labelled
    assert ("html", "en") in [(tag, attributes.get("lang")) for tag, attributes in found]


def test_a_plan_file_is_read_as_its_scene(tmp_path):
    file = tmp_path / "plan.json"
    file.write_bytes(to_json(document()))
    assert read_scene(file) == scene()
    with pytest.raises(InputError):
        read_scene(tmp_path / "none.mcap")


def write_log(path, epoch, attachments, commands):
    """Write a log of Commands (t, phase, start) of an epoch."""
    with Recorder(
        path,
        metadata={"fleet": "paper-five"},
        wall_offset_ns=0,
        attachments=[Attachment(name, "", data) for name, data in attachments.items()],
    ) as log:
        for t, phase, start in commands:
            message = Command(1, 1, 1, epoch, phase, round(start * SECOND), 0)
            log.record(keys.command("paper-five"), encode(message), round(t * SECOND))


def test_a_log_is_read_with_those_it_went_on_from_and_the_black_boxes_beside_it(tmp_path):
    first, second = tmp_path / "first.mcap", tmp_path / "run.mcap"
    plans = [to_json(msgspec.structs.replace(document(), epoch=epoch)) for epoch in (1, 2)]
    write_log(first, 1, {"plan-1.json": plans[0]}, [(9.0, GO, 10.0), (13.0, GO, 10.0)])
    before = {RESUMED: first.read_bytes(), "plan-2.json": plans[1]}
    write_log(second, 2, before, [(14.0, FREEZE, 0.0), (15.0, GO, 16.0), (18.0, GO, 16.0)])
    (tmp_path / "blackbox").mkdir()
    (tmp_path / "blackbox" / "R4.csv").write_text("t,x,y,heading,s,phase\n0.0,3,4,0,0,moving\n")
    found = read_scene(second)
    assert [(one.epoch, one.start, one.frozen) for one in found.epochs] == [(1, 0, 4), (2, 6, None)]
    assert found.end == 8.0
    assert [(ghost.robot, ghost.x, ghost.y) for ghost in found.ghosts] == [(3, [3.0], [4.0])]
    assert len(page_of(found)) < 1_000_000


def test_black_boxes_in_the_log_are_shown_rather_than_those_beside_it(tmp_path):
    (tmp_path / "blackbox").mkdir()
    (tmp_path / "blackbox" / "R4.csv").write_text("t,x,y,heading,s,phase\n0.0,3,4,0,0,moving\n")
    box = packed("R1", b"t,x,y,heading,s,phase\n0.0,1,2,0,0,moving\n")
    files = {"plan-1.json": to_json(document()), box.name: box.data}
    write_log(tmp_path / "run.mcap", 1, files, [(9.0, GO, 10.0), (13.0, GO, 10.0)])
    found = read_scene(tmp_path / "run.mcap")
    assert [(ghost.robot, ghost.x, ghost.y) for ghost in found.ghosts] == [(0, [1.0], [2.0])]
    write_log(tmp_path / "bad.mcap", 1, files | {box.name: box.data[:-9]}, [(9.0, GO, 10.0)])
    scene = read_scene(tmp_path / "bad.mcap")
    assert scene.ghosts == []
    (note,) = (note for note in scene.notes if "attachment blackbox/R1.csv.gz" in note)
    assert "cannot be unpacked" in note
