"""The desk's page in a real browser: every command is seen on the page and in the fleet."""

import json
import os
import signal
import time
from contextlib import ExitStack
from pathlib import Path

import pytest

from coordinator.desk.line import Line
from coordinator.desk.web import Desk, served
from coordinator.planning.planner import plan_scenario
from coordinator.scenario_files.scenario_reader import read_scenario
from coordinator.view.live_course import LiveCourse
from coordinator.view.page import page_of
from protocol import keys
from protocol.messages import REFUSED, UNDER_WAY, OrderState
from protocol.phases import DRIVER_ERROR, FROZEN, OFF_PATH
from protocol.timing import SECOND
from sim.floors.generator import generate
from tests.coordinator.desk.fake_fleet import FLEET, FakeFleet, a_command, a_report
from tests.system.browser import browser, find_browser, needs_axe
from tests.system.fleet_tools import TWO_ROBOTS, free_endpoint, line_with, started
from tests.system.floor_words import WORDS

pytestmark = pytest.mark.skipif(
    find_browser() is None, reason="no Chromium is installed (BROWSER names one)"
)

ANSWER = "document.getElementById('answer').textContent"
ALARMS = "document.getElementById('alarms').innerText"
ORDERS = "document.getElementById('orders').innerText"
WORD = "document.getElementById('word').textContent"
STATE = "document.getElementById('state').textContent"
PLACE = "(({ x, y }) => [x, y])(splinefleet.at(splinefleet.time).R1)"
OUTLOOK = "document.getElementById('outlook').textContent"
PHASE = "document.getElementById('phase').textContent"
STATES = "Object.values(splinefleet.at(splinefleet.time)).map(robot => robot.state).join()"
WATCH_GO_ON = """(() => {
  const button = document.getElementById("go-on"), offered = window.offered = [];
  new MutationObserver(() => {
    if (!button.hidden && offered.at(-1) !== button.textContent) offered.push(button.textContent);
  }).observe(button, { attributes: true, childList: true, characterData: true, subtree: true });
})()"""
SPOT = """(() => {
  const { left, top, width, height } = document.getElementById('floor').getBoundingClientRect();
  return [left + 0.5 * width, top + 0.5 * height];
})()"""


def click(tab, name):
    tab.run(f"document.getElementById('{name}').click()")


def layout(tab, width):
    """Return the box of STOP, and those of the buttons that let robots drive or end the mission."""
    tab.screen(width, 900)
    tab.settle()
    boxes = """['stop', 'go-on', 'end-mission'].map(id => {
      const { left, right, top, bottom } = document.getElementById(id).getBoundingClientRect();
      return { left, right, top, bottom };
    })"""
    stop, *others = tab.run(boxes)
    return stop, others


def order_to(tab, place):
    """Send an order to a place for the chosen robot."""
    tab.run(f"document.getElementById('order-place').value = '{place}'")
    tab.run("document.getElementById('order-place').dispatchEvent(new Event('input'))")
    click(tab, "order-send")


