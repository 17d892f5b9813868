"""The rule that grants authority, held against its definition."""

import heapq
import random

import numpy as np
import pytest

from coordinator.plan.plan_file import to_json
from coordinator.plan.staircases import NO_STAIRCASES, Staircases
from coordinator.planning.planner import plan_fleet
from coordinator.schedule.authority import EVER, SLACK_MS, Authority
from coordinator.schedule.staircase_making import staircases_of
from sim.floors.generator import generate
from tests.oracles import tracks
from tests.sweeps import seeds

TAU = 300
FAR = 10**9
HEADROOM = 500


def random_staircases(dice, robots=6):
    """Staircases with jumps, ramps and rests, at most t - tau high as those of tau-safe plans."""
    ahead, behind, first, at, need = [], [], [0], [], []
    for j in range(robots):
        for i in sorted(dice.sample(range(robots), dice.randint(0, robots - 1))):
            if i == j:
                continue
            times = sorted(dice.sample(range(500, 20_000), dice.randint(1, 6)))
            needs = sorted(max(0, t - TAU - dice.randint(1, 3_000)) for t in times)
            ahead.append(i)
            behind.append(j)
            at += times
            need += needs
            first.append(len(at))
    whole, small = np.int64, np.int32
    return Staircases(
        TAU,
        np.array(ahead, whole),
        np.array(behind, whole),
        np.array(first, whole),
        np.array(at, small),
        np.array(need, small),
    )


def is_allowed(staircases, robot, time, progress):
    """Whether every other robot has passed what this one needs at a plan time, by definition."""
    return all(
        staircases.need_at(pair, time) < progress[staircases.ahead[pair]]
        for pair in range(len(staircases.ahead))
        if staircases.behind[pair] == robot
    )


@pytest.mark.parametrize("seed", seeds(60))
def test_authority_is_the_greatest_plan_time_that_the_rule_allows(seed):
    dice = random.Random(seed)
    staircases = random_staircases(dice)
    rule, now = Authority(staircases, 6), 0
    rule.grant(now, HEADROOM, FAR)
    while now < 20_000:
        now += dice.randint(50, 1_500)
        for robot in range(6):
            if dice.random() < 0.7:
                late = dice.choice([0, dice.randint(0, 4_000)])
                rule.know(robot, now - late)
        before = rule.granted.copy()
        rule.grant(now, HEADROOM, FAR)
        assert (rule.granted >= before).all()
        for robot in range(6):
            most = min(now, int(rule.progress[robot]) + SLACK_MS) + HEADROOM
            granted = int(rule.granted[robot])
            if granted > before[robot]:
                assert granted <= most
                assert is_allowed(staircases, robot, granted, rule.progress)
            if granted < most:
                assert not is_allowed(staircases, robot, granted + 1, rule.progress)


def test_no_robot_is_known_to_have_driven_more_than_it_was_granted():
    rule = Authority(random_staircases(random.Random(1)), 6)
    rule.grant(1_000, HEADROOM, FAR)
    rule.know(0, 10_000_000)
    assert rule.progress[0] == rule.granted[0] <= 1_000 + HEADROOM


def test_progress_that_is_told_late_takes_nothing_back():
    rule = Authority(random_staircases(random.Random(1)), 6)
    rule.grant(1_000, HEADROOM, FAR)
    rule.know(0, 400)
    rule.know(0, 300)
    assert rule.progress[0] == 400


def test_a_silent_robot_is_granted_no_more_than_the_slack():
    rule = Authority(random_staircases(random.Random(2)), 6)
    for now in range(0, 60_000, 100):
        rule.grant(now, HEADROOM, FAR)
        for robot in range(1, 6):
            rule.know(robot, now)
    assert rule.granted[0] <= SLACK_MS + HEADROOM


@pytest.fixture(scope="module", params=["ring", "warehouse", "circle"])
def fleet(request):
    plan = plan_fleet(generate(request.param, 10, 1), effort=0)
    terms, driven = plan.document, plan.driven
    return terms, staircases_of(driven, terms.tau, terms.margin), tracks(to_json(terms))


GRID = 0.01
STEP = 50


