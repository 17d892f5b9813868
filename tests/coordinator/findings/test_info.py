"""What a log tells, on logs made by hand through the recorder."""

import io
import re
import subprocess
import sys

import msgspec
import pytest
from rich.console import Console

from coordinator.findings.info import summarise
from coordinator.findings.info_table import render
from coordinator.findings.plan_facts import summarise_plan
from coordinator.fleet.log_records import (
    LINK_GONE,
    LINK_UP,
    Request,
    adoption_key,
    adoption_record,
    router_key,
)
from coordinator.fleet.rest_places import Standing
from coordinator.log.log_file import read_log, readable_logs_before
from coordinator.log.log_writer import Attachment
from coordinator.log.recorder import Recorder
from coordinator.log.records import Log
from coordinator.plan import plan_file
from coordinator.plan.document import Path as PlanPath
from coordinator.plan.document import PlanDocument, Reason, RobotPlan, Stop
from protocol import codec, keys, phases, plan_bytes
from protocol.messages import (
    REFUSED,
    Admit,
    Clock,
    Command,
    Hello,
    OrderState,
    Plan,
    Refusal,
    Report,
    Rest,
)

SECOND = 1_000_000_000
BEGIN = 40 * SECOND
GO_AT = BEGIN + 2 * SECOND


def plan_message(robot: str) -> Plan:
    points = plan_bytes.pack_points([(0.0, 0.0), (1.0, 0.0), (2.0, 0.0), (3.0, 0.0)])
    speeds, profile = plan_bytes.pack_profile([(0.0, 0.5), (3.0, 0.0)])
    return Plan(
        1, 9, robot, 0, 0, 0, SECOND // 2, 20, 500, 10, 3, points,
        plan_bytes.pack_floats([1.0]), b"", speeds, profile, b"",
    )  # fmt: skip


def plan_document(epoch: int = 1, waits=()) -> PlanDocument:
    path = PlanPath(degree=1, knots=[0, 0, 1, 1], control_points=[(0, 0), (3, 0)], weights=[1, 1])
    stop = Stop(s=1.5, arrive=3.0, depart=4.5, yields_to="R2")
    robots = [
        RobotPlan(
            id=name, radius=0.2, start_time=start, finish_time=finish, length=3.0, path=path,
            profile=[(0, 1), (3, 1)], stops=stops, wire_bytes=0,
        )
        for name, start, finish, stops in (("R1", 0.0, 8.0, [stop]), ("R2", 1.0, 7.0, []))
    ]  # fmt: skip
    return PlanDocument(
        scenario="s", epoch=epoch, policy="safe", tau=0.5, margin=0.02, robots=robots,
        waits=list(waits),
    )  # fmt: skip


WAIT = Reason(
    robot="R1", s=1.5, wait=1.5, yields_to="R2", zone=(1.6, 2.5), their_zone=(0.5, 1.4),
    otherwise=2.25, tried=True,
)  # fmt: skip
TOLD_WAIT = {
    "epoch": 1, "robot": "R1", "s": 1.5, "wait": 1.5, "yields_to": "R2",
    "zone": (1.6, 2.5), "their_zone": (0.5, 1.4), "otherwise": 2.25, "tried": True,
}  # fmt: skip


def attached(document: PlanDocument) -> Attachment:
    return Attachment(
        f"plan-{document.epoch}.json", "application/json", plan_file.to_json(document)
    )


def log_of(tmp_path, messages, metadata=None, plans=None, more=()) -> Log:
    """Record (seconds since BEGIN, key, message or bytes) and read the log back."""
    path = tmp_path / "run.mcap"
    with Recorder(
        path,
        metadata={"fleet": "f"} if metadata is None else metadata,
        wall_offset_ns=10**18,
        attachments=[*more, *(attached(plan) for plan in plans or [plan_document()])],
    ) as log:
        for seconds, key, message in messages:
            payload = message if isinstance(message, bytes) else codec.encode(message)
            log.record(key, payload, BEGIN + round(seconds * SECOND))
    return read_log(path)