def test_an_operator_orders_cancels_stops_and_is_called(tmp_path):
    (tmp_path / "two.toml").write_text(TWO_ROBOTS)
    endpoint = free_endpoint()
    with ExitStack() as stack:
        tab = stack.enter_context(browser(tmp_path / "profile"))
        options = ("--listen", endpoint, "--page", "127.0.0.1:0", "--json", "--stay")
        coordinator = stack.enter_context(started("coordinator", tmp_path / "two.toml", *options))
        address = json.loads(line_with(coordinator, "http://", 60.0))["address"]
        agents = {
            robot: stack.enter_context(started("agent", robot, "--connect", endpoint))
            for robot in ("R1", "R2")
        }
        tab.screen(1440, 900)
        tab.open(address)
        tab.wait(f"{STATES} === 'arrived,arrived'", 60.0)
        before = {width: layout(tab, width) for width in (390, 1440)}

        tab.run("splinefleet.choose(0)")
        x, y = tab.run(SPOT)
        for kind in ("mouseMoved", "mousePressed", "mouseReleased"):
            tab.point(x, y, kind)
        assert tab.run("document.getElementById('order-place').value") == "2.00, 2.00"
        assert tab.run("document.getElementById('order-robot').value") == "R1"
        tab.wait(f"{OUTLOOK}.startsWith('R1 would be there in')", 60.0)
        click(tab, "order-send")
        tab.wait(f"{ANSWER}.endsWith('is taken for R1')")
        tab.wait(f"{ORDERS}.includes('R1 arrives')")

        assert tab.run(STATE).startswith("running: ")
        tab.wait("splinefleet.at(splinefleet.time).R1.v > 0.4")
        tab.run(WATCH_GO_ON)
        tab.press(" ")
        tab.wait(f"{STATE} === 'stopped: all stand' && {PHASE}.endsWith('told to stop')")
        assert "1 standing" in tab.run("document.getElementById('robots-title').textContent")
        assert tab.run("window.offered") == ["resume"]
        for width, (stop, _) in before.items():
            now, others = layout(tab, width)
            assert now == stop
            assert all(one["right"] < stop["left"] or one["top"] > stop["bottom"] for one in others)
        assert tab.run("document.getElementById('stop').disabled") is False
        click(tab, "go-on")
        tab.wait(f"{ANSWER} === 'the fleet goes on' && {PHASE}.endsWith('go')")

        tab.run("document.querySelector('.cancel:not([hidden])').click()")
        tab.wait(f"{ORDERS}.includes('cancelled')")
        order_to(tab, "99, 99")
        tab.wait(f"{ANSWER}.includes('off the floor') && {ORDERS}.includes('refused')")

        agents["R2"].send_signal(signal.SIGKILL)
        tab.wait(f"{ALARMS}.includes('R2 is not heard')")
        tab.wait(f"{STATE} === 'running: robots may start at any time; 1 not heard'")
        assert tab.run("document.body.dataset.fleet") == "warns"
        tab.wait(f"/admit R2 once heard\\s+take out R2/.test({ALARMS})")
        assert tab.run("document.querySelector('#alarms [data-act=admit]').disabled")
        tab.run("splinefleet.choose(1)")
        tab.settle()
        assert [text for text, *_ in tab.run(WORDS)].count("R2") == 1
        tab.run("splinefleet.choose(1)")
        assert "It may not hear STOP: keep away until you see it stand" in tab.run(ALARMS)
        tab.wait("/R2 lost its link/.test(document.getElementById('events').textContent)")
        assert "R2" not in tab.run("document.getElementById('robot-acts').textContent")
        about_r2 = (
            "[...document.querySelectorAll('#alarms li')].find(one => /R2 is/.test(one.innerText))"
        )
        tab.run(f"{about_r2}.querySelector('button:last-child').click()")
        tab.wait("document.querySelector('#alarms .seen') !== null")
        stack.enter_context(started("agent", "R2", "--connect", endpoint))
        tab.wait(f"{ALARMS}.includes('R2 is back and has no course')", 60.0)
        tab.wait("/R2no course/.test(document.getElementById('robots').textContent)")
        # The browser notes the answer to the order that is refused, and nothing else.
        assert [one for one in tab.errors if "409 (Conflict)" not in one] == []
        tab.run("window.confirm = () => true")
        tab.run(f"{about_r2}.querySelector('.about').click()")
        assert tab.run("document.getElementById('order-robot').value") == "R2"
        tab.run(f"{about_r2}.querySelector('[data-act=leave]').click()")
        tab.wait(f"{ANSWER} === 'R2 has left'")
        click(tab, "end-mission")
        tab.wait("document.getElementById('follow').textContent === 'over'")
        assert coordinator.wait(60.0) == 0


