"""Campaigns: fleets in virtual time with random faults; nobody touches, nobody waits for ever."""

import io
import json
from pathlib import Path

import pytest
from msgspec.structs import replace
from rich.console import Console
from typer.testing import CliRunner

from benchmarks.reliability import floor, floor_of
from coordinator.scenario.model import Link
from coordinator.scenario_files.scenario_reader import read_scenario
from protocol.phases import OVER
from sim.campaigns.answer import add_up, render
from sim.campaigns.campaign import LINKS, Wish, is_promised, make_world, plan_for, run_one, run_seed
from sim.campaigns.pool import attempt
from sim.campaigns.shell import Campaign
from sim.campaigns.shrink import shrink
from sim.campaigns.truth import excused
from sim.cli.run_commands import commands
from sim.floors.generator import generate
from sim.world.fault_script import read_faults
from sim.world.fault_text import Fault
from tests.sweeps import seeds

ROOT = Path(__file__).resolve().parents[3]
PAPER = ROOT / "examples" / "paper_five.toml"
GOOD = LINKS[0]
UNSAFE = Wish(tau=0.3, authority=False)


@pytest.fixture(scope="module")
def five():
    return read_scenario(PAPER)


@pytest.fixture(scope="module")
def floors(five):
    small = [generate("u-traps", 4, 1), generate("cross-town", 6, 1), generate("polygons", 5, 2)]
    return [five, five, *small]


@pytest.fixture(scope="module")
def crossing():
    return generate("warehouse", 8, 1)


@pytest.mark.parametrize("seed", seeds(50))
def test_nobody_touches_and_whoever_can_arrives(floors, seed):
    outcome = run_seed(floors[seed % len(floors)], seed)
    assert outcome.violations == ()
    assert outcome.arrived == outcome.expected


@pytest.mark.parametrize("seed", [8, 25, 31, 57])
def test_nobody_touches_where_computers_stop_and_clocks_are_set(seed):
    """With a filter that believes its best exchange for good these seeds collide."""
    scenario = read_scenario(ROOT / "examples" / "paper_five_real.toml")
    outcome = run_seed(scenario, seed, Wish(kinds=("clock-pause", "clock-jump")))
    assert outcome.violations == ()
    assert outcome.arrived == outcome.expected


def test_without_faults_every_link_brings_everybody_home_in_the_first_epoch(five):
    for seed, link in enumerate(LINKS):
        scenario, document = plan_for(five, link, None)
        outcome = run_one(scenario, document, seed, [])
        assert (outcome.violations, outcome.arrived, outcome.epochs) == ((), 5, 1)


@pytest.mark.parametrize(("dead", "time"), [("R5", 5.3), ("R5", 5.6)])
def test_a_robot_that_was_held_by_a_dead_one_goes_on_past_those_that_passed_it(five, dead, time):
    """R3 stands where its old course let it come; its new one begins there, past R1's."""
    scenario, document = plan_for(five, GOOD, None)
    outcome = run_one(scenario, document, round(1000 * time), [Fault("kill", dead, time)])
    assert outcome.violations == ()


@pytest.mark.parametrize(("dead", "time"), [("R11", 3.0), ("R14", 6.0)])
def test_in_a_crowd_everybody_arrives_beside_a_dead_robot(dead, time):
    """R1 makes room for others, and finds no way on from there; R7 was held on its way."""
    scenario, document = plan_for(generate("polygons", 17, 1), GOOD, None)
    outcome = run_one(scenario, document, round(1000 * time), [Fault("kill", dead, time)])
    assert outcome.violations == ()


@pytest.mark.parametrize(
    ("seed", "faults"),
    [
        (33, [Fault("hang", "R5", 2.0), Fault("hang", "R10", 12.0)]),
        (37, [Fault("kill", "R16", 4.7), Fault("coordinator-restart", "", 10.0, 5.0)]),
    ],
)
def test_robots_that_a_lost_or_closed_in_one_would_have_to_pass_first_are_sent_around_it(
    seed, faults
):
    """R10 waits for R4 and falls silent, and R4 finds no way before R10 has passed; R3 cannot go
    on, and the new coordinator does not know how far it may have driven."""
    outcome = run_seed(generate("open", 17, 3), seed, Wish(), faults)
    assert (outcome.violations, outcome.over) == ((), True)


def test_robots_that_go_back_do_not_make_room_for_each_other_for_ever():
    """R7 dies in a lane; those that made room block each other's ways back."""
    outcome = run_seed(generate("aisles", 10, 2), 30, Wish())
    assert (outcome.violations, outcome.over, outcome.arrived) == ((), True, 9)
    assert outcome.epochs > 1, "planned anew, because others made room again and again"


