"""How far late robots have come: by properties, and in a run against their true places."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from coordinator.exchange.foxglove import poses_of
from coordinator.exchange.motion_story import story_of_log
from coordinator.findings.progress import ON_TIME, Progress
from coordinator.log.log_file import read_log
from coordinator.planning.planner import plan_scenario
from coordinator.scenario_files.scenario_reader import read_scenario
from coordinator.view.scene_log import scene_of_logs
from sim.campaigns.campaign import run_world
from sim.world.fault_text import Fault
from sim.world.memory_transport import MemoryNetwork
from sim.world.run_logs import RunLogs
from sim.world.virtual_fleet import World
from tests.coordinator.view.test_page_and_export import shown

EXAMPLES = Path(__file__).resolve().parents[3] / "examples"


@st.composite
def reports(draw):
    """Times, and the lateness at each: passed plan time never falls."""
    steps = draw(st.lists(st.tuples(st.integers(1, 40), st.integers(0, 60)), min_size=1))
    t = passed = 0.0
    found = []
    for step, gain in steps:
        t += 0.05 * step
        passed = min(t, passed + 0.05 * gain)
        found.append((t, t - passed))
    return found


@given(reports())
def test_what_was_reported_has_been_passed_and_progress_only_grows(reported):
    progress = Progress()
    for t, late in reported:
        progress.take(t, late)
    times = np.array([t for t, _ in reported])
    wanted = [t if late <= ON_TIME else t - late for t, late in reported]
    assert progress.at(times) == pytest.approx(np.maximum.accumulate(wanted), abs=1e-6)
    many = np.linspace(-1.0, times[-1] + 5.0, 500)
    passed = progress.at(many)
    assert (np.diff(passed) >= -1e-9).all()
    assert (passed <= many + 1e-9).all()


@given(reports(), st.floats(0.0, 1.0))
def test_when_a_plan_time_is_passed_is_the_inverse(reported, share):
    progress = Progress()
    for t, late in reported:
        progress.take(t, late)
    wanted = share * float(progress.at(np.array([reported[-1][0]]))[0])
    assert progress.at(np.array([progress.when(wanted)]))[0] == pytest.approx(wanted, abs=1e-6)


def test_robots_on_time_need_no_knots_and_one_that_stands_or_keeps_its_lateness_needs_two():
    progress = Progress()
    for number in range(100):
        progress.take(0.2 * number, 0.05 * (number % 3))
    assert progress.knots == []
    for number in range(50):
        progress.take(20.0 + 0.2 * number, 1.0)
    assert len(progress.knots) == 3
    for number in range(50):
        progress.take(30.0 + 0.2 * number, 1.2 + 0.2 * number)
    assert len(progress.knots) == 4
    assert progress.at(np.array([60.0]))[0] == pytest.approx(progress.knots[-1][1])


def test_a_robot_that_has_caught_up_is_on_time_again():
    progress = Progress()
    for t, late in ((1.0, 0.0), (2.0, 0.5), (3.0, 0.3), (4.0, 0.0), (5.0, 0.1)):
        progress.take(t, late)
    assert not progress.is_late
    assert progress.at(np.array([0.5, 4.5, 9.0])) == pytest.approx([0.5, 4.5, 9.0])


def test_a_robot_that_drove_on_unheard_while_the_plan_stood_waits_where_its_authority_ended():
    """After 3 s in which plan time stood it reports 9.7, as it does not say how early it is."""
    progress = Progress()
    for t, late in ((9.0, 0.0), (10.0, 0.0), (12.7, 3.0), (13.7, 3.0), (14.7, 3.2)):
        progress.take(t, late, 11.0 if late == 3.0 else 0.0)
    assert progress.at(np.array([10.5, 11.0, 12.0, 13.7, 14.7])) == pytest.approx(
        [10.5, 11.0, 11.0, 11.0, 11.5]
    )


@pytest.fixture(scope="module")
def stalled(tmp_path_factory):
    """A run in which robots stall for seconds: its log, the black boxes, who stalled."""
    scenario = read_scenario(EXAMPLES / "paper_five_real.toml")
    document = plan_scenario(scenario, effort=0)
    faults = [Fault("stall", "R1", 3.0, 4.0), Fault("stall", "R3", 6.0, 18.0)]
    logs = RunLogs(tmp_path_factory.mktemp("stalled"))
    network = MemoryNetwork(1, delay_ns=(1_000_000, 3_000_000))
    world = World(scenario, document, network, seed=1, faults=faults, logs=logs)
    run_world(world, document)
    logs.close()
    return read_log(logs.paths[0]), world.blackboxes()


def test_page_and_export_have_late_robots_near_their_true_places(stalled):
    log, boxes = stalled
    scene, legs = scene_of_logs([("run.mcap", log)]), story_of_log(log).of_robots()
    assert [len(legs[name]) for name in ("R1", "R2", "R3", "R4", "R5")] == [2, 1, 2, 2, 1]
    for name, box in boxes.items():
        times = np.arange(0.0, min(legs[name][-1].end, float(box.t[-1])), 0.05)
        told = poses_of(legs[name], times)[:, :2]
        assert np.hypot(*(told - shown(scene, name, times)).T).max() < 2e-3, name
        off = np.hypot(*(told - box.at(times)).T)
        assert off.max() < 0.15, name
        assert np.median(off) < 0.03, name


def test_the_page_of_a_log_tells_who_was_held(stalled):
    log, _ = stalled
    scene = scene_of_logs([("run.mcap", log)])
    names = [robot.id for robot in scene.robots]
    told = {(names[one.robot], names[one.by]) for one in scene.held}
    assert told
    assert all(one.until > one.since >= 0.0 for one in scene.held)
    long = [one for one in scene.held if one.until - one.since >= 1.0]
    marks = [mark.text for mark in scene.marks if "is held by" in mark.text]
    assert marks == [f"{names[one.robot]} is held by {names[one.by]}" for one in long]
