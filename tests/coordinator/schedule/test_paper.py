"""Table 1 of the paper: what it says, what follows from it, and what our floor makes of it.

The oracle is the table itself (tests/golden/table1.csv, digit for digit as printed, misprints
included); no number is bent to match one.
"""

import csv
import math
from itertools import pairwise
from pathlib import Path

import pytest
from msgspec.structs import replace

from coordinator.plan.document import PlanDocument
from coordinator.planning.planner import plan_scenario
from coordinator.scenario_files.scenario_reader import read_scenario
from coordinator.schedule.paper_policy import Encounter, algorithm_2

ROOT = Path(__file__).parents[3]
TABLE = ROOT / "tests" / "golden" / "table1.csv"
STOP_TIME, TAU = 2.0, 0.5

INCONSISTENT = {
    ("R1", "R1-R3"): 2.49,
    ("R1", "R1-R4"): 2.50,
    ("R1", "R1-R5"): 3.00,
    ("R4", "R1-R4"): 2.00,
}
"""(robot, crossing): printed time less d / V [s]."""

IMPOSSIBLE = {
    ("R3", "R3-R5", "R1-R3"): (0.96, 2.81),
    ("R3", "R1-R3", "R3-R4"): (13.33, 15.17),
    ("R4", "R4-R5", "R1-R4"): (13.33, 13.44),
    ("R5", "R3-R5", "R2-R5"): (51.07, 52.48),
}
"""(robot, from, to): printed arc length, straight line between the printed points [dm]."""

UNREACHABLE = {("R3", "R1-R3"): -0.38, ("R5", "R2-R5"): +0.16}
"""Arc lengths that no curve through the points can have: ours less the printed one [m]."""


def rows():
    with TABLE.open(encoding="utf-8") as table:
        return [row for row in csv.DictReader(table) if row["x_dm"]]


def pairs_without_crossing():
    with TABLE.open(encoding="utf-8") as table:
        return {tuple(row["pair"].split("-")) for row in csv.DictReader(table) if not row["x_dm"]}


def entries():
    """Yield (robot, crossing, arc length [dm], speed [m/s], printed time [s]): 16 of them."""
    for row in rows():
        for robot, side in zip(row["pair"].split("-"), "ip", strict=True):
            d, v = float(row[f"d_{side}_dm"]), float(row[f"v_{side}_mps"])
            yield robot, row["pair"], d, v, float(row[f"t_{side}_s_printed"])


def encounters():
    return [
        Encounter(
            *(int(robot[1:]) for robot in row["pair"].split("-")),
            *(0.1 * float(row[key]) for key in ("d_i_dm", "d_p_dm")),
            *(float(row[key]) for key in ("v_i_mps", "v_p_mps")),
        )
        for row in rows()
    ]


def stopped(*, slower_first=False):
    verdicts = algorithm_2(encounters(), STOP_TIME, TAU, slower_first=slower_first)
    return [(v.encounter.i, v.encounter.p, v.stops) for v in verdicts if v.stops is not None]


def arc_lengths(plan):
    """Return the planned arc lengths [m] by robot and crossing."""
    ours = {(c.a, f"{c.a}-{c.b}"): c.s_a for c in plan.crossings}
    return ours | {(c.b, f"{c.a}-{c.b}"): c.s_b for c in plan.crossings}


@pytest.fixture(scope="module")
def scenario():
    return read_scenario(ROOT / "examples" / "paper_five.toml")


@pytest.fixture(scope="module")
def plan(scenario) -> PlanDocument:
    return plan_scenario(scenario)


def test_twelve_of_the_sixteen_printed_times_follow_from_arc_length_and_speed():
    consistent = [entry for entry in entries() if entry[:2] not in INCONSISTENT]
    assert len(consistent) == 12
    for robot, pair, d, v, printed in consistent:
        assert 0.1 * d / v == pytest.approx(printed, abs=0.01), (robot, pair)


def test_the_other_four_printed_times_contradict_arc_length_and_speed():
    found = {
        (robot, pair): printed - 0.1 * d / v
        for robot, pair, d, v, printed in entries()
        if abs(printed - 0.1 * d / v) > 0.01
    }
    assert found == pytest.approx(INCONSISTENT, abs=0.01)


