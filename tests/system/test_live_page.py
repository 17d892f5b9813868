"""The page of a running fleet when nobody speaks any more: robots are not shown to drive."""

import re
import signal
from contextlib import ExitStack

import pytest

from coordinator.plan.shares_of_tau import shares_of
from coordinator.plan.wire import drive
from coordinator.planning.planner import plan_scenario
from coordinator.scenario.model import Link
from coordinator.scenario_files.scenario_reader import read_scenario
from tests.system.browser import browser, find_browser
from tests.system.fleet_tools import TWO_ROBOTS, free_endpoint, line_with, splinefleet, started

pytestmark = pytest.mark.skipif(
    find_browser() is None, reason="no Chromium is installed (BROWSER names one)"
)

WORD = "document.getElementById('word').textContent"
EVENTS = "document.getElementById('events').innerText"
VERDICT = "!document.getElementById('verdict').hidden"
LAMP = "document.getElementById('follow').getAttribute('aria-pressed')"
STATES = "Object.values(splinefleet.at(splinefleet.time)).map(robot => robot.state)"
AT_REST = "Object.values(splinefleet.at(splinefleet.time)).every(robot => robot.v === 0)"


@pytest.fixture
def tab(tmp_path):
    with browser(tmp_path / "profile") as tab:
        yield tab


def rests_when_silent(document, since):
    """Where the authority of each robot ends that was granted at a plan time [s]."""
    headroom = shares_of([robot.limits for robot in document.robots], Link()).headroom
    return {one.id: one.timeline.s_at(since + headroom) for one in drive(document)}


def test_robots_are_shown_at_rest_when_the_coordinator_or_the_view_is_silent(tab, tmp_path):
    (tmp_path / "two.toml").write_text(TWO_ROBOTS)
    endpoint, file, floor = free_endpoint(), tmp_path / "plan.json", tmp_path / "two.toml"
    splinefleet("plan", floor, "--effort", 0, "-o", file)
    with ExitStack() as stack:
        coordinator = stack.enter_context(
            started("coordinator", tmp_path / "two.toml", "--listen", endpoint, "--effort", "0")
        )
        view = stack.enter_context(started("view", file, "--connect", endpoint, "--no-open"))
        address = line_with(view, "http://").strip()
        tab.open(address)
        for robot in ("R1", "R2"):
            stack.enter_context(started("agent", robot, "--connect", endpoint))
        tab.wait("splinefleet.time > 1.2")
        assert (tab.run(WORD), tab.run(LAMP), tab.run(VERDICT)) == ("", "true", True)

        coordinator.send_signal(signal.SIGSTOP)
        tab.wait(f"{WORD}.startsWith('no word from the coordinator since') && {AT_REST}")
        assert (tab.run(LAMP), tab.run(STATES)) == ("false", ["unheard", "unheard"])
        assert not tab.run(VERDICT)
        assert "no word from the coordinator" in tab.run(EVENTS)
        since = float(re.search(r"since ([\d.]+) s", tab.run(WORD))[1])
        shown = tab.run("splinefleet.at(splinefleet.time)")
        document = plan_scenario(read_scenario(tmp_path / "two.toml"), effort=0)
        for robot, s in rests_when_silent(document, since).items():
            assert shown[robot]["s"] == pytest.approx(s, abs=0.05)

        coordinator.send_signal(signal.SIGCONT)
        tab.wait(f"{WORD} === '' && {LAMP} === 'true'")
        assert "messages arrive again" in tab.run(EVENTS)

        coordinator.kill()
        tab.wait(f"{WORD}.startsWith('no word from the coordinator since') && {AT_REST}")
        assert tab.errors == []
        view.send_signal(signal.SIGINT)
        tab.wait(f"{WORD}.startsWith('the desk has ended, no word since')")
        assert "the desk has ended, no word" in tab.run(EVENTS)
        assert (tab.run(LAMP), tab.run(AT_REST)) == ("false", True)


ORDERS = "document.getElementById('orders-title').textContent"
ROWS = "document.getElementById('orders').innerText"


def test_a_fleet_that_gets_orders_is_followed_on_its_further_courses(tab, tmp_path):
    (tmp_path / "two.toml").write_text(TWO_ROBOTS)
    endpoint, file, floor = free_endpoint(), tmp_path / "plan.json", tmp_path / "two.toml"
    splinefleet("plan", floor, "--effort", 0, "-o", file)
    with ExitStack() as stack:
        coordinator = stack.enter_context(
            started("coordinator", floor, "--listen", endpoint, "--effort=0", "--stay", "--json")
        )
        for robot in ("R1", "R2"):
            stack.enter_context(started("agent", robot, "--connect", endpoint))
        line_with(coordinator, '"phase":"GO"', 60.0)
        given = splinefleet(
            "order", "--connect", endpoint, "--to", "1,1", "--robot", "R1", "--id=o"
        )
        assert given.returncode == 0, given.stderr
        view = stack.enter_context(started("view", file, "--connect", endpoint, "--no-open"))
        tab.open(line_with(view, "http://").strip())
        tab.wait(f"{ORDERS} === 'Orders: 1 under way' && {ROWS}.includes('R1 arrives')", 60.0)
        tab.wait("splinefleet.at(splinefleet.time).R1?.state === 'drives'")
        clock = tab.run("document.getElementById('day').textContent")
        assert re.fullmatch(r"\d\d:\d\d:\d\d", clock)
        tab.wait(f"{ORDERS} === 'Orders: 1 done' && {ROWS}.includes('R1 was there')")
        place = tab.run("(r => [r.x, r.y])(splinefleet.at(splinefleet.time).R1)")
        assert place == pytest.approx([1.0, 1.0], abs=0.01)
        splinefleet("end", "--connect", endpoint)
        assert coordinator.wait(timeout=30.0) == 0
        assert tab.errors == []
