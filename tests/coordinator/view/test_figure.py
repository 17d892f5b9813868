import math
import re
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import msgspec
import numpy as np
import pytest
from matplotlib.figure import Figure

from coordinator.base.errors import InputError
from coordinator.plan.document import Crossing, Floor, PlanDocument, Proof, Reason, RobotPlan, Stop
from coordinator.plan.document import Path as PlanPath
from coordinator.view.figure import draw_plan
from coordinator.view.figure_floor import draw_floor
from coordinator.view.figure_labels import Labels
from coordinator.view.figure_robots import picture_robots, style_of
from coordinator.view.figure_selection import Left, View
from coordinator.view.figure_waits import draw_wait, longest_waits, nearest_within


def straight(name, start, goal, *, begins=0.0, radius=0.2, speed=0.5, stops=()):
    """A robot that starts and stops at once on a straight path; stops are (s, until, for whom)."""
    length = math.dist(start, goal)
    points = [
        tuple(a + part / 3 * (b - a) for a, b in zip(start, goal, strict=True)) for part in range(4)
    ]
    planned, late = [], begins
    for s, until, owner in stops:
        arrive = s / speed + late
        planned.append(Stop(s=s, arrive=arrive, depart=until, yields_to=owner))
        late += until - arrive
    return RobotPlan(
        id=name,
        radius=radius,
        start_time=begins,
        finish_time=length / speed + late,
        length=length,
        path=PlanPath(
            degree=3, knots=[0.0] * 4 + [1.0] * 4, control_points=points, weights=[1.0] * 4
        ),
        profile=[(0.0, speed), (length, speed)],
        stops=planned,
        wire_bytes=0,
    )


EAST = straight("East-1", (1.0, 5.0), (9.0, 5.0))
NORTH = straight("North_2", (5.0, 1.0), (5.0, 9.0), stops=[(2.5, 9.5, "East-1")])
LATE = straight("Late.3", (7.0, 9.0), (7.0, 1.0), begins=9.0, radius=0.4)
DOCUMENT = PlanDocument(
    scenario="three & a <cross>",
    epoch=1,
    policy="safe",
    tau=1.0,
    margin=0.05,
    robots=[EAST, NORTH, LATE],
    crossings=[
        Crossing(
            a="East-1",
            b="North_2",
            x=5.0,
            y=5.0,
            s_a=4.0,
            s_b=4.0,
            t_a=8.0,
            t_b=12.5,
            verdict="North_2 stops 4.5 s",
        )
    ],
    proof=Proof(holds=True, pairs=3, least_separation=0.5, least_clearance=0.6, survives=["late"]),
    workspace=Floor(
        boundary=[(0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0)],
        obstacles=[[(1.0, 1.0), (3.0, 1.0), (2.0, 3.0)]],
    ),
)


REASON = Reason(
    robot="North_2",
    s=2.5,
    wait=4.5,
    yields_to="East-1",
    zone=(3.4, 4.6),
    their_zone=(3.4, 4.6),
    otherwise=1.04,
)


def replace(**changes):
    return msgspec.structs.replace(DOCUMENT, **changes)


def words(svg):
    """All pieces of text of an SVG file."""
    root = ElementTree.parse(svg).getroot()
    return ["".join(node.itertext()) for node in root.iter("{http://www.w3.org/2000/svg}text")]


@pytest.fixture(scope="module")
def svg(tmp_path_factory):
    out = tmp_path_factory.mktemp("figure") / "plan.svg"
    draw_plan(DOCUMENT, out)
    return out


def test_an_svg_names_every_robot_its_waits_and_the_verdicts(svg):
    said = words(svg)
    for robot in DOCUMENT.robots:
        assert {robot.id, f"{robot.id} goal"} <= set(said)
    assert "North_2 stops 4.5 s" in said
    assert "4.5 s for East-1" in said
    assert "North_2 waits 4.5 s for East-1" in said
    assert "Late.3 waits 9.0 s" in said