def test_four_printed_arc_lengths_are_shorter_than_the_straight_line():
    places = {row["pair"]: (float(row["x_dm"]), float(row["y_dm"])) for row in rows()}
    found = {}
    for robot in ("R1", "R2", "R3", "R4", "R5"):
        stations = sorted((d, pair) for who, pair, d, _, _ in entries() if who == robot)
        for (d0, start), (d1, end) in pairwise(stations):
            chord = math.dist(places[start], places[end])
            if d1 - d0 < chord - 0.05:
                found[robot, start, end] = (d1 - d0, chord)
    assert found.keys() == IMPOSSIBLE.keys()
    for key, lengths in found.items():
        assert lengths == pytest.approx(IMPOSSIBLE[key], abs=0.006)


def test_algorithm_2_as_written_stops_r2_for_r1_and_then_r4_for_r1():
    assert stopped() == [(1, 2, 2), (1, 4, 4)]


def test_algorithm_2_with_the_tables_priority_stops_r1_once_and_not_twice_as_printed():
    assert [row["pair"] for row in rows() if "stops" in row["verdict_printed"]] == [
        "R1-R2",
        "R1-R4",
    ]
    assert stopped(slower_first=True) == [(1, 2, 1)]
    at_r14 = algorithm_2(encounters(), STOP_TIME, TAU, slower_first=True)[2]
    assert at_r14.t_i - at_r14.t_p == pytest.approx(1.93, abs=0.01)


def test_algorithm_2_counts_a_stop_that_lies_behind_the_crossing():
    at_r45 = algorithm_2(encounters(), STOP_TIME, TAU)[-1]
    r4 = {pair: d for robot, pair, d, _, _ in entries() if robot == "R4"}
    assert r4["R4-R5"] < r4["R1-R4"]
    assert at_r45.t_i == pytest.approx(0.1 * r4["R4-R5"] / 0.4 + STOP_TIME)


def test_robots_that_meet_at_equal_speed_stop_the_first_named_either_way():
    meeting = [Encounter(1, 2, 1.0, 1.0, 0.5, 0.5)]
    for slower_first in (False, True):
        assert algorithm_2(meeting, STOP_TIME, TAU, slower_first=slower_first)[0].stops == 1


def test_the_planned_paths_cross_within_a_centimetre_of_the_printed_points(plan):
    printed = {tuple(row["pair"].split("-")): row for row in rows()}
    assert [(c.a, c.b) for c in plan.crossings] == list(printed)
    assert pairs_without_crossing() == {("R2", "R3"), ("R2", "R4")}
    for crossing in plan.crossings:
        row = printed[crossing.a, crossing.b]
        place = (0.1 * float(row["x_dm"]), 0.1 * float(row["y_dm"]))
        assert math.dist((crossing.x, crossing.y), place) < 0.01, row["pair"]


def test_the_planned_arc_lengths_are_the_printed_ones_where_a_curve_can_have_them(plan):
    ours = arc_lengths(plan)
    for robot, pair, d, _, _ in entries():
        expected = 0.1 * d + UNREACHABLE.get((robot, pair), 0.0)
        assert ours[robot, pair] == pytest.approx(expected, abs=0.02), (robot, pair)


def test_robots_start_the_printed_arc_length_before_their_first_printed_crossing(plan):
    ours = arc_lengths(plan)
    for name in ("R1", "R2", "R3", "R4", "R5"):
        d, pair = min((d, pair) for robot, pair, d, _, _ in entries() if robot == name)
        assert ours[name, pair] == pytest.approx(0.1 * d, abs=0.005)


def test_our_safe_plan_of_the_papers_floor_is_proven(plan):
    assert plan.policy == "safe"
    assert plan.proof is not None
    assert plan.proof.holds
    assert plan.proof.pairs == 10
    assert max(robot.finish_time for robot in plan.robots) < 35.0


def test_algorithm_2_on_the_same_floor_fails_its_proof_where_its_own_stop_makes_a_conflict(
    scenario,
):
    document = plan_scenario(replace(scenario, policy="paper"))
    stops = {(robot.id, stop.yields_to) for robot in document.robots for stop in robot.stops}
    assert stops == {("R2", "R1"), ("R4", "R1")}
    assert document.proof is not None
    assert not document.proof.holds
    assert len(document.proof.failures) == 1
    assert document.proof.failures[0].startswith("R2 at ")
    assert " and R5 at " in document.proof.failures[0]


def test_the_real_robots_of_the_same_floor_survive_every_fault_of_the_budget():
    document = plan_scenario(read_scenario(ROOT / "examples" / "paper_five_real.toml"))
    assert document.proof is not None
    assert document.proof.holds
    assert document.proof.survives == ["late", "stop", "coordinator"]