@pytest.mark.parametrize(
    ("state", "left"), [(UNDER_WAY, ""), (REFUSED, "1, 1")], ids=["under way", "refused"]
)
def test_the_next_order_can_be_chosen_while_one_is_not_answered_yet(tmp_path, state, left):
    (tmp_path / "two.toml").write_text(TWO_ROBOTS)
    document = plan_scenario(read_scenario(tmp_path / "two.toml"), effort=0)
    fleet = FakeFleet()
    fleet.is_deaf = True
    line = Line(fleet, LiveCourse(FLEET, document))
    desk = Desk(
        line, lambda may: page_of(line.scene(), live=True, may_command=may), may_command=True
    )
    place = "document.getElementById('order-place').value"

    def answer():
        tab.wait(f"{ANSWER}.startsWith('asked')")
        fleet.said.clear()
        deadline = time.monotonic() + 10.0
        while not fleet.said:
            assert time.monotonic() < deadline
            time.sleep(0.01)
        order = fleet.said[0]  # It is asked for again until it is answered.
        told = OrderState(order.id, state, "R1", released_ms=5, reason="")
        fleet.tell(keys.orders(FLEET, order.id), told)
        tab.wait(f"!{ANSWER}.startsWith('asked')")

    with served(desk.app()) as address, browser(tmp_path / "profile") as tab:
        fleet.beat()
        tab.open(address)
        assert tab.run("document.getElementById('needs').checkVisibility()")
        order_to(tab, "1, 1")
        tab.wait(f"{ANSWER} === 'asked: any robot to 1, 1' && {place} === ''")
        answer()
        assert tab.run(place) == left
        order_to(tab, "2, 2")
        tab.run("document.getElementById('order-place').value = '3, 3'")
        tab.run("document.getElementById('order-place').dispatchEvent(new Event('input'))")
        answer()
        assert tab.run(place) == "3, 3"


def test_many_alarms_that_are_alike_are_one_until_they_are_unfolded(tmp_path):
    (tmp_path / "two.toml").write_text(TWO_ROBOTS)
    document = plan_scenario(read_scenario(tmp_path / "two.toml"), effort=0)
    fleet = FakeFleet()
    line = Line(fleet, LiveCourse(FLEET, document))
    desk = Desk(
        line, lambda may: page_of(line.scene(), live=True, may_command=may), may_command=True
    )
    lines = "[...document.querySelectorAll('#alarms li .about')].map(one => one.textContent)"
    acts = "document.querySelectorAll('#alarms [data-act=leave]').length"
    with served(desk.app()) as address, browser(tmp_path / "profile") as tab:
        fleet.beat()
        for number in range(1, 6):
            fleet.tell(keys.report(FLEET, f"R{number}"), a_report())
        tab.open(address)
        fleet.tell(keys.command(FLEET), a_command(said_ns=5 * SECOND))
        tab.wait(f"{lines}.join() === 'R1, R2, R3 and 2 more are not heard'")
        assert tab.run(acts) == 0
        tab.run("document.querySelector('#alarms .fold').click()")
        assert len(tab.run(lines)) == 6
        assert tab.run(acts) == 5
        tab.run("document.querySelector('#alarms .fold').click()")
        assert len(tab.run(lines)) == 1