def command(sequence: int, epoch: int, phase: int) -> Command:
    start = GO_AT if phase in (phases.GO, phases.FREEZE) else 0
    return Command(9, 1, sequence, epoch, phase, start, start)


def good_run():
    one, two, all_robots = keys.report("f", "R1"), keys.report("f", "R2"), keys.command("f")
    return [
        (0.0, all_robots, command(1, 1, phases.HOLD)),
        (0.1, keys.hello("f", "R1"), Hello(1, 9)),
        (0.2, keys.plan("f", "R1"), plan_message("R1")),
        (0.3, keys.clock("f", "R1"), Clock(9, 5)),
        (0.4, keys.clock("f", "R1"), Clock(9, 5, 6, 7)),
        (0.5, one, Report(9, 1, 1, phases.ARMED)),
        (1.0, all_robots, command(2, 1, phases.GO)),
        (1.1, all_robots, command(3, 1, phases.GO)),
        (2.5, one, Report(9, 2, 1, phases.MOVING)),
        (9.0, two, Report(9, 1, 1, phases.DONE)),
        (10.0, one, Report(9, 3, 1, phases.DONE)),
        (10.2, one, Report(9, 4, 1, phases.DONE)),
        (10.5, all_robots, command(4, 1, phases.OVER)),
    ]


def test_a_good_run_is_told_from_hold_to_over(tmp_path):
    told = summarise(log_of(tmp_path, good_run()))
    assert told["epochs"] == [
        {
            "epoch": 1,
            "start": 0.0,
            "phases": [
                {"t": -2.0, "phase": "HOLD"},
                {"t": -1.0, "phase": "GO"},
                {"t": 8.5, "phase": "OVER"},
            ],
            "arrivals": {"R2": 7.0, "R1": 8.0},
            "ended": "over",
        }
    ]
    assert told["zero"] == 2.0
    assert told["messages"] == 13
    assert told["keys"]["splinefleet/f/report/R2"] == {
        "messages": 1,
        "bytes": 12,
        "messages_per_second": 1 / 10.5,
        "bytes_per_second": 12 / 10.5,
    }
    assert (told["positions_on_wire"], told["bad_messages"], told["faults"]) == (0, 0, [])
    assert (told["fleet"], told["policy"], told["tau"]) == ("f", "safe", 0.5)
    assert (told["duration"], told["complete"], told["damage"]) == (10.5, True, "")


def test_a_robot_is_told_with_its_plan_its_stops_and_what_it_sent(tmp_path):
    messages = good_run()
    told = summarise(log_of(tmp_path, messages))
    size = len(codec.encode(plan_message("R1")))
    by_hand = sum(
        len(codec.encode(message))
        for _, _, message in messages
        if isinstance(message, Hello)
        or (isinstance(message, Clock) and message.received_ns is None)
        or (isinstance(message, Report) and message.sequence != 1)
    ) + len(codec.encode(Report(9, 1, 1, phases.ARMED)))
    assert told["robots"]["R1"] == {
        "plan_bytes": size,
        "control_points": 4,
        "planned_start": 0.0,
        "planned_finish": 8.0,
        "stops": [{"s": 1.5, "depart": 4.5, "yields_to": "R2"}],
        "arrived": 8.0,
        "true_arrival": None,
        "late": 0.0,
        "tracking_error": None,
        "nearest": None,
        "reports": 4,
        "reports_lost": 0,
        "reports_doubled": 0,
        "bytes_sent": by_hand,
        "fault": None,
    }
    assert told["robots"]["R2"]["planned_start"] == 1.0
    assert told["largest_plan_bytes"] == told["largest_message_to_robot_bytes"] == size


def test_the_busiest_robots_rate_counts_from_go_to_the_last_arrival(tmp_path):
    told = summarise(log_of(tmp_path, good_run()))
    two_reports = 2 * len(codec.encode(Report(9, 2, 1, phases.MOVING)))
    assert told["robot_payload_bytes_per_second"] == pytest.approx(two_reports / 8.0)