def test_the_headline_says_the_terms_and_the_proof(svg):
    said = words(svg)
    assert "three & a <cross>" in said
    assert "policy safe  ·  tau 1 s  ·  margin 0.05 m" in said
    proven = next(text for text in said if text.startswith("proof holds"))
    assert "least separation 0.500 m" in proven
    assert "least clearance 0.600 m" in proven
    assert "tightest pair" not in proven
    assert proven.endswith("survives a late robot")


@pytest.mark.parametrize(
    ("slack", "side"),
    [(0.0046, "4.6 mm above"), (-0.012, "12.0 mm below"), (2.3205, "2.32 m above")],
)
def test_the_headline_tells_the_tightest_pair_from_the_least_separation(tmp_path, slack, side):
    proof = msgspec.structs.replace(DOCUMENT.proof, least_slack=slack)
    draw_plan(replace(proof=proof, robots=[EAST], crossings=[]), tmp_path / "plan.svg")
    proven = next(text for text in words(tmp_path / "plan.svg") if text.startswith("proof holds"))
    assert f"least separation 0.500 m  ·  tightest pair {side} its need" in proven


def test_the_same_plan_gives_the_same_bytes_of_svg(svg, tmp_path):
    draw_plan(DOCUMENT, tmp_path / "again.SVG")
    assert (tmp_path / "again.SVG").read_bytes() == svg.read_bytes()
    assert not re.search(rb"<dc:date>", svg.read_bytes())


def test_a_png_is_legible_at_1600_pixels(tmp_path):
    draw_plan(replace(robots=[EAST], crossings=[]), tmp_path / "plan.png")
    written = (tmp_path / "plan.png").read_bytes()
    assert written.startswith(b"\x89PNG\r\n")
    assert int.from_bytes(written[16:20], "big") >= 1600


def test_a_plan_without_floor_and_proof_is_drawn_and_called_not_proven(tmp_path):
    out = tmp_path / "bare.svg"
    draw_plan(replace(workspace=None, proof=None, robots=[EAST, NORTH]), out)
    assert "not proven" in words(out)


def test_a_plan_whose_proof_fails_says_not_to_drive_it(tmp_path):
    proof = Proof(holds=False, pairs=1, least_separation=0.1, least_clearance=None, survives=[])
    out = tmp_path / "bad.svg"
    draw_plan(replace(proof=proof, policy="paper", robots=[EAST]), out)
    assert any("PROOF FAILS" in text for text in words(out))


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("plan.pdf", r"\.svg or \.png, a page in \.html, not in '\.pdf'"),
        ("plan", "not in ''"),
        ("plan.html", "must end in .svg or .png"),
        ("no/such/folder/plan.svg", "No such file"),
    ],
)
def test_a_file_that_cannot_be_written_is_refused_in_one_line(tmp_path, name, sentence):
    with pytest.raises(InputError, match=sentence) as caught:
        draw_plan(replace(robots=[EAST], crossings=[]), tmp_path / name)
    assert len(caught.value.problems) == 1
    assert list(tmp_path.iterdir()) == []


def test_a_plan_without_robots_is_refused(tmp_path):
    with pytest.raises(InputError, match="no robots"):
        draw_plan(replace(robots=[]), tmp_path / "plan.svg")


def test_matplotlib_is_not_imported_before_a_picture_is_drawn():
    check = "import sys, coordinator.view.figure; sys.exit('matplotlib' in sys.modules)"
    home = Path(__file__).parents[3]
    assert subprocess.run([sys.executable, "-c", check], cwd=home, check=False).returncode == 0