def test_alarms_are_whole_on_a_phone_and_a_robot_off_its_path_is_not_said_to_be_proven(tmp_path):
    (tmp_path / "two.toml").write_text(TWO_ROBOTS)
    document = plan_scenario(read_scenario(tmp_path / "two.toml"), effort=0)
    fleet = FakeFleet()
    line = Line(fleet, LiveCourse(FLEET, document))
    desk = Desk(
        line, lambda may: page_of(line.scene(), live=True, may_command=may), may_command=True
    )
    buttons = """[...document.querySelectorAll('#alarms button')].every(one => {
      one.scrollIntoView({ block: 'center' });
      const { left, right, top, bottom } = one.getBoundingClientRect();
      const box = one.closest('ul').getBoundingClientRect();
      return left >= 0 && right <= innerWidth && top >= box.top && bottom <= box.bottom;
    })"""
    with served(desk.app()) as address, browser(tmp_path / "profile") as tab:
        tab.screen(390, 844)
        tab.open(address)  # First, since what is told grows old while a browser starts slowly.
        fleet.beat()
        for number, fault in enumerate((OFF_PATH, DRIVER_ERROR, OFF_PATH, DRIVER_ERROR), start=1):
            fleet.tell(keys.report(FLEET, f"R{number}"), a_report(FROZEN, fault))
        tab.wait(f"{ALARMS}.includes('R4')")
        assert tab.run("document.querySelectorAll('#alarms li').length") == 4
        assert tab.run(buttons)
        verdict = tab.run("document.getElementById('verdict').textContent")
        assert verdict == "newest plan proven; R1, R3 off their paths are not covered"
        order = OrderState(
            "order-969f", UNDER_WAY, "R2", released_ms=5, accepted_ms=9, planned_arrival_ms=9_000
        )
        fleet.tell(keys.orders(FLEET, order.id), order)
        state = "document.querySelector('#orders li:not([hidden]) .state')"
        tab.wait(f"{state} !== null && {state}.textContent !== ''")
        assert tab.run(f"{state}.getBoundingClientRect().height") < 25


def test_of_a_hundred_robots_many_are_listed_and_the_chosen_one_on_top(tmp_path):
    document = plan_scenario(generate("open", 100, 3), effort=0)
    fleet = FakeFleet()
    line = Line(fleet, LiveCourse(FLEET, document))
    desk = Desk(
        line, lambda may: page_of(line.scene(), live=True, may_command=may), may_command=True
    )
    rows = """(box => new Set([...document.querySelectorAll('#robots li')]
      .map(one => one.getBoundingClientRect())
      .filter(one => one.bottom <= box.bottom).map(one => Math.round(one.top))).size)(
      document.querySelector('.robots').getBoundingClientRect())"""
    first = """[...document.querySelectorAll('#robots li')]
      .sort((a, b) => a.style.order - b.style.order)[0].querySelector('.id').textContent"""
    with served(desk.app()) as address, browser(tmp_path / "profile") as tab:
        tab.screen(1440, 900)
        fleet.beat()
        for number in range(1, 6):
            order = OrderState(f"o{number}", UNDER_WAY, f"R{number}", released_ms=5)
            fleet.tell(keys.orders(FLEET, order.id), order)
        tab.open(address)
        tab.wait("document.querySelectorAll('#orders li').length >= 5")
        assert tab.run(rows) >= 8
        tab.run("splinefleet.choose(76)")
        tab.wait(f"{first} === 'R77'")
        assert not tab.run("document.querySelector('.diagram').checkVisibility()")
        click(tab, "show-chart")
        assert tab.run("document.querySelector('.diagram').checkVisibility()")
        tab.wait("document.getElementById('robots-title').textContent === 'Robots: 100 not heard'")
        tab.run("splinefleet.choose(54)")
        tab.wait(f"{first} === 'R55'")
        assert tab.errors == []


def test_who_only_looks_has_no_commands(tmp_path):
    (tmp_path / "two.toml").write_text(TWO_ROBOTS)
    with ExitStack() as stack:
        tab = stack.enter_context(browser(tmp_path / "profile"))
        endpoint, plan = free_endpoint(), tmp_path / "plan.json"
        stack.enter_context(
            started("coordinator", tmp_path / "two.toml", "--listen", endpoint, "--plan-out", plan)
        )
        view = stack.enter_context(started("view", "--connect", endpoint, "--no-open"))
        tab.open(line_with(view, "http://").strip())
        hidden = "['command', 'give'].map(id => document.getElementById(id).hidden).join()"
        assert tab.run(hidden) == "false,false"