_NO_OTHER_WAY = "others go around R3, which waits for R5 and has no other way"


@pytest.mark.parametrize(
    ("seed", "said"),
    [
        *((seed, "") for seed in (43240, 40156, 43208, 43379)),
        *((seed, _NO_OTHER_WAY) for seed in (44004, 54356, 51520)),
    ],
)
def test_robots_that_fail_again_after_they_were_sent_on_leave_everybody_a_way(seed, said):
    """One is lost before it begins its next course, one stops beside the path of a lost one, one is
    cut off while it is sent a course, one slides off its goal, one stalls before its next course,
    one has to turn back at a place to pass, one rests without a way and makes room later.
    """
    outcome = run_seed(floor(floor_of(seed)), seed)
    assert (outcome.violations, outcome.over) == ((), True)
    assert said in "\n".join(outcome.said)


def test_the_same_seed_gives_the_same_outcome(five):
    assert run_seed(five, 7) == run_seed(five, 7)


@pytest.mark.parametrize("seed", [11, 21, 22, *seeds(12)])
def test_nobody_touches_when_faults_last_longer_than_tau(crossing, seed):
    """A tau of 0.3 s covers little lateness; authority keeps robots apart all the same."""
    outcome = run_seed(crossing, seed, Wish(tau=0.3))
    assert (outcome.touches, outcome.stuck) == ((), ())
    assert outcome.over


def test_without_authority_the_same_campaign_finds_collisions(crossing):
    outcomes = [run_seed(crossing, seed, UNSAFE) for seed in (6, 7, 10)]
    assert any(outcome.touches for outcome in outcomes)


def test_a_run_that_fails_shrinks_to_fewer_faults_that_still_fail(crossing):
    names = [robot.id for robot in crossing.robots]
    failing = (run_seed(crossing, seed, UNSAFE) for seed in range(20))
    outcome = next(one for one in failing if one.touches and len(one.faults) > 1)

    def fails(faults: list[Fault]) -> bool:
        return bool(run_seed(crossing, outcome.seed, UNSAFE, faults).touches)

    faults = read_faults(outcome.faults, names)
    shrunk = shrink(faults, fails)
    assert len(shrunk) < len(faults)
    assert fails(shrunk)
    assert not shrunk or not fails([])


def test_every_proven_plan_is_held_to_survive_everything(five):
    for tau in (None, 0.2):
        _, document = plan_for(five, GOOD, tau)
        assert is_promised(document)
    assert not is_promised(replace(document, proof=None))


def test_every_run_lasts_until_the_fleet_is_over_whoever_is_lost(five):
    scenario, document = plan_for(five, GOOD, None)
    faults = [Fault("kill", f"R{number}", 2.0 + number) for number in range(1, 5)]
    world = make_world(scenario, document, 1, faults)
    world.run(300.0)
    assert world.fleet.phase == OVER
    outcome = run_one(scenario, document, 1, faults)
    assert (outcome.expected, outcome.arrived) == (1, 1)
    assert set(outcome.excused.values()) == {"killed"}
    assert outcome.anyway == 0


def test_whose_link_comes_back_after_over_was_said_is_not_expected():
    """A coordinator that hangs between its farewells goes on with them later."""
    alone = generate("open", 1, 1)
    scenario, document = plan_for(alone, GOOD, None)
    faults = [Fault("cut", "R1", 3.0, 19.0), Fault("coordinator-hang", "", 17.6, 6.0)]
    outcome = run_one(scenario, document, 1, faults)
    assert outcome.over
    assert outcome.seconds < 17.6
    assert outcome.excused == {"R1": "cut"}
    assert outcome.violations == ()


def test_a_robot_that_rests_before_the_only_way_which_a_dead_one_closed_is_closed_in():
    dies = [Fault("kill", "R4", 2.71)]
    outcome = run_seed(generate("grid", 4, 1051), 21023, faults=dies)
    assert outcome.violations == ()
    assert outcome.excused == {"R2": "closed in", "R4": "killed"}