def drive(fleet, seed, dead=None, obeys=True):
    """Drive a plan with random stalls and reports that come late; return least slack and progress.

    Robots drive at up to 1.2 times planned speed or not at all; nothing but authority keeps them
    apart.  The least slack is the least distance less the need [m].  A robot that is dead stops on
    its way; then the drive ends after twice the planned time.
    """
    terms, staircases, paths = fleet
    dice, count = random.Random(seed), len(paths)
    rule, driven = Authority(staircases, count), np.zeros(count)
    radius = np.array([path.radius for path in paths])
    need = radius[:, None] + radius + terms.margin - 1e4 * np.eye(count)
    finish = max(path.finish for path in paths)
    grid = np.arange(0.0, finish + 1.0, GRID)
    table = np.array([path.at(grid) for path in paths])
    end, everybody = 1000.0 * finish, np.arange(count)
    stalled, reports, least, now = np.zeros(count), [], np.inf, 0
    while now < (20 if dead is None else 2) * end and (driven < end).any():
        now += STEP
        if dice.random() < 0.9:
            rule.grant(now, HEADROOM, FAR)
        for robot in range(count):
            if dice.random() < 0.02:
                stalled[robot] = now + dice.uniform(0.0, 6_000.0)
            if now < stalled[robot] or (robot == dead and driven[robot] > 0.4 * end):
                continue
            most = rule.granted[robot] if obeys else now
            driven[robot] = max(driven[robot], min(driven[robot] + 1.2 * STEP, now, most))
            heapq.heappush(reports, (now + dice.uniform(0.0, 2_000.0), robot, int(driven[robot])))
        while reports and reports[0][0] <= now:
            rule.know(*heapq.heappop(reports)[1:])
        part, whole = np.modf(np.minimum(driven / 1000.0, finish) / GRID)
        at, part = whole.astype(int), part[:, None]
        places = (1.0 - part) * table[everybody, at] + part * table[everybody, at + 1]
        gaps = np.hypot(*(places[:, None] - places).transpose(2, 0, 1))
        least = min(least, float((gaps - need).min()))
    return least, driven / end


@pytest.mark.parametrize("seed", seeds(4))
def test_robots_that_stall_and_report_late_keep_clear_and_all_arrive(fleet, seed):
    least, driven = drive(fleet, seed)
    assert least > -2e-3
    assert (driven >= 1.0).all()


@pytest.mark.parametrize("seed", seeds(3))
def test_a_robot_that_dies_holds_only_those_behind_it(fleet, seed):
    least, driven = drive(fleet, seed, dead=seed)
    assert least > -2e-3
    assert (driven[np.arange(len(driven)) != seed] > 0.4).any()


def test_without_authority_the_same_robots_touch(fleet):
    assert min(drive(fleet, seed, obeys=False)[0] for seed in range(2)) < -0.05


@pytest.mark.parametrize("seed", seeds(40))
def test_other_staircases_count_from_then_on_unless_they_forbid_what_was_told(seed):
    dice = random.Random(seed)
    rule, now = Authority(random_staircases(dice), 6), 0
    rule.grant(now, HEADROOM, FAR)
    renewed = 0
    while now < 20_000:
        now += dice.randint(50, 1_500)
        for robot in range(6):
            rule.know(robot, now - dice.choice([0, dice.randint(0, 4_000)]))
        rule.grant(now, HEADROOM, FAR)
        other = random_staircases(dice)
        told = rule.told.tolist()
        fits = all(is_allowed(other, robot, told[robot], rule.progress) for robot in range(6))
        assert rule.allows(other) == fits
        if fits:
            rule.renew(other)
        renewed += fits
        before = rule.granted.copy()
        rule.grant(now + 100, HEADROOM, FAR)
        for robot in np.flatnonzero(rule.granted > before).tolist():
            if fits:
                assert is_allowed(other, robot, int(rule.granted[robot]), rule.progress)
    assert renewed


def test_a_course_that_is_barred_is_granted_nothing_and_one_that_is_opened_holds_others_behind():
    at, need = np.array([9_000, 20_000], np.int32), np.array([8_000, 19_000], np.int32)
    one = Staircases(TAU, np.array([0]), np.array([1]), np.array([0, 2]), at, need)
    rule = Authority(one, 2)
    for now in range(0, 5_000, 100):
        rule.grant(now, HEADROOM, FAR)
        rule.know(1, now)
    rule.open(0, 7_000, 7_000)
    rule.know(1, 6_400)
    rule.grant(9_500, HEADROOM, FAR)
    assert (rule.progress[0], rule.granted[0]) == (7_000, 0)
    assert rule.granted[1] == rule.progress[1] + SLACK_MS + HEADROOM
    rule.know(1, 6_900)
    rule.grant(9_500, HEADROOM, FAR)
    assert rule.granted[1] == 8_999
    rule.barred[0] = False
    rule.grant(9_500, HEADROOM, FAR)
    assert rule.granted[0] == 9_000 + HEADROOM


def test_a_course_that_was_made_room_for_runs_along_another_one_until_it_begins():
    rule, alone = Authority(NO_STAIRCASES, 1), min(1_000, SLACK_MS) + HEADROOM
    rule.grow(1)
    rule.renew(NO_STAIRCASES)
    assert (rule.leads[1], rule.most[1], rule.barred[1], rule.granted[1]) == (-1, EVER, True, 0)
    rule.grant(1_000, HEADROOM, FAR)
    assert rule.granted.tolist() == [alone, 0]
    rule.open(1, 0, 0)
    rule.follow(1, 0, 300)
    rule.grant(1_000, HEADROOM, FAR)
    assert rule.granted[1] == 300
    rule.part(1)
    rule.grant(1_000, HEADROOM, FAR)
    assert rule.granted[1] == alone
