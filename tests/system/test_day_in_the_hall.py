"""A day in the hall: the story of docs/day.md on the operator's page, in a real browser.

With PICTURES=docs/img it writes the pictures of that page.
"""

import json
import os
import re
from contextlib import ExitStack
from pathlib import Path

import pytest

from tests.system.browser import browser, find_browser
from tests.system.fleet_tools import ROOT, line_with, started

pytestmark = pytest.mark.skipif(
    find_browser() is None, reason="no Chromium is installed (BROWSER names one)"
)

KILLED_S = 40.0
TEXT = "document.getElementById('{}').textContent"
BOX = """(() => {
  document.getElementById('floor').scrollIntoView();
  const { left, top, width, height } = document.getElementById('floor').getBoundingClientRect();
  return JSON.stringify([left, top, width, height]);
})()"""


class Day:
    """The page of the hall; `picture` writes one if pictures are wanted."""

    def __init__(self, tab):
        self.tab = tab
        self._folder = os.environ.get("PICTURES")

    def wait_for(self, box, words):
        self.tab.wait(f"/{words}/.test({TEXT.format(box)})", 60.0)

    def press(self, name):
        self.tab.run(f"document.getElementById('{name}').click()")

    def click(self, across, down):
        """Click the floor, at a share of its width and height."""
        left, top, width, height = json.loads(self.tab.run(BOX))
        for kind in ("mouseMoved", "mousePressed", "mouseReleased"):
            self.tab.point(left + across * width, top + down * height, kind)

    def picture(self, name):
        self.tab.settle()
        if self._folder:
            self.tab.picture(Path(self._folder) / f"day_{name}.png")


def test_a_day_in_the_hall(tmp_path):
    with ExitStack() as stack:
        tab = stack.enter_context(browser(tmp_path / "profile"))
        hall = stack.enter_context(
            started(
                *("simulate", ROOT / "examples" / "hall.toml", "--out", tmp_path / "day"),
                *("--page", "127.0.0.1:0", "--fault", f"kill:R5@{KILLED_S:g}"),
            )
        )
        address = re.search(r"http://\S+", line_with(hall, "http://", 60.0, "stderr"))[0]
        tab.screen(1280, 800)
        tab.open(address)
        day = Day(tab)
        day.wait_for("phase", "go")
        day.wait_for("orders-title", "under way")
        tab.wait("splinefleet.time > 15", 60.0)
        day.picture("morning")

        tab.run("splinefleet.choose(1)")
        day.click(0.62, 0.62)
        day.wait_for("outlook", "R2 would be there|R2 sets out")
        day.picture("order")
        tab.run("document.getElementById('order-now').click()")
        day.press("order-send")
        day.wait_for("answer", "is taken for R2")
        tab.press("Escape")

        day.click(0.5, 0.62)
        day.press("close-place")
        day.wait_for("blocks", "is closed")
        tab.press(" ")
        day.wait_for("phase", "told to stop")
        day.picture("stop")
        day.press("go-on")
        day.wait_for("phase", "go")

        day.wait_for("alarms", "R5 is not heard")
        day.wait_for("events", "R5 lost its link|R5 fell silent|R5")
        day.picture("lost")
        tab.run("document.querySelector('#alarms li button:last-child').click()")
        tab.wait("document.querySelector('#alarms .seen') !== null")

        day.wait_for("flow", "orders done")
        day.press("show-heat")
        assert tab.errors == []
        tab.run("window.confirm = () => true")
        day.press("end-mission")
        day.wait_for("answer", "the fleet ends")