def test_a_run_without_arrivals_has_no_rate(tmp_path):
    told = summarise(log_of(tmp_path, good_run()[:9]))
    assert told["robot_payload_bytes_per_second"] is None
    assert told["epochs"][0]["ended"] == "running"
    assert told["robots"]["R1"]["arrived"] is None


def test_a_position_on_the_wire_is_counted_except_from_a_frozen_robot(tmp_path):
    one = keys.report("f", "R1")
    told = summarise(
        log_of(
            tmp_path,
            [
                (0.0, one, Report(9, 1, 1, phases.FROZEN, 0, Rest(1.25, 1))),
                (0.1, one, Report(9, 2, 1, phases.MOVING, 0, Rest(1.25, 1))),
                (0.2, one, Report(9, 3, 1, phases.BRAKING, 0, Rest(0.0, 1))),
                (0.3, "splinefleet/f/pose/R1", b"\x01"),
                (0.4, "splinefleet/other/pose/R1", b"\x01"),
                (0.5, "weather", b"rain"),
            ],
        )
    )
    assert told["positions_on_wire"] == 3
    assert told["messages"] == 6


def test_bytes_that_no_receiver_accepts_are_counted_and_believed_in_nothing(tmp_path):
    told = summarise(
        log_of(
            tmp_path,
            [
                (0.0, keys.report("f", "R1"), b"\xc1"),
                (0.1, keys.command("f"), codec.encode(Report(9, 1, 1, phases.DONE))),
                (0.2, keys.plan("f", "R1"), bytes(5_000)),
            ],
        )
    )
    assert told["bad_messages"] == 3
    assert told["epochs"] == []
    assert told["largest_plan_bytes"] == 0


def test_faults_refusals_and_freezes_are_told_once_each(tmp_path):
    one, all_robots = keys.report("f", "R1"), keys.command("f")
    told = summarise(
        log_of(
            tmp_path,
            [
                (0.0, all_robots, command(1, 1, phases.GO)),
                (1.0, one, Report(9, 1, 1, phases.BRAKING, phases.OFF_PATH)),
                (1.1, one, Report(9, 2, 1, phases.BRAKING, phases.OFF_PATH)),
                (1.2, all_robots, command(2, 1, phases.FREEZE)),
                (1.3, all_robots, command(3, 1, phases.FREEZE)),
                (1.4, one, Report(9, 3, 1, phases.FROZEN, 7, Rest(1.0, 1))),
                (1.5, keys.plan("f", "R9"), Refusal(3, "not in the scenario")),
                (1.6, keys.admit("f", "R1"), Admit(7)),
                (1.6, keys.plan("f", "R1"), Refusal(7, "R1 is driving already")),
            ],
        )
    )
    assert [(f["t"], f["robot"], f["fault"], f["kind"]) for f in told["faults"]] == [
        (-1.0, "R1", "off its path", "report"),
        (-0.8, "", "the fleet was told to freeze", "freeze"),
        (-0.6, "R1", "fault 7", "report"),
        (-0.5, "R9", "not in the scenario", "refusal"),
    ]
    assert told["epochs"][0]["ended"] == "frozen"


def test_the_coordinators_records_of_its_router_and_the_robots_links_tell_who_lost_a_link(tmp_path):
    run = [message for message in good_run()[:9] if message[0] < 2.5]
    run += [(0.1 * n, keys.command("f"), command(n, 1, phases.GO)) for n in range(13, 24)]
    run += [(2.5, keys.alive("f", "R1"), LINK_GONE)]
    router = [(-0.1, router_key("f"), LINK_UP), (2.6, router_key("f"), LINK_GONE)]

    def told(records):
        log = log_of(tmp_path, sorted(records, key=lambda message: message[0]))
        return [(one["robot"], one["fault"]) for one in summarise(log)["faults"]]

    assert told(run) == [("R1", "lost its link")]
    assert told(run + router) == [("", "the router is gone")]


