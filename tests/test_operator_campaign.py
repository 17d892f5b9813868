"""The campaign of operators and faults: runs end well, and those of a damaged product do not."""

from contextlib import closing

from benchmarks import operator_campaign
from benchmarks.operator_acts import Admission
from benchmarks.operator_campaign import Trial, judged, run_seed, shrunk
from coordinator.fleet.authority_ends import AuthorityEnds
from coordinator.log.log_file import read_log
from protocol import keys
from protocol.codec import decode
from protocol.messages import ORDER_DONE, Order, Plan
from sim.world.fault_text import Fault
from sim.world.run_logs import RunLogs


def test_seeds_end_without_a_touch_and_their_logs_are_proven():
    for seed in (116, 200, 206, 215):
        result = run_seed(seed, prove_each=1)
        assert result.problems == ()
        assert result.acts > 20
        assert result.script == ()


def test_seeds_on_floors_that_change_end_without_a_touch_and_their_logs_are_proven():
    result = run_seed(106, prove_each=1, floors=True)
    assert result.problems == ()
    assert result.given_up > 0
    assert result.resumed > 0


LOST_BEFORE_ITS_COURSE_WAS_SENT = [
    (9.2, Order(9, "o6", (9.68, 7.17), "R3")),
    (9.9, Order(9, "o8", (9.34, 5.53), "R4")),
    (20.67, Order(9, "o16", (6.51, 5.43), "R4", now=True)),
    (20.78, Order(9, "o17", (12.1, 4.26), "R2")),
    (23.18, Fault("restart", "R2", 23.16, 5.57)),
    (28.3, Fault("coordinator-restart", "", 28.3, 4.95)),
    (34.27, Admission("R2")),
    (34.64, Fault("cut", "R2", 34.6, 17.81)),
]


def test_a_course_that_was_withdrawn_before_it_was_sent_is_not_sent(tmp_path):
    with closing(RunLogs(tmp_path)) as logs:
        trial = Trial(5140, logs, LOST_BEFORE_ITS_COURSE_WAS_SENT)
        trial.run()
    assert list(judged(trial, logs, True)) == []
    key = keys.plan(trial.world.fleet.name, "R2")
    records = [one for one in read_log(logs.paths[-1]).records if one.key == key]
    sent = {decode("plan", one.payload) for one in records}
    assert {one.revision for one in sent if isinstance(one, Plan)} == {3}


GIVEN_UP_SHORT_OF_WHERE_ITS_AUTHORITY_MAY_END = [
    (4.08, Order(9, "o3", (6.72, 6.54), "R3")),
    (12.08, Order(9, "o14", (6.22, 5.63), "R4", now=True)),
    (12.24, Fault("stall", "R4", 12.24, 27.78)),
    (15.34, Fault("coordinator-restart", "", 15.34, 1.77)),
    (18.80, Order(9, "o22", (0.78, 2.25), "R5")),
    (20.94, Order(9, "o29", (3.2, 4.95))),
    (21.26, Order(9, "o30", (4.68, 6.77), "R1", now=True)),
]


def test_a_robot_gets_no_new_times_from_where_it_may_never_come(monkeypatch, tmp_path):
    """It is given up, with less than it may have been told before the coordinator's restart."""
    monkeypatch.setattr(operator_campaign, "PATIENCE", 60.0)
    with closing(RunLogs(tmp_path)) as logs:
        trial = Trial(6210, logs, GIVEN_UP_SHORT_OF_WHERE_ITS_AUTHORITY_MAY_END)
        trial.run()
    assert list(judged(trial, logs, True)) == []
    assert trial.world.fleet.orders.tasks["o14"].state == ORDER_DONE


def test_a_fleet_that_lets_robots_drive_on_which_were_given_up_is_found(monkeypatch):
    monkeypatch.setattr(AuthorityEnds, "_bound", lambda *_: None)
    results = (run_seed(seed, prove_each=1) for seed in (205, 200, 203))
    found = next(one for one in results if one.problems)
    assert any("which others go around" in problem for problem in found.problems)
    assert len(found.script) == found.acts > 30


def test_of_many_acts_those_that_are_needed_together_are_left():
    acts = [(float(time), None) for time in range(20)]
    needed = {acts[3], acts[11], acts[19]}
    assert set(shrunk(acts, lambda some: needed <= set(some))) == needed