def test_forbidden_places_agree_with_a_naive_search_over_lateness():
    robots = picture_robots(DOCUMENT)
    times, places = np.linspace(0.0, 20.0, 41), np.linspace(0.0, 8.0, 17)
    found = nearest_within(robots["North_2"], robots["East-1"], 1.0, times, places)
    for column in range(0, 41, 5):
        for row in range(0, 17, 3):
            late = [times[column] + shift for shift in (-1.0, -0.5, 0.0, 0.5, 1.0)]
            theirs = [(1.0 + 0.5 * min(max(t, 0.0), 16.0), 5.0) for t in late]
            expected = min(math.dist((5.0, 1.0 + places[row]), place) for place in theirs)
            assert found[row, column] == pytest.approx(expected, abs=1e-4)


def test_times_that_lie_together_are_all_within_tau():
    robots = picture_robots(DOCUMENT)
    times, places = np.linspace(0.0, 1e-320, 5), np.linspace(0.0, 8.0, 17)
    found = nearest_within(robots["North_2"], robots["East-1"], 1.0, times, places)
    assert found.shape == (17, 5)
    assert np.isfinite(found).all()


def test_the_robots_that_wait_longest_get_a_panel_at_most_six():
    late = [straight(f"R{i}", (0.0, i), (9.0, i), begins=0.5 * i) for i in range(9)]
    chosen = longest_waits(picture_robots(replace(robots=late, crossings=[])))
    assert [robot.id for robot in chosen] == ["R3", "R4", "R5", "R6", "R7", "R8"]


def test_thirty_two_robots_look_different():
    fleet = [straight(f"R{i}", (0.0, i), (9.0, i)) for i in range(32)]
    robots = picture_robots(replace(robots=fleet, crossings=[]))
    assert len({(robot.colour, robot.dash) for robot in robots.values()}) == 32


def test_labels_at_one_place_do_not_cover_each_other():
    axes = Figure(figsize=(6, 6)).add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set(xlim=(0.0, 10.0), ylim=(0.0, 10.0))
    labels = Labels(axes, np.array([[5.0, 5.0]]))
    placed = [labels.place(f"R{i} stops", (5.0, 5.0), size=8.0, colour="k") for i in range(12)]
    assert all(placed)
    boxes = [text.get_window_extent().padded(-0.5) for text in axes.texts]
    for index, box in enumerate(boxes):
        assert not any(box.overlaps(other) for other in boxes[index + 1 :])


def test_an_optional_label_without_room_is_left_out():
    axes = Figure(figsize=(1, 1)).add_axes((0.0, 0.0, 1.0, 1.0))
    labels = Labels(axes, np.empty((0, 2)))
    assert not labels.place(
        "wider than all there is", (0.5, 0.5), size=9, colour="k", optional=True
    )
    assert len(axes.texts) == 0


def test_labels_keep_off_marks_and_off_the_lines_to_other_labels():
    axes = Figure(figsize=(6, 6)).add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set(xlim=(0.0, 10.0), ylim=(0.0, 10.0))
    dice = np.random.default_rng(1)
    marks = 5.0 + dice.uniform(-0.6, 0.6, (40, 2))
    labels = Labels(axes, np.empty((0, 2)), marks)
    placed = [
        labels.place(f"R{i} stops 12.5 s", tuple(marks[i]), size=7.0, colour="k", optional=True)
        for i in range(20)
    ]
    assert 3 <= sum(placed) == len(axes.texts)
    boxes = [text.get_window_extent().padded(-0.5) for text in axes.texts]
    for index, box in enumerate(boxes):
        assert box.count_contains(axes.transData.transform(marks)) == 0
        assert not any(box.overlaps(other) for other in boxes[index + 1 :])
        for line in axes.lines:
            assert not line.get_path().transformed(axes.transData).intersects_bbox(box)