def test_who_was_refused_and_is_not_of_the_fleet_is_told_as_a_fault_and_no_robot(tmp_path):
    stranger = [
        (1.2, keys.hello("f", "R9"), Hello(1, 3)),
        (1.3, keys.clock("f", "R9"), Clock(3, 5)),
        (1.4, keys.report("f", "R9"), Report(3, 1, 0, phases.IDLE)),
        (1.5, keys.plan("f", "R9"), Refusal(3, "not in the fleet")),
        (1.6, keys.alive("f", "R9"), LINK_GONE),
    ]
    fleet = Attachment("scenario.json", "application/json", b'{"robots":[{"id":"R1"},{"id":"R2"}]}')
    both = sorted(good_run() + stranger, key=lambda message: message[0])
    told = summarise(log_of(tmp_path, both, more=[fleet]))
    alone = summarise(log_of(tmp_path, good_run(), more=[fleet]))
    beside = summarise(log_of(tmp_path, both, metadata={"fleet": "f", "passive": "yes"}))
    assert told["robots"].keys() == beside["robots"].keys() == {"R1", "R2"}
    assert told["broadcast"] == alone["broadcast"]
    assert [(f["robot"], f["fault"], f["kind"]) for f in told["faults"]] == [
        ("R9", "not in the fleet", "refusal")
    ]


def test_times_without_a_go_count_from_the_first_message_and_that_is_said(tmp_path):
    all_robots = keys.command("f")
    run = [(3.0, all_robots, command(1, 1, phases.HOLD)), (4.0, all_robots, command(2, 1, 2))]
    told = summarise(log_of(tmp_path, run))
    assert told["zero"] is None
    assert [change["t"] for change in told["epochs"][0]["phases"]] == [0.0, 1.0]
    assert "there was no GO" in shown(told)
    assert "first GO, 2.00 s into the log" in shown(summarise(log_of(tmp_path, good_run())))


def test_a_log_that_goes_on_from_another_counts_from_the_first_go_of_both(tmp_path):
    log_of(tmp_path, good_run()[:9])
    before = Attachment("resumed.mcap", "x", (tmp_path / "run.mcap").read_bytes())
    path, all_robots = tmp_path / "run-2.mcap", keys.command("f")
    with Recorder(
        path, metadata={"fleet": "f"}, wall_offset_ns=10**18, attachments=[before]
    ) as log:
        for seconds, message in (
            (12.0, command(1, 2, phases.FREEZE)),
            (14.0, command(2, 3, phases.GO)),
        ):
            log.record(all_robots, codec.encode(message), BEGIN + round(seconds * SECOND))
    log = read_log(path)
    told = summarise(log, before=readable_logs_before(log))
    assert told["zero"] == -10.0
    assert [epoch["phases"][0]["t"] for epoch in told["epochs"]] == [10.0, 12.0]
    assert "first GO, 10.00 s before the log begins" in shown(told)


def arrived_without_one():
    """R1 falls silent, R2 drives on in epoch 2; FREEZE when it has arrived, then OVER."""
    one, two, all_robots = keys.report("f", "R1"), keys.report("f", "R2"), keys.command("f")
    second = command(4, 2, phases.GO)
    return [
        (1.0, all_robots, command(1, 1, phases.GO)),
        (2.5, one, Report(9, 1, 1, phases.MOVING)),
        (2.6, two, Report(9, 1, 1, phases.MOVING)),
        (2.7, all_robots, command(2, 1, phases.GO)),
        (3.4, two, Report(9, 2, 1, phases.MOVING)),
        *((2.8 + tenth / 10, all_robots, command(3, 1, phases.GO)) for tenth in range(11)),
        (3.9, all_robots, command(3, 1, phases.FREEZE)),
        (4.0, two, Report(9, 3, 1, phases.FROZEN, 0, Rest(1.0, 1))),
        (5.0, all_robots, command(3, 2, phases.HOLD)),
        (6.0, all_robots, msgspec.structs.replace(second, start_ns=GO_AT + 4 * SECOND)),
        (6.2, two, Report(9, 4, 2, phases.MOVING)),
        (14.0, two, Report(9, 5, 2, phases.DONE)),
        (14.1, all_robots, command(5, 2, phases.FREEZE)),
        (14.4, all_robots, command(6, 3, phases.OVER)),
    ]


