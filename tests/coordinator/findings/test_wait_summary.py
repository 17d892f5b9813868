"""What people are told about a plan's waits and its tightest pair."""

import io

import msgspec
import pytest
from rich.console import Console

from coordinator.findings import plan_table
from coordinator.findings.wait_summary import waits_of
from coordinator.findings.wait_table import waits_table
from coordinator.plan.document import Proof, Reason
from tests.coordinator.view.test_figure import DOCUMENT
from tests.coordinator.view.test_figure_forbidden import REASON


def waiting(*waits):
    return msgspec.structs.replace(DOCUMENT, waits=list(waits))


def shown(renderable):
    text = io.StringIO()
    Console(file=text, width=100).print(renderable)
    return text.getvalue()


def long_wait(index, **changes):
    return msgspec.structs.replace(REASON, robot=f"R{index}", wait=10.0 + index, **changes)


@pytest.mark.parametrize(
    ("otherwise", "said"),
    [(5.861, "+5.9 s"), (-0.21, "-0.2 s"), (-0.01, "+0.0 s"), (None, "cannot")],
)
def test_the_other_way_round_is_told_as_what_it_costs(otherwise, said):
    (wait,) = waits_of(waiting(msgspec.structs.replace(REASON, otherwise=otherwise, tried=True)))
    assert wait.other_way == said


def test_a_wait_whose_other_way_was_not_tried_says_so():
    told = waits_of(waiting(long_wait(0), long_wait(1, otherwise=None, tried=True)))
    untried = waits_of(waiting(long_wait(0, otherwise=None)))
    assert [wait.other_way for wait in (*told[1:], *untried)] == ["cannot", "not tried"]


def test_a_wait_is_one_line_with_place_length_owner_both_zones_and_cost():
    lines = shown(waits_table(waits_of(waiting(REASON)))).splitlines()
    (line,) = [line for line in lines if "North_2" in line]
    cells = [cell.strip() for cell in line.strip("│").split("│")]
    assert cells == ["North_2", "2.50", "4.50", "East-1", "3.40 to 4.60", "3.40 to 4.60", "+1.0 s"]


def test_a_plan_on_a_terminal_tells_its_ten_longest_waits():
    text = shown(plan_table.render(waiting(*(long_wait(i) for i in range(14)))))
    assert "the 10 longest of 14" in text
    lines = text.splitlines()
    told = [line for line in lines if "East-1" in line and "3.40 to 4.60" in line]
    assert [line.strip("│").split("│")[0].strip() for line in told] == [
        f"R{i}" for i in range(13, 3, -1)
    ]


def test_a_name_that_would_steer_the_terminal_is_quoted():
    wait = msgspec.structs.replace(REASON, yields_to="\x1b[2J")
    assert "\x1b" not in shown(waits_table(waits_of(waiting(wait))))


@pytest.mark.parametrize(
    ("slack", "said"),
    [
        (0.0046, "tightest pair 4.6 mm above its need: R1 and R2"),
        (-0.012, "tightest pair 12.0 mm below its need: R1 and R2"),
        (None, "tightest pair: R1 and R2"),
    ],
)
def test_least_separation_and_tightest_pair_are_told_apart(slack, said):
    proof = Proof(
        holds=True,
        pairs=3,
        least_separation=0.3246,
        least_clearance=None,
        survives=[],
        tightest="R1 and R2",
        least_slack=slack,
    )
    text = shown(plan_table.render_proof(proof))
    assert "3 pairs, least separation 0.3246 m between two centres" in text
    assert said in text


def test_a_wait_at_the_start_is_called_so():
    start = Reason(**{**msgspec.structs.asdict(REASON), "s": 0.0})
    assert "start" in shown(waits_table(waits_of(waiting(start))))