def test_a_page_whose_process_is_killed_is_there_again_and_without_its_coordinator_says_so(
    tmp_path,
):
    (tmp_path / "two.toml").write_text(TWO_ROBOTS)
    endpoint = free_endpoint()
    with ExitStack() as stack:
        tab = stack.enter_context(browser(tmp_path / "profile"))
        options = ("--listen", endpoint, "--page", "127.0.0.1:0", "--json", "--stay")
        coordinator = stack.enter_context(started("coordinator", tmp_path / "two.toml", *options))
        address = json.loads(line_with(coordinator, "http://", 60.0))["address"]
        for robot in ("R1", "R2"):
            stack.enter_context(started("agent", robot, "--connect", endpoint))
        tab.open(address)
        tab.wait(f"{STATES} === 'arrived,arrived'", 60.0)
        tab.run("splinefleet.choose(0)")
        order_to(tab, "2, 2")
        tab.wait(f"{ORDERS}.includes('R1 arrives')")

        tab.wait("splinefleet.at(splinefleet.time).R1.v > 0.2")
        tab.press(" ")
        tab.wait(f"{STATE} === 'stopped: all stand'")
        stood = tab.run(PLACE)
        os.kill(serving(coordinator), signal.SIGKILL)
        tab.wait(f"{STATE} === 'no word: robots may be driving'")
        assert json.loads(line_with(coordinator, "has ended"))["address"] == address
        tab.wait(f"{STATE} === 'stopped: all stand'", 60.0)
        tab.open(address)
        tab.wait(f"{STATE} === 'stopped: all stand' && {ORDERS}.includes('once the fleet goes on')")
        assert tab.run(PLACE) == pytest.approx(stood, abs=0.05)
        assert tab.run(WORD) == ""
        click(tab, "go-on")
        tab.wait(f"{STATE}.startsWith('running: 1 driving')")
        tab.wait(f"{ORDERS}.includes('was there')", 60.0)
        order_to(tab, "1, 1")
        tab.wait(f"{ANSWER}.includes('is taken for')")

        coordinator.kill()
        tab.wait(f"{STATE} === 'no word: robots may be driving'")


def serving(coordinator):
    """Return the id of the process that serves a coordinator's page."""
    children = Path(f"/proc/{coordinator.pid}/task/{coordinator.pid}/children").read_text()
    (found,) = (
        child
        for child in map(int, children.split())
        if b"spawn_main" in Path(f"/proc/{child}/cmdline").read_bytes()
    )
    return found


@needs_axe
def test_axe_finds_nothing_on_a_desk_with_orders_and_alarms_that_keeps_anybody_out(tmp_path):
    (tmp_path / "two.toml").write_text(TWO_ROBOTS)
    endpoint = free_endpoint()
    with ExitStack() as stack:
        tab = stack.enter_context(browser(tmp_path / "profile"))
        options = ("--listen", endpoint, "--page", "127.0.0.1:0", "--json", "--stay")
        coordinator = stack.enter_context(started("coordinator", tmp_path / "two.toml", *options))
        address = json.loads(line_with(coordinator, "http://", 60.0))["address"]
        agents = [
            stack.enter_context(started("agent", robot, "--connect", endpoint))
            for robot in ("R1", "R2")
        ]
        tab.screen(1440, 900)
        tab.open(address)
        tab.wait(f"{STATES} === 'arrived,arrived'", 60.0)
        tab.run("splinefleet.choose(0)")
        order_to(tab, "99, 99")
        tab.wait(f"{ANSWER}.includes('off the floor') && {ORDERS}.includes('refused')")
        order_to(tab, "2, 2")
        tab.wait(f"{ORDERS}.includes('R1 arrives')")
        agents[1].send_signal(signal.SIGKILL)
        tab.wait(f"{ALARMS}.includes('R2 is not heard')")
        for width in (390, 1440):
            for dark in (False, True):
                tab.screen(width, 900, dark)
                tab.settle()
                assert tab.violations() == [], (width, dark)