def test_the_end_of_an_epoch_whose_robots_have_arrived_is_no_fault(tmp_path):
    plans = [plan_document(1), plan_document(2)]
    told = summarise(log_of(tmp_path, arrived_without_one(), plans=plans))
    assert [(epoch["ended"], epoch["start"]) for epoch in told["epochs"]] == [
        ("frozen", 0.0),
        ("arrived", 4.0),
        ("nobody goes", None),
    ]
    assert [fault["kind"] for fault in told["faults"]] == ["silence", "freeze"]
    assert told["freezes"] == len(told["frozen"]) == 1


def test_a_robot_that_is_back_and_waits_for_the_end_of_an_epoch_is_no_fault_of_it(tmp_path):
    run = arrived_without_one()
    back = Report(9, 8, 1, phases.FROZEN, phases.DRIVER_ERROR, Rest(0.5, 1))
    run.insert(-3, (9.0, keys.report("f", "R1"), back))
    run.insert(-3, (10.0, keys.alive("f", "R1"), LINK_GONE))
    told = summarise(log_of(tmp_path, run, plans=[plan_document(1), plan_document(2)]))
    assert [epoch["ended"] for epoch in told["epochs"]] == ["frozen", "arrived", "nobody goes"]
    assert told["freezes"] == len(told["frozen"]) == 1


def test_a_robot_that_is_left_where_it_stands_is_told_once_and_why(tmp_path):
    run = arrived_without_one()
    standing = Standing(robot="R1", state="unfit", epoch=1, s=1.0)
    for i, seconds in enumerate((4.9, 14.2)):
        entry = (seconds, adoption_key("f"), adoption_record(Request(2 + i, (standing,))))
        run.insert(next(k for k, one in enumerate(run) if one[0] > seconds), entry)
    run.insert(-1, (14.3, keys.report("f", "R1"), Report(9, 9, 0, phases.IDLE)))
    told = summarise(log_of(tmp_path, run, plans=[plan_document(1), plan_document(2)]))
    words = "left where it stands: it has failed in 3 epochs"
    assert [(f["robot"], f["fault"]) for f in told["faults"] if f["kind"] == "unfit"] == [
        ("R1", words)
    ]
    assert told["robots"]["R1"]["fault"] == words


def test_arrivals_and_plans_of_later_epochs_count_from_the_first_go_too(tmp_path):
    plans = [plan_document(1), plan_document(2)]
    told = summarise(log_of(tmp_path, arrived_without_one(), plans=plans))
    robot = told["robots"]["R2"]
    assert told["epochs"][1]["arrivals"] == {"R2": 12.0}
    assert (robot["planned_start"], robot["planned_finish"]) == (5.0, 11.0)
    assert (robot["arrived"], robot["late"]) == (12.0, 1.0)
    assert told["robots"]["R1"]["stops"] == [{"s": 1.5, "depart": 8.5, "yields_to": "R2"}]


def shown(told, width=140):
    text = io.StringIO()
    Console(file=text, width=width).print(render(told))
    return text.getvalue()


def test_no_word_of_a_table_is_cut_at_80_columns(tmp_path):
    told = summarise(log_of(tmp_path, arrived_without_one(), plans=[plan_document(1, [WAIT])]))
    for robot in told["robots"].values():
        robot["stops"] = [{"s": 123.45, "depart": 678.9, "yields_to": "a-long-name-of-a-robot"}] * 2
        robot |= {"arrived": 1234.5, "late": 12.34, "true_arrival": 1234.5, "fault": "off its path"}
        robot |= {"tracking_error": 0.1234, "planned_finish": 1234.5, "bytes_sent": 123_456}
        robot["nearest"] = {"robot": "R2", "distance": 12.345, "t": 1234.5, "source": "plans"}
    told["robots"]["a-robot-with-a-name-of-32-letters"] = told["robots"]["R1"]
    said = shown(told, 80)
    assert "…" not in said
    for word in ("planned", "heard", "nearest", "robot", "points", "arrived", "noticed"):
        assert f" {word} " in said
    assert max(map(len, said.splitlines())) <= 80