@pytest.mark.parametrize("count", [5, 17])
def test_no_label_on_a_crowded_floor_covers_another_or_a_crossing(count):
    angles = [2.0 * math.pi * i / count for i in range(count)]
    ends = [(5.0 + 4.0 * math.cos(a), 5.0 + 4.0 * math.sin(a)) for a in angles]
    fleet = [
        straight(f"R{i + 1}", (x, y), (10.0 - x, 10.0 - y), stops=[(3.0, 9.0 + 2.0 * i, "R1")])
        for i, (x, y) in enumerate(ends)
    ]
    met = [
        Crossing(
            a="R1", b=robot.id, x=5.0, y=5.0, s_a=4.0, s_b=4.0, t_a=8.0, t_b=9.0, verdict=verdict
        )
        for robot in fleet[1:]
        for verdict in (f"{robot.id} stops 9.0 s", f"{robot.id} starts 9.0 s later")
    ]
    document = replace(robots=fleet, crossings=met, workspace=None)
    axes = Figure(figsize=(7.4, 7.4), dpi=150).add_axes((0.0, 0.0, 1.0, 1.0))
    draw_floor(axes, document, picture_robots(document))
    boxes = [text.get_window_extent().padded(-0.5) for text in axes.texts if text.get_text()]
    said = {text.get_text() for text in axes.texts}
    assert {f"R{i + 1}" for i in range(count)} <= said
    centre = axes.transData.transform((5.0, 5.0))
    for index, box in enumerate(boxes):
        assert not box.contains(*centre)
        assert not any(box.overlaps(other) for other in boxes[index + 1 :])


def test_a_panel_says_what_the_other_way_round_would_cost_and_shades_what_forces_the_wait():
    document = replace(waits=[REASON])
    robots = picture_robots(document)
    axes = Figure(figsize=(4.5, 2.7)).add_axes((0.0, 0.0, 1.0, 1.0))
    draw_wait(axes, robots["North_2"], robots, document)
    assert "other way round: East-1 +1.0 s" in {text.get_text() for text in axes.texts}
    assert sum(shade.get_gid() == "forbidden" for shade in axes.collections) == 1


def test_names_of_robots_in_the_way_do_not_cover_each_other_and_who_is_waited_for_is_named():
    fleet = [straight("R0", (0.0, 5.0), (10.0, 5.0), stops=[(3.0, 40.0, "R7")])]
    fleet += [
        straight(f"R{i}", (6.0, 0.0), (6.0, 10.0), begins=2.5 * i, radius=0.3) for i in range(1, 12)
    ]
    document = replace(robots=fleet, crossings=[])
    robots = picture_robots(document)
    axes = Figure(figsize=(4.5, 2.7)).add_axes((0.0, 0.0, 1.0, 1.0))
    draw_wait(axes, robots["R0"], robots, document)
    names = [text for text in axes.texts if text.get_text()]
    assert "R7" in {text.get_text() for text in names}
    boxes = [text.get_window_extent() for text in names]
    for index, box in enumerate(boxes):
        assert not any(box.overlaps(other) for other in boxes[index + 1 :])


def test_a_robot_keeps_its_colour_when_another_one_has_no_part_any_more(tmp_path):
    document = replace(robots=[EAST, LATE], crossings=[])
    left = Left("North_2", "lost", (5.0, 3.0), 0.2)
    view = View(fleet=("East-1", "North_2", "Late.3"), left=(left,))
    before, after = picture_robots(DOCUMENT), picture_robots(document, view)
    assert {name: robot.colour for name, robot in after.items()} == {
        name: before[name].colour for name in ("East-1", "Late.3")
    }
    draw_plan(document, tmp_path / "k.svg", view)
    svg = (tmp_path / "k.svg").read_text()
    assert "North_2, lost" in svg
    ring = svg[svg.index('id="left"') :]
    assert f"stroke: {style_of(1).colour}" in ring[: ring.index("</g>")]


def test_the_caption_explains_only_what_is_drawn(tmp_path):
    for waits, explained in (([], False), ([REASON], True)):
        draw_plan(replace(waits=waits), tmp_path / "waits.svg")
        svg = (tmp_path / "waits.svg").read_text()
        assert "Shaded: where and when the waiting robot" in svg
        assert ("strongly" in svg) == explained
        assert ("Other way round" in svg) == explained
