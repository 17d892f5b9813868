"""Where a run's plans and black boxes are found, whoever started its programs."""

import numpy as np
import pytest

from coordinator.base.errors import InputError
from coordinator.log.log_writer import Attachment
from coordinator.log.recorder import Recorder
from coordinator.plan.plan_file import to_json
from coordinator.planning.planner import plan_scenario
from protocol import keys
from protocol.codec import encode
from protocol.messages import Command
from protocol.phases import GO, HOLD
from protocol.timing import SECOND
from sim.judging.evidence import gather
from sim.judging.judge import judge
from tests.scenarios import a_robot, a_scenario

HALL = a_scenario([a_robot("R1", (1.0, 1.0), (9.0, 7.0)), a_robot("R2", (1.0, 7.0), (1.0, 3.0))])
HEADER = "t,x,y,heading,s,phase\n"


@pytest.fixture(scope="module")
def plans():
    return {epoch: plan_scenario(HALL, effort=0, epoch=epoch) for epoch in (1, 2)}


def attachment(name, content):
    return Attachment(name, "application/octet-stream", content)


def write_log(path, plans, epochs, before=None, name="f", **metadata):
    """A log in which each epoch is in HOLD from 10 s times its number, with GO 2 s later."""
    attached = [attachment(f"plan-{epoch}.json", to_json(plans[epoch])) for epoch in epochs]
    if before is not None:
        attached.append(attachment("resumed.mcap", before.read_bytes()))
    metadata["fleet"] = name
    with Recorder(path, metadata=metadata, wall_offset_ns=0, attachments=attached) as log:
        for epoch in epochs:
            at = 10 * epoch * SECOND
            for phase, start in ((HOLD, 0), (GO, at + 2 * SECOND)):
                command = encode(Command(9, 1, 2 * epoch + phase, epoch, phase, start, at))
                log.record(keys.command(name), command, at)
    return path


def write_boxes(folder):
    folder.mkdir(exist_ok=True)
    for robot in HALL.robots:
        x, y = robot.goal
        (folder / f"{robot.id}.csv").write_text(f"{HEADER}0.0,{x},{y},0,0,done\n")


@pytest.mark.parametrize("place", [".", "blackbox"])
def test_programs_started_one_by_one_are_judged_from_the_logs_plan(tmp_path, plans, place):
    log = write_log(tmp_path / "run.mcap", plans, (1, 2))
    write_boxes(tmp_path / place)
    for source in (tmp_path, log):
        found = gather(source)
        assert found.document == plans[1]
        assert [(one.document.epoch, one.begin, one.start) for one in found.later] == [(2, 8, 10)]
        assert sorted(found.boxes) == ["R1", "R2"]
        assert np.array_equal(found.boxes["R1"].places, [HALL.robots[0].goal])
    assert [robot.arrived for robot in judge(tmp_path).robots] == [True, True]


def test_a_log_that_goes_on_from_another_tells_the_epochs_of_both(tmp_path, plans):
    first = write_log(tmp_path / "first.mcap", plans, (1,))
    second = write_log(tmp_path / "second.mcap", plans, (2,), before=first)
    write_boxes(tmp_path)
    found = gather(second)
    assert found.document.epoch == 1
    assert [one.document.epoch for one in found.later] == [2]


def test_a_folder_is_judged_by_the_log_that_resumes_the_other_whatever_their_names(tmp_path, plans):
    first = write_log(tmp_path / "first.mcap", plans, (1,), boot="9")
    write_log(tmp_path / "second.mcap", plans, (2,), before=first, boot="10")
    write_boxes(tmp_path)
    (tmp_path / "export.mcap").write_bytes(b"not a log")
    found = gather(tmp_path)
    assert found.document.epoch == 1
    assert [one.document.epoch for one in found.later] == [2]
    assert found.remarks == ["not part of the log: export.mcap"]


def test_that_robots_drove_on_after_a_logs_end_is_told(tmp_path, plans):
    log = write_log(tmp_path / "run.mcap", plans, (1,))
    write_boxes(tmp_path)
    rows = "".join(f"{t},1.0,{1.0 + 0.1 * t},0,{0.1 * t},moving\n" for t in range(8))
    (tmp_path / "R2.csv").write_text(HEADER + rows)
    drove = "and R2 drove on later: if another log resumes this one, judge that"
    assert gather(log).remarks == [f"the log ends at -2.0 s, {drove}"]


def test_a_plan_file_beside_what_is_no_log_is_enough(tmp_path, plans):
    (tmp_path / "plan.json").write_bytes(to_json(plans[1]))
    (tmp_path / "export.mcap").write_bytes(b"not a log")
    write_boxes(tmp_path)
    assert gather(tmp_path).later == []


def test_black_boxes_may_be_beside_a_log_that_is_a_folder_or_in_it(tmp_path, plans):
    day = tmp_path / "day"
    day.mkdir()
    write_log(day / "run-0001.mcap", plans, (1,))
    write_boxes(tmp_path)
    assert sorted(gather(day).boxes) == ["R1", "R2"]
    write_boxes(day)
    (tmp_path / "R1.csv").write_text("x")
    assert sorted(gather(day).boxes) == ["R1", "R2"]


def test_a_folder_beside_a_log_that_is_a_folder_says_where_the_log_is(tmp_path, plans):
    (tmp_path / "day").mkdir()
    write_log(tmp_path / "day" / "run-0001.mcap", plans, (1,))
    (problem,) = problems_of(tmp_path)
    assert problem.endswith("(--log run.mcap); a log is in day")


def test_a_plan_file_is_enough_without_a_log(tmp_path, plans):
    (tmp_path / "plan.json").write_bytes(to_json(plans[1]))
    write_boxes(tmp_path / "blackbox")
    assert gather(tmp_path).later == []


def problems_of(source):
    with pytest.raises(InputError) as caught:
        gather(source)
    return caught.value.problems


def test_what_is_missing_is_told_in_one_line_with_where_it_is_looked_for(tmp_path, plans):
    assert problems_of(tmp_path) == (
        f"{tmp_path}: holds no plan; `judge` needs plan.json, or a log that the coordinator wrote "
        "(--log run.mcap)",
    )
    write_log(tmp_path / "run.mcap", plans, (1,))
    assert problems_of(tmp_path) == (
        f"no black box of R1, R2: there is no {tmp_path}/R1.csv or {tmp_path}/blackbox/R1.csv; "
        "`splinefleet agent R1 --blackbox R1.csv` writes one",
    )
    (tmp_path / "R1.csv").write_text("x\n")
    told = problems_of(tmp_path)
    assert told[0].startswith("no black box of R2:")
    assert "R1.csv: line 1" in told[1]
    (nowhere,) = problems_of(tmp_path / "nowhere")
    assert nowhere == f"{tmp_path / 'nowhere'}: No such file or directory"


def test_a_black_box_of_another_run_is_refused(tmp_path, plans):
    write_log(tmp_path / "run.mcap", plans, (1,))
    write_boxes(tmp_path)
    start = tmp_path / "R1.csv.start"
    start.write_text(f"9 {12 * SECOND}\n")
    assert sorted(gather(tmp_path).boxes) == ["R1", "R2"]
    start.write_text(f"9 {13 * SECOND}\n")
    with pytest.raises(InputError) as caught:
        gather(tmp_path)
    assert caught.value.problems == (f"{tmp_path}/R1.csv: is of another run than the log",)