def test_an_empty_log_and_a_log_without_names_are_told_too(tmp_path):
    empty = summarise(Log(metadata={}, attachments={}, records=[], complete=False, damage="x"))
    assert (empty["messages"], empty["duration"], empty["tau"]) == (0, 0.0, None)
    nameless = summarise(log_of(tmp_path, good_run(), metadata={}))
    assert nameless["fleet"] == "f"


def test_a_spoilt_plan_attachment_is_passed_over():
    log = Log({"fleet": "f"}, {"plan-1.json": b"{"}, [], True, "")
    assert summarise(log)["robots"] == {}


def test_every_epochs_waits_are_told_from_the_plans_that_the_log_holds(tmp_path):
    after = Reason(
        robot="R2",
        s=0.0,
        wait=0.5,
        yields_to="R1",
        zone=(0.5, 1.4),
        their_zone=(1.6, 2.5),
        tried=True,
    )
    plans = [plan_document(2, [after]), plan_document(1, [WAIT])]
    told = summarise(log_of(tmp_path, good_run(), plans=plans))
    assert told["waits"][0] == TOLD_WAIT
    assert [(wait["epoch"], wait["robot"]) for wait in told["waits"]] == [(1, "R1"), (2, "R2")]
    text = io.StringIO()
    Console(file=text, width=140).print(render(told))
    assert "epoch" in text.getvalue()
    assert "1.60 to 2.50" in text.getvalue()
    assert "cannot" in text.getvalue()


def test_a_plan_alone_is_told_with_its_waits_and_nothing_about_a_run():
    told = summarise_plan(plan_document(waits=[WAIT]))
    assert (told["source"], told["fleet"], told["messages"]) == ("plan", "s", 0)
    assert told["waits"] == [TOLD_WAIT]
    assert told["robots"]["R1"]["control_points"] == 2
    assert told["robots"]["R1"]["planned_finish"] == 8.0
    text = io.StringIO()
    Console(file=text, width=140).print(render(told))
    said = text.getvalue()
    assert "plan for" in said
    assert "+2.2 s" in said
    assert "arrived" not in said
    assert "not closed" not in said


def test_the_tables_show_arrivals_stops_and_silence(tmp_path):
    for messages in (good_run(), []):
        text = io.StringIO()
        told = summarise(log_of(tmp_path, messages))
        Console(file=text, width=140).print(render(told))
        assert "messages with positions" in text.getvalue()
    Console(file=text, width=140).print(render(summarise(log_of(tmp_path, good_run()))))
    assert "s 1.50 m until 4.50 s for R2" in text.getvalue()


def test_a_robot_on_its_way_is_not_shown_as_arrived_though_it_was_at_an_earlier_goal(tmp_path):
    told = summarise(log_of(tmp_path, good_run()))
    shown = []
    for late in (told["robots"]["R1"]["late"], None):
        told["robots"]["R1"]["late"] = late
        text = io.StringIO()
        Console(file=text, width=140).print(render(told))
        rows = [re.split("[│┃]", line) for line in text.getvalue().splitlines()]
        arrived = next(row[4].strip() for row in rows if len(row) > 4 and row[1].strip() == "1")
        heard = [row[3].strip() for row in rows if len(row) > 8 and row[1].strip() == "R1"]
        shown.append((arrived, heard))
    assert shown == [("2", ["8.00"]), ("1", ["-"])]


