"""The page in a headless Chromium: what it shows is what the plan says."""

import json
import math
import os
import random
import signal
import time
from contextlib import ExitStack
from pathlib import Path

import pytest
from msgspec.structs import replace

from coordinator.plan.plan_file import read, to_json
from coordinator.plan.wire import drive
from coordinator.planning.planner import plan_scenario
from coordinator.scenario_files.scenario_reader import read_scenario
from coordinator.view.page import page_of
from coordinator.view.scene import Held, Mark, Order
from coordinator.view.scene_plan import scene_of_plan
from sim.floors.generator import generate
from tests.system.browser import browser, find_browser, needs_axe
from tests.system.fleet_tools import (
    ROOT,
    TWO_ROBOTS,
    free_endpoint,
    line_with,
    splinefleet,
    started,
)

pytestmark = pytest.mark.skipif(
    find_browser() is None, reason="no Chromium is installed (BROWSER names one)"
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with plan.json and page.html of the paper's five robots."""
    folder = tmp_path_factory.mktemp("page")
    (folder / "plan.json").write_bytes(to_json(planned_five()))
    made = splinefleet("plot", folder / "plan.json", "-o", folder / "page.html")
    assert made.returncode == 0, made.stderr
    return folder


@pytest.fixture(scope="module")
def tab(folder):
    with browser(folder / "profile") as tab:
        yield tab


CURRENT = """(() => {
  const box = document.getElementById('events-title').parentElement.getBoundingClientRect();
  const row = document.querySelector('#events [aria-current]').getBoundingClientRect();
  return [document.querySelector('#events [aria-current]').innerText.split('\\n').pop(),
          row.top >= box.top - 1 && row.bottom <= box.bottom + 1];
})()"""


def planned_five():
    return plan_scenario(read_scenario(ROOT / "examples" / "paper_five.toml"), effort=0)


def test_the_newest_event_is_marked_and_in_sight_at_any_time(tab, tmp_path):
    scene = scene_of_plan(planned_five())
    marks = [Mark(t=0.5 * n, kind="late", text=f"event {n}") for n in range(50)]
    (tmp_path / "many.html").write_text(page_of(replace(scene, marks=marks)))
    tab.screen(1400, 900)
    tab.open((tmp_path / "many.html").as_uri())
    for number in (0, 49, 20, 33, 5):
        tab.run(f"splinefleet.seek({0.5 * number + 0.2})")
        tab.wait(f"{CURRENT}[0] === 'event {number}'")
        assert tab.run(CURRENT) == [f"event {number}", True]


@pytest.fixture
def page(tab, folder):
    """The page, fresh, on a large light screen; it must not complain."""
    tab.errors.clear()
    tab.asked.clear()
    tab.screen(1400, 900)
    address = (folder / "page.html").as_uri()
    tab.open(address)
    yield tab
    assert tab.errors == []
    assert tab.asked == [address]


def test_the_slider_moves_the_robots_to_where_the_plan_has_them(page, folder):
    document = read(folder / "plan.json")
    chance = random.Random(5)
    for _ in range(20):
        t = round(chance.uniform(0.0, 25.0), 2)
        page.run(
            f"(s => {{ s.value = {t}; s.dispatchEvent(new Event('input')); }})"
            "(document.getElementById('slider'))"
        )
        page.settle()
        assert page.run("splinefleet.time") == pytest.approx(t)
        assert page.run("document.getElementById('clock').textContent") == f"{t:.1f} s"
        told = page.run("splinefleet.at(splinefleet.time)")
        for one in drive(document):
            s = one.timeline.s_at(t)
            true = one.curve.at_arc([s])[0]
            assert math.dist((told[one.id]["x"], told[one.id]["y"]), true) < 0.002
            assert told[one.id]["s"] == pytest.approx(s, abs=1e-3)
            assert told[one.id]["v"] == pytest.approx(one.timeline.v_at(t), abs=1e-3)


def test_the_picture_shows_a_robot_where_the_plan_has_it(page):
    x, y = page.run("(r => [r.x, r.y])(splinefleet.at(9).R3)")
    page.run("splinefleet.seek(9)")
    page.settle()
    box = page.run(
        "(b => [b.left, b.top, b.width, b.height])"
        "(document.getElementById('floor').getBoundingClientRect())"
    )
    zoom = min((box[2] - 20) / 10.0, (box[3] - 20) / 10.0)
    page.point(box[0] + 0.5 * box[2] + zoom * (x - 5.0), box[1] + 0.5 * box[3] - zoom * (y - 5.0))
    tip = page.run("document.getElementById('tip').innerText")
    assert tip.startswith("R3")
    assert f"at {x:.2f}, {y:.2f} m" in tip


def test_the_keyboard_plays_steps_and_jumps(page):
    now = "splinefleet.time"
    page.press("ArrowRight")
    page.press("ArrowRight")
    page.press("ArrowLeft")
    assert page.run(now) == pytest.approx(0.5)
    page.press("End")
    assert page.run(now) == pytest.approx(page.run("splinefleet.end"))
    page.press("Home")
    assert page.run(now) == 0
    speed = "document.getElementById('speed').value"
    page.press(".", ".")
    assert page.run(speed) == "2"
    page.press(",", ",")
    assert page.run(speed) == "1"
    page.press(" ", " ")
    assert page.run("splinefleet.running")
    assert page.run("document.getElementById('play').getAttribute('aria-label')") == "Pause"
    page.run(
        "new Promise(r => { const look = () => splinefleet.time > 0.05 ? r() : "
        "requestAnimationFrame(look); look(); })"
    )
    page.press(" ", " ")
    assert not page.run("splinefleet.running")


def test_the_diagram_moves_the_time_and_shows_the_place_under_the_pointer(page):
    left, top, width, height = page.run(
        "(b => [b.left, b.top, b.width, b.height])"
        "(document.getElementById('diagram').getBoundingClientRect())"
    )
    end = page.run("splinefleet.end")
    for share in (0.25, 0.75):
        x = left + 36 + share * (width - 48)
        page.point(x, top + 0.5 * height, "mousePressed")
        page.point(x, top + 0.5 * height, "mouseReleased")
        assert page.run("splinefleet.time") == pytest.approx(share * end, rel=0.02)
    page.point(left + 36 + 0.5 * (width - 48), top + 0.3 * height)


def box_of(page, name):
    return page.run(
        f"(b => [b.left, b.top, b.width, b.height])"
        f"(document.getElementById('{name}').getBoundingClientRect())"
    )


def seen(page):
    """What of the floor is seen: how much it is enlarged, and the place in the middle."""
    page.settle()
    return page.run("(s => [s.factor, s.x, s.y])(splinefleet.seen)")


def tip_at(page, x, y):
    page.point(x, y)
    return page.run("document.getElementById('tip').innerText")


def test_the_keyboard_and_buttons_enlarge_the_floor(page):
    assert seen(page) == pytest.approx([1, 5.0, 5.0])
    page.press("+", "+")
    page.press("=", "=")
    assert seen(page) == pytest.approx([2.25, 5.0, 5.0])
    page.press("-", "-")
    assert seen(page)[0] == pytest.approx(1.5)
    assert not page.run("document.getElementById('zoom-all').hidden")
    page.press("0", "0")
    assert seen(page) == pytest.approx([1, 5.0, 5.0])
    page.run("document.getElementById('zoom-in').click()")
    assert seen(page)[0] == pytest.approx(1.5)
    page.run("document.getElementById('zoom-all').click()")
    assert seen(page) == pytest.approx([1, 5.0, 5.0])
    page.press("-", "-")
    assert seen(page)[0] == 1
    assert page.run("splinefleet.time") == 0


def test_the_wheel_keeps_what_is_under_the_pointer_and_a_drag_moves_the_floor(page):
    page.run("splinefleet.seek(9)")
    page.settle()
    left, top, width, height = box_of(page, "floor")
    zoom = min((width - 20) / 10.0, (height - 20) / 10.0)
    x, y = page.run("(r => [r.x, r.y])(splinefleet.at(9).R3)")
    spot = (left + 0.5 * width + zoom * (x - 5.0), top + 0.5 * height - zoom * (y - 5.0))
    for _ in range(4):
        page.wheel(*spot, -300)
    assert seen(page)[0] == pytest.approx(math.exp(4 * 300 * 0.0016), rel=1e-3)
    assert tip_at(page, *spot).startswith("R3")
    page.drag(spot, (spot[0] + 60, spot[1] + 25))
    assert tip_at(page, spot[0] + 60, spot[1] + 25).startswith("R3")
    assert page.run("document.querySelectorAll('#robots [aria-pressed=true]').length") == 0
    page.point(spot[0] + 60, spot[1] + 25, "mousePressed")
    page.point(spot[0] + 60, spot[1] + 25, "mouseReleased")
    assert page.run("document.querySelector('#robots [aria-pressed=true] .id').textContent") == "R3"
    page.drag(spot, (spot[0] + 5_000, spot[1]))
    factor, middle, _ = seen(page)
    assert middle == pytest.approx(0.5 * (width - 20) / zoom / factor, abs=1e-6)
    page.press("0")
    page.press("Escape")


def test_two_fingers_enlarge_what_is_between_them(page):
    left, top, width, height = box_of(page, "floor")
    x, y = left + 0.5 * width, top + 0.5 * height
    page.pinch((x - 30, y), (x + 30, y), (x - 90, y), (x + 90, y))
    factor, *middle = seen(page)
    assert factor == pytest.approx(3.0, rel=0.01)
    assert middle == pytest.approx([5.0, 5.0], abs=0.05)
    page.press("0")


def test_choosing_a_robot_fades_the_others_until_escape(page):
    page.run("document.querySelectorAll('#robots button')[2].click()")
    pressed = "document.querySelectorAll('#robots [aria-pressed=true] .id')"
    assert page.run(f"[...{pressed}].map(one => one.textContent)") == ["R3"]
    page.press("Escape")
    assert page.run(f"{pressed}.length") == 0


def test_waiting_is_told_in_words(page, folder):
    document = read(folder / "plan.json")
    robot = next(robot for robot in document.robots if robot.stops)
    stop = robot.stops[0]
    page.run(f"splinefleet.seek({0.5 * (stop.arrive + stop.depart)})")
    page.settle()
    said = page.run("document.getElementById('robots').innerText")
    assert f"{robot.id}\nwaits for {stop.yields_to}" in said


def test_late_robots_are_drawn_where_they_say_and_who_holds_them_is_told(tab, tmp_path):
    held = Held(robot=0, by=2, since=4.0, until=7.0)
    scene = scene_of_plan(planned_five())
    (epoch,), knots = scene.epochs, [(4.0, 4.0), (6.0, 4.0), (9.0, 7.5)]
    rides = [replace(epoch.rides[0], passed=knots), *epoch.rides[1:]]
    scene = replace(scene, epochs=[replace(epoch, rides=rides)], held=[held])
    (tmp_path / "late.html").write_text(page_of(scene))
    tab.screen(1400, 900)
    tab.open((tmp_path / "late.html").as_uri())
    by_plan = {t: tab.run(f"splinefleet.at({t}).R2") for t in (3, 4, 5, 7.5, 9, 11)}
    (tmp_path / "on_time.html").write_text(page_of(scene_of_plan(planned_five())))
    told = {t: tab.run(f"splinefleet.at({t}).R1") for t in (3, 4, 5, 7.5, 9, 11)}
    tab.run("splinefleet.seek(5)")
    tab.settle()
    row = tab.run("document.querySelector('#robots li').innerText")
    tab.open((tmp_path / "on_time.html").as_uri())
    for t, passed in ((3, 3.0), (4, 4.0), (5, 4.0), (7.5, 5.75), (9, 7.5), (11, 9.5)):
        assert told[t]["s"] == pytest.approx(tab.run(f"splinefleet.at({passed}).R1.s"), abs=1e-6)
        assert by_plan[t] == tab.run(f"splinefleet.at({t}).R2")
    assert told[5]["v"] == pytest.approx(0.0)
    assert [told[t]["state"] for t in (3, 5)] == ["drives", "held"]
    assert "held by R3 since 4.0 s" in row
    assert tab.errors == []


def test_robots_are_drawn_on_the_course_that_they_drive_and_orders_are_told(tab, tmp_path):
    scene = scene_of_plan(planned_five())
    (epoch,) = scene.epochs
    further = replace(epoch.rides[1], robot=0, revision=1, told=10.0, since=11.0)
    never = replace(epoch.rides[2], robot=0, revision=2, told=12.0)
    first = replace(epoch.rides[0], ends=10.5)
    orders = [
        Order(
            id="fetch",
            steps=[
                (2.0, 0, -1, None, "no robot is free"),
                (10.0, 1, 0, 14.0, ""),
                (16.0, 2, 0, 14.0, ""),
            ],
            arrived=15.0,
        ),
        Order(id="next", steps=[(13.0, 1, 0, 30.0, "")]),
        Order(
            id="room-1",
            steps=[(18.0, 0, 1, None, ""), (18.5, 1, 1, 25.0, "makes room for next")],
        ),
        Order(id="off", steps=[(5.0, 4, -1, None, "there is no way")]),
    ]
    rides = [first, *epoch.rides[1:], further, never]
    day = time.mktime((2026, 3, 1, 11, 59, 50, 0, 0, -1)) * 1000.0
    scene = replace(scene, epochs=[replace(epoch, rides=rides)], orders=orders, day=day)
    (tmp_path / "orders.html").write_text(page_of(scene))
    tab.errors.clear()
    tab.screen(1400, 900)
    tab.open((tmp_path / "orders.html").as_uri())
    alone = "(({x, y, s}) => [x, y, s])"
    for t in (11.2, 13.0, 20.0):
        places = [tab.run(f"{alone}(splinefleet.at({t}).{robot})") for robot in ("R1", "R2")]
        assert places[0] == places[1], t
    assert tab.run("splinefleet.at(10.9).R1.s") == tab.run("splinefleet.at(10.5).R1.s")

    def told(t):
        tab.run(f"splinefleet.seek({t})")
        tab.settle()
        title = tab.run("document.getElementById('orders-title').textContent")
        rows = "[...document.querySelectorAll('#orders li')].filter(row => !row.hidden)"
        return title, tab.run(f"{rows}.map(row => row.innerText.replaceAll('\\n', ' ').trim())")

    assert told(1.0) == ("Orders", [])
    off = "off refused: there is no way at 11:59:55"
    assert told(6.0) == (
        "Orders: 1 waiting, 1 refused",
        ["fetch no robot is free given 11:59:52", off],
    )
    assert told(12.0)[1][0] == "fetch R1 arrives about 12:00:04"
    assert tab.run("document.getElementById('day').textContent") == "12:00:02"
    assert "· fetch" in tab.run("document.querySelector('#robots li').innerText")
    told(14.0)
    assert "· fetch" in tab.run("document.querySelector('#robots li').innerText")
    assert told(15.5)[1][0] == "fetch R1 is at the goal, 1.0 s late at 12:00:05"
    assert told(17.0) == (
        "Orders: 1 under way, 1 done, 1 refused",
        [
            "next R1 arrives about 12:00:20",
            "fetch R1 was there, 1.0 s late at 12:00:05",
            off,
        ],
    )
    assert "aside R2 makes room for R1 about 12:00:15" in told(19.0)[1]
    assert tab.errors == []


@pytest.mark.parametrize("dark", [False, True])
@pytest.mark.parametrize("width", [320, 390, 800, 1920])
def test_nothing_scrolls_sideways(page, width, dark):
    page.screen(width, 844, dark)
    page.settle()
    assert page.run("document.documentElement.scrollWidth") <= width
    sizes = page.run(
        "['floor', 'diagram'].map(id => document.getElementById(id).getBoundingClientRect().width)"
    )
    assert min(sizes) > 0.4 * min(width, 600)


@needs_axe
@pytest.mark.parametrize("dark", [False, True])
@pytest.mark.parametrize("width", [390, 1920])
def test_axe_finds_nothing_that_keeps_anybody_out(page, width, dark):
    page.screen(width, 1080, dark)
    page.run("splinefleet.seek(2.2)")
    page.settle()
    assert page.violations() == []


def test_a_hundred_robots_are_drawn_in_a_fiftieth_of_a_second(tab, folder):
    document = plan_scenario(generate("open", 100, 3), effort=0)
    (folder / "hundred.html").write_text(page_of(scene_of_plan(document)))
    tab.errors.clear()
    tab.screen(1920, 1080)
    tab.open((folder / "hundred.html").as_uri())
    times = tab.run(
        "(() => { const took = []; for (let i = 0; i < 60; i++) {"
        " splinefleet.seek(i / 3); const begin = performance.now(); splinefleet.draw();"
        " took.push(performance.now() - begin); } return took; })()"
    )
    assert sorted(times)[len(times) // 2] < 10.0
    before = tab.layouts()
    tab.run(
        "(() => { for (let i = 0; i < 60; i++) {"
        " splinefleet.seek(i / 3); splinefleet.draw(); } })()"
    )
    assert tab.layouts() - before < 30, "frames are drawn without laying out the page"
    assert tab.errors == []


def test_the_pictures_of_docs_page(tab, tmp_path):
    """With PICTURES=docs/img they are written there."""
    five = ROOT / "examples" / "paper_five.toml"
    splinefleet("simulate", five, "--fault", "kill:R3@8", "--out", tmp_path / "run")
    made = splinefleet("plot", tmp_path / "run" / "run.mcap", "-o", tmp_path / "run.html")
    assert made.returncode == 0, made.stderr
    pictures = Path(os.environ.get("PICTURES", tmp_path))
    told = "document.getElementById('robots').innerText"
    tab.screen(1440, 900)
    tab.open((tmp_path / "run.html").as_uri())
    tab.run("splinefleet.seek(2.4)")
    tab.wait(f"{told}.includes('waits for')")
    tab.picture(pictures / "page_light.png")
    tab.screen(1440, 900, dark=True)
    tab.run("splinefleet.seek(20.9)")
    tab.wait(f"{told}.includes('held by R3')")
    tab.picture(pictures / "page_dark.png")


def test_view_serves_the_page(tab, folder):
    with started("view", folder / "plan.json", "--no-open") as process:
        address = line_with(process, "http://").strip()
        tab.errors.clear()
        tab.asked.clear()
        tab.open(address)
        assert json.dumps(tab.errors) == "[]"
        assert tab.asked == [address]
        assert set(tab.run("splinefleet.at(3)")) == {"R1", "R2", "R3", "R4", "R5"}
        process.send_signal(signal.SIGINT)
        assert process.wait(timeout=10.0) == 130


def test_a_running_fleet_is_followed(tab, tmp_path):
    (tmp_path / "two.toml").write_text(TWO_ROBOTS)
    endpoint = free_endpoint()
    with ExitStack() as stack:
        coordinator = stack.enter_context(
            started("coordinator", tmp_path / "two.toml", "--listen", endpoint, "--effort", "0")
        )
        view = stack.enter_context(started("view", "--connect", endpoint, "--no-open"))
        address = line_with(view, "http://").strip()
        tab.errors.clear()
        tab.open(address)
        assert tab.run("Object.keys(splinefleet.at(0)).length") == 0
        for robot in ("R1", "R2"):
            stack.enter_context(started("agent", robot, "--connect", endpoint))
        tab.wait("splinefleet.time > 1 && splinefleet.at(splinefleet.time).R1?.v > 0.1")
        told = tab.run("[splinefleet.time, splinefleet.at(splinefleet.time)]")
        document = plan_scenario(read_scenario(tmp_path / "two.toml"), effort=0)
        one = drive(document)[0]
        true = one.curve.at_arc([one.timeline.s_at(told[0])])[0]
        assert math.dist((told[1]["R1"]["x"], told[1]["R1"]["y"]), true) < 0.002
        tab.wait(
            "Object.values(splinefleet.at(splinefleet.time)).every(r => r.state === 'arrived')"
        )
        assert coordinator.wait(timeout=30.0) == 0
        assert tab.errors == []