def test_a_robot_that_made_room_while_its_goal_was_closed_is_closed_in(five):
    """A dead robot may stand too near to the goal of R1, which is at the place it gave way to."""
    scenario, document = plan_for(five, GOOD, None)
    world = make_world(scenario, document, 1, [])
    world.run(120.0)
    assert world.fleet.phase == OVER
    x, y = document.robots[0].path.control_points[-1]
    around = world.mission.dispatcher.obstructions._around
    around["R2"] = tuple((x + u, y + v) for u, v in ((-1, -1), (1, -1), (1, 1), (-1, 1)))
    assert excused(world, document, world.now_ns) == {}
    world.robots["R1"].body.place(*document.robots[0].path.control_points[0], 0.0)
    assert excused(world, document, world.now_ns) == {"R1": "closed in"}


def test_robots_that_could_drive_excuse_nobody_whose_way_they_close(five):
    scenario, document = plan_for(five, GOOD, None)
    world = make_world(scenario, document, 1, [])
    world.run(6.0)
    wall = ((0.0, 5.0), (10.0, 5.0), (10.0, 6.0), (0.0, 6.0))
    around = world.mission.dispatcher.obstructions._around
    for robot in document.robots:
        around[robot.id] = wall
    assert excused(world, document, world.now_ns) == {}


def test_robots_that_a_slide_brought_too_near_to_each_other_are_not_expected():
    outcome = run_seed(floor(floor_of(51472)), 51472)
    assert (outcome.violations, outcome.over) == ((), True)
    assert outcome.excused == {"R1": "too near", "R2": "too near"}


def test_on_a_packed_floor_everything_comes_to_an_end():
    """Others made room, and went back, for ever; orders were given again each 20 s."""
    link = Link(delay=0.1, loss=0.1)
    scenario, document = plan_for(generate("puzzle", 6, 222848), link, None)
    words = "clock-pause:R1@6.46:1.47 cut:R6@7.75:8.19 slow:R2@12.52:0.3 corrupt:R1@16.82:2.69"
    faults = read_faults(words.split(), [robot.id for robot in scenario.robots])
    outcome = run_one(scenario, document, 434336, faults)
    assert (outcome.over, outcome.touches) == (True, ())


def test_the_table_says_what_became_of_every_robot(five):
    scenario, document = plan_for(five, GOOD, None)
    finish = max(robot.finish_time for robot in document.robots)
    early = run_one(scenario, document, 1, [Fault("kill", "R1", 3.0)])
    late = run_one(scenario, document, 1, [Fault("kill", "R1", finish + 0.3)])
    assert (early.anyway, late.anyway) == (0, 1)
    answer = add_up([early, late])
    assert (answer.robots, answer.expected, answer.anyway) == (10, 8, 1)
    text = io.StringIO()
    Console(file=text, width=80).print(render(answer))
    said = " ".join(text.getvalue().split())
    assert "robots 10" in said
    assert "arrived 8 of 8 expected" in said
    assert "not expected 2: 2 killed; 1 of them arrived anyway" in said


def test_what_the_code_raises_is_a_violation(five):
    outcome = attempt(five, 3, Wish(), [Fault("no such fault", "R1", 2.0)])
    assert outcome.violations[0].startswith("crashed: ")


def test_a_violation_is_told_with_a_command_that_shows_it_again(five):
    broken = replace(five, link=Link())
    campaign = Campaign(broken, Path("five.toml"), Wish(kinds=("kill",), loss=0.1))
    assert campaign.command(12) == (
        "splinefleet campaign five.toml --seeds 1 --from-seed 12 --faults kill --loss 0.1"
    )
    assert campaign.command(12, [Fault("hang", "R2", 3.0, 1.5)]).endswith(
        "--from-seed 12 --fault hang:R2@3:1.5 --loss 0.1"
    )
    assert campaign.command(12, []).endswith("--from-seed 12 --fault none --loss 0.1")


def test_the_command_answers_in_the_form_of_the_contract():
    result = CliRunner().invoke(
        commands,
        ["campaign", str(PAPER), "--seeds", "2", "--fault", "kill:R3@8", "--jobs", "1", "--json"],
    )
    assert result.exit_code == 0
    answer = json.loads(result.stdout)
    assert (answer["runs"], answer["collisions"], answer["stuck"]) == (2, 0, 0)
    assert answer["arrived"] == answer["expected"] == 8
    assert answer["violations"] == []
    assert answer["latency"]["around"]["count"] == 2
    assert 5.0 < answer["latency"]["around"]["worst"] < 15.0


def test_robots_that_are_sent_around_each_other_again_and_again_take_turns_and_arrive():
    outcome = run_seed(floor(floor_of(53039)), 53039)
    assert (outcome.violations, outcome.over, outcome.stuck) == ((), True, ())
    assert outcome.excused == {"R5": "hang"}
    assert outcome.seconds < 120.0