def test_a_robot_that_is_lost_heard_again_and_lost_again_is_told_of_twice(tmp_path):
    one, all_robots = keys.report("f", "R1"), keys.command("f")
    beats = [(0.1 * k, all_robots, command(k, 1, phases.GO)) for k in range(10, 90)]
    heard = [(at, one, Report(9, k, 1, phases.MOVING)) for k, at in enumerate((1.0, 4.0))]
    told = summarise(log_of(tmp_path, sorted([*beats, *heard], key=lambda one: one[0])))
    assert [one["kind"] for one in told["faults"]] == ["silence", "silence"]
    told = summarise(log_of(tmp_path, [*beats[:30], *heard, *beats[30:35]]))
    assert told["robots"]["R1"].get("fault") is None


def test_an_order_that_never_was_is_no_order(tmp_path):
    told = [
        OrderState("a", REFUSED, "R1", released_ms=5, reason="no way"),
        OrderState("b", REFUSED, "", reason="there is no order b"),
    ]
    heard = [(2.0 + k, keys.orders("f", one.id), one) for k, one in enumerate(told)]
    summary = summarise(log_of(tmp_path, [*good_run(), *heard]))
    assert [one["id"] for one in summary["orders"]] == ["a"]


def frozen_run():
    """R1 faults at 3.0 s, FREEZE 3.1 s; R1 rests at 3.9 s, R2 at 4.3 s; the next GO is at 6.5 s."""
    one, two, all_robots = keys.report("f", "R1"), keys.report("f", "R2"), keys.command("f")
    return [
        (1.0, all_robots, command(1, 1, phases.GO)),
        (2.6, one, Report(9, 1, 1, phases.MOVING)),
        (2.9, two, Report(9, 1, 1, phases.MOVING)),
        (3.0, one, Report(9, 2, 1, phases.BRAKING, phases.OFF_PATH)),
        (3.1, all_robots, command(2, 1, phases.FREEZE)),
        (3.3, two, Report(9, 2, 1, phases.BRAKING)),
        (3.9, one, Report(9, 4, 1, phases.FROZEN, phases.OFF_PATH, Rest(1.0, 1))),
        (4.3, two, Report(9, 3, 1, phases.FROZEN, 0, Rest(1.2, 1))),
        (4.5, two, Report(9, 3, 1, phases.FROZEN, 0, Rest(1.2, 1))),
        (6.0, all_robots, command(3, 2, phases.HOLD)),
        (6.5, all_robots, command(6, 2, phases.GO)),
    ]


def test_a_freeze_is_timed_from_the_first_sign_to_the_next_go(tmp_path):
    told = summarise(log_of(tmp_path, frozen_run()))
    (freeze,) = told["frozen"]
    assert (freeze["t"], freeze["epoch"]) == (pytest.approx(1.1), 1)
    times = [freeze[name] for name in ("notice", "silence", "rest", "go")]
    assert times == pytest.approx([0.1, 0.2, 1.2, 3.4])
    assert told["latencies"]["freeze_rest"] == {
        "count": 1,
        **dict.fromkeys(("median", "p90", "p99", "most"), 1.2),
    }


def test_a_freeze_for_silence_tells_how_long_it_was_and_no_sign(tmp_path):
    (go, _, moving, *_), all_robots = frozen_run(), keys.command("f")
    run = [go, moving, (3.5, all_robots, command(2, 1, phases.FREEZE))]
    (freeze,) = summarise(log_of(tmp_path, run))["frozen"]
    assert freeze["notice"] is None
    assert freeze["silence"] == pytest.approx(0.6)
    assert (freeze["rest"], freeze["go"]) == (None, None)


def test_messages_lost_and_doubled_are_seen_in_their_numbers(tmp_path):
    told = summarise(log_of(tmp_path, frozen_run()))
    assert (told["robots"]["R1"]["reports_lost"], told["robots"]["R2"]["reports_lost"]) == (1, 0)
    assert told["robots"]["R2"]["reports_doubled"] == 1
    assert told["lost_messages"] == 1 + 2  # Commands 4 and 5 never went by


