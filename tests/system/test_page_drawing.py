"""What the page draws on the floor, pixel by pixel and word by word."""

import msgspec
import pytest

from coordinator.planning.planner import plan_scenario
from coordinator.view.page import page_of
from coordinator.view.scene_plan import scene_of_plan
from sim.floors.generator import generate
from tests.system.browser import browser, find_browser
from tests.system.floor_words import WORDS

pytestmark = pytest.mark.skipif(
    find_browser() is None, reason="no Chromium is installed (BROWSER names one)"
)


@pytest.fixture(scope="module")
def scene():
    return scene_of_plan(plan_scenario(generate("warehouse", 17, 1), effort=0))


@pytest.fixture
def tab(tmp_path):
    with browser(tmp_path / "profile") as tab:
        yield tab


def show(tab, folder, scene, *, dark=False):
    (folder / "page.html").write_text(page_of(scene))
    tab.screen(1280, 720, dark)
    tab.open((folder / "page.html").as_uri())


def test_names_of_robots_are_whole_and_hide_no_other_name(tab, tmp_path, scene):
    show(tab, tmp_path, scene)
    size = "(b => [b.width, b.height])(document.getElementById('floor').getBoundingClientRect())"
    width, height = tab.run(size)
    for t in range(0, int(scene.end), 2):
        tab.run(f"splinefleet.seek({t})")
        words = tab.run(WORDS)
        assert len(words) == 17
        for number, (text, x, wide, y) in enumerate(words):
            assert 0 < x < width - wide, (text, t)
            assert 5 < y < height - 5, (text, t)
            for other, left, long, at in words[:number]:
                clear = abs(y - at) >= 11 or x >= left + long or left >= x + wide
                assert clear, (text, other, t)


def test_shelves_that_adjoin_have_no_seam(tab, tmp_path, scene):
    x = scene.boundary[0][0] + 2.0037
    one = [(x - 1.0, 2.0), (x, 2.0), (x, 4.0), (x - 1.0, 4.0)]
    two = [(x, 2.0), (x, 4.0), (x + 1.0, 4.0), (x + 1.0, 2.0)]  # turned the other way
    over = [(x + 0.5, 2.0), (x + 1.5, 2.0), (x + 1.5, 4.0), (x + 0.5, 4.0)]
    found = msgspec.structs.replace(scene, robots=[], epochs=[], obstacles=[one, two, over])
    show(tab, tmp_path, found, dark=True)
    (x0, y0), (x1, y1) = scene.boundary[0], scene.boundary[2]
    places = [x1 - x0, y1 - y0, (x0 + x1) / 2, (y0 + y1) / 2, x - 1.0, x + 1.5]
    pixels = tab.run(
        "((c, [wide, tall, x, y, begin, end]) => {"
        " const z = Math.min((c.width - 20) / wide, (c.height - 20) / tall);"
        " const X = at => c.width / 2 + z * (at - x), row = Math.round(c.height / 2 - z * (3 - y));"
        " const from = Math.ceil(X(begin)) + 1, size = Math.floor(X(end)) - 1 - from;"
        " return [...c.getContext('2d').getImageData(from, row, size, 1).data]; })"
        f"(document.getElementById('floor'), {places})"
    )
    assert len(pixels) > 300
    assert len({tuple(pixels[i : i + 4]) for i in range(0, len(pixels), 4)}) == 1
    assert tuple(pixels[:3]) == (0x34, 0x3D, 0x49)
