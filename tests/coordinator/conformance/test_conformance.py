"""The examination of a robot: the Python agent holds, and what is broken is found and named."""

import re
from pathlib import Path

import pytest

from coordinator.conformance.exchanges import EXCHANGES, RESTART
from coordinator.conformance.requirements import REQUIREMENTS
from coordinator.conformance.track import judge_track
from coordinator.conformance.wire_forms import in_long_forms, plain, spoilt, with_later_fields
from protocol.codec import KINDS, decode
from protocol.messages import Clock, Command
from robot_agent.service import RobotService
from sim.world.body import SimulatedBody
from tests.coordinator.conformance.broken_robots import (
    BROKEN,
    Braggart,
    Fragile,
    Silent,
    Startled,
    Strict,
    Unbounded,
)
from tests.coordinator.conformance.rooms import examine, failures, verdicts
from tests.protocol.test_wire_format import a_plan

PAGE = Path(__file__).resolve().parents[3] / "docs" / "protocol.md"


def test_the_python_agent_does_all_that_it_must_and_should():
    examiner = examine()
    assert failures(examiner) == {}
    assert examiner.conforms


@pytest.mark.parametrize("broken", BROKEN, ids=lambda broken: broken.__name__)
def test_a_robot_that_breaks_a_requirement_is_found_out_by_its_number(broken):
    number, exchange = BROKEN[broken]
    examiner = examine(broken, [exchange])
    assert verdicts(examiner)[number] == "fails"
    assert not examiner.conforms


@pytest.mark.parametrize("broken", [Startled, Strict, Fragile, Silent])
def test_what_one_requirement_breaks_is_not_blamed_on_others(broken):
    number, _ = BROKEN[broken]
    found = verdicts(examine(broken))
    assert [one for one, verdict in found.items() if verdict == "fails"] == [number]


def test_a_robot_that_is_started_again_has_another_boot_id_and_waits_for_a_plan():
    examiner = examine(names=["it is frozen"], restart=RobotService)
    assert verdicts(examiner)["HELLO-2"] == "holds"
    assert examiner.conforms


def test_a_robot_that_keeps_its_boot_id_when_it_is_started_again_is_found_out():
    def again(*args, boot, **options):
        return RobotService(*args, boot=boot - 1, **options)

    examiner = examine(names=["it is frozen"], restart=again)
    assert failures(examiner)["HELLO-2"] == ("has the boot id that it had before",)
    assert not examiner.conforms


def test_a_robot_that_says_nothing_does_not_conform():
    class Mute(RobotService):
        def _speak(self, now_ns):
            pass

    examiner = examine(Mute)
    assert not examiner.conforms
    assert set(verdicts(examiner).values()) == {"not tried"}


def test_a_should_that_does_not_hold_is_told_but_costs_no_conformance():
    class Uncounted(RobotService):
        def _speak(self, now_ns):
            self._hellos = -1
            super()._speak(now_ns)

    examiner = examine(Uncounted, ["zz"])
    assert list(failures(examiner)) == ["HELLO-3"]
    assert examiner.conforms


def test_the_black_box_of_the_python_agent_shows_nothing_else():
    rows = []
    examiner = examine(rows=rows)
    judge_track(examiner.exam, rows)
    judge_track(examiner.exam, rows[::100])
    assert failures(examiner) == {}
    assert verdicts(examiner)["GO-3"] == "holds"


class Astray(SimulatedBody):
    """Believes itself 5 cm from where it is, once it has moved."""

    gone = 0.0

    def pose(self):
        pose = super().pose()
        self.gone = min(self.gone + 1e-4, 0.05) if self.speed else self.gone
        return None if pose is None else (pose[0] + self.gone, *pose[1:])


def test_a_black_box_shows_that_a_robot_is_off_its_path():
    rows = []
    examiner = examine(names=["it drives a course", "its authority"], body=Astray(0.5), rows=rows)
    assert examiner.conforms
    judge_track(examiner.exam, rows)
    assert "GO-3" in failures(examiner)


def test_a_black_box_tells_a_robot_that_passes_its_authority_from_one_that_says_so():
    for robot, other in ((Unbounded, "LATE-1"), (Braggart, "AUTH-1")):
        rows = []
        examiner = examine(robot, ["its authority ends"], rows=rows)
        judge_track(examiner.exam, rows)
        number, _ = BROKEN[robot]
        assert any("black box" in text for text in failures(examiner)[number])
        assert other not in failures(examiner)


def test_the_requirements_are_those_of_the_page():
    rows = re.findall(r"^\| ([A-Z]+-\d) \| (.*?) \| (.*?) \|", PAGE.read_text(), re.M)
    assert {number: (text, section) for number, text, section in rows} == REQUIREMENTS


@pytest.mark.parametrize("message", [a_plan(), Command(1, 2, 3, 4, 1, 5, 6), Clock(1, 2, 3, 4)])
def test_other_forms_of_a_message_say_the_same_and_spoilt_ones_nothing(message):
    (kind,) = [kind for kind, types in KINDS.items() if type(message) in types]
    forms = [form(message) for form in (plain, with_later_fields, in_long_forms)]
    assert len(set(forms)) == 3
    assert [decode(kind, payload) for payload in forms] == [message] * 3
    assert {decode(kind, payload) for payload in spoilt(message)} == {None}


def test_the_page_on_conformance_has_every_exchange_and_names_what_is_not_tried():
    page = PAGE.with_name("conformance.md").read_text()
    rows = re.findall(r"^\| (.*?) \| ([A-Z, 0-9-]+) \|$", page, re.M)
    exchanges = (*EXCHANGES, RESTART)
    assert rows == [(exchange.name, ", ".join(exchange.tries)) for exchange in exchanges]
    tried = {number for exchange in exchanges for number in exchange.tries}
    assert set(REQUIREMENTS) - tried == {"LATE-3", "OVER-1", "GO-3"}


def test_a_black_box_of_an_examination_that_broke_off_before_the_first_drive_says_nothing():
    examiner = examine(names=["zz"])
    assert examiner.exam.drives == []
    judge_track(examiner.exam, [(0.0, 0.0, 0.0)])
    assert failures(examiner) == {}