def test_the_age_of_messages_is_told_from_their_stamps_only_where_there_are_any(tmp_path):
    path = tmp_path / "run.mcap"
    for speed in ("1.0", "2.0"):
        with Recorder(path, metadata={"fleet": "f", "speed": speed}, wall_offset_ns=10**18) as log:
            for i in range(100):
                at = BEGIN + i * SECOND // 10
                payload = codec.encode(Report(9, i, 1, phases.MOVING))
                log.record(keys.report("f", "R1"), payload, at, 10**18 + at - (i + 1) * 1_000_000)
                log.record(keys.command("f"), codec.encode(command(i, 1, phases.HOLD)), at)
        ages = summarise(read_log(path))["latencies"]
        assert "command_age" not in ages
        gap = pytest.approx(0.1)
        assert ages["command_gap"] == {
            "count": 99, "median": gap, "p90": gap, "p99": gap, "most": gap,
        }  # fmt: skip
        if speed == "1.0":
            told = {"count": 100, "median": 0.05, "p90": 0.09, "p99": 0.099, "most": 0.1}
            assert ages["report_age"] == told
        else:
            assert "report_age" not in ages


def test_what_a_broadcasting_fleet_would_have_sent_is_told_beside(tmp_path):
    messages = good_run()
    told = summarise(log_of(tmp_path, messages))["broadcast"]
    assert (told["robots"], told["seconds"]) == (2, 8.0)
    assert told["messages"] == 10 * 8 * 2 * 1
    assert told["bytes"] == 24 * told["messages"]
    reach = [2 if isinstance(message, Command) else 1 for *_, message in messages]
    sizes = [len(codec.encode(message)) for *_, message in messages]
    assert told["our_messages"] == sum(reach)
    assert told["our_bytes"] == sum(a * b for a, b in zip(reach, sizes, strict=True))
    assert summarise(log_of(tmp_path, messages[:3]))["broadcast"] is None


def test_without_a_plan_attached_times_and_stops_are_told_from_the_message(tmp_path):
    path = tmp_path / "run.mcap"
    with Recorder(path, metadata={"fleet": "f"}, wall_offset_ns=0) as log:
        log.record(keys.plan("f", "R1"), codec.encode(plan_message("R1")), BEGIN)
    told = summarise(read_log(path))
    assert told["tau"] == 0.5
    assert told["robots"]["R1"]["planned_finish"] == pytest.approx(12.0)
    assert told["robots"]["R1"]["planned_start"] == 0.0


def test_a_number_that_is_no_sequence_of_this_robot_makes_no_loss(tmp_path):
    one = keys.report("f", "R1")
    babble = [(0.1 * i, one, Report(9, 10**6 * i, 1, phases.MOVING)) for i in range(9)]
    assert summarise(log_of(tmp_path, babble))["lost_messages"] == 0


def test_the_tables_show_freezes_latencies_and_the_other_way_of_telling_positions(tmp_path):
    text = io.StringIO()
    Console(file=text, width=140).print(render(summarise(log_of(tmp_path, frozen_run()))))
    Console(file=text, width=140).print(render(summarise(log_of(tmp_path, good_run()))))
    assert "all at rest" in text.getvalue()
    assert "freeze notice" in text.getvalue()
    assert "2 robots broadcasting positions at 10 Hz for 8.0 s: 160 messages" in text.getvalue()


def test_the_summary_is_imported_without_the_file_format():
    code = "import sys, coordinator.findings.info; sys.exit('mcap' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_commands_of_other_coordinators_are_not_this_fleets(tmp_path):
    other = Command(4, 1, 1, 1, phases.GO, GO_AT - 1000 * SECOND, 0)
    said = [
        (0.0, keys.command("f"), other),
        (0.5, keys.command("f"), command(1, 1, phases.HOLD)),
        (1.0, keys.command("f"), command(2, 1, phases.GO)),
    ]
    told = summarise(log_of(tmp_path, said, metadata={"fleet": "f", "boot": "9"}))
    assert [change["phase"] for change in told["epochs"][0]["phases"]] == ["HOLD", "GO"]
    assert told["epochs"][0]["start"] == 0.0
