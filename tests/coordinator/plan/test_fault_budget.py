"""The fault budget: the sum of the shares, and which faults a tau covers."""

import math

import pytest

from coordinator.plan.document import Limits
from coordinator.plan.fault_budget import budget_for, resolve_tau, share_for_lateness
from coordinator.scenario.model import Link
from protocol import timing

SECOND = 1e9


def limits(speed, accel):
    return Limits(max_speed=speed, max_accel=accel)


def test_auto_is_the_sum_of_all_shares_counted_by_hand():
    budget = budget_for([limits(0.5, 0.5), limits(1.0, 0.8)], Link())
    by_hand = (
        timing.LATENESS
        + 2 * timing.CLOCK_ERROR
        + timing.REPORT_TIMEOUT
        + timing.LEASE
        + 1.25 * SECOND
    ) / SECOND
    assert resolve_tau("auto", budget) == pytest.approx(by_hand, abs=1e-3)
    assert resolve_tau("auto", budget) >= budget.cut_off - 1e-9


def test_auto_survives_every_fault():
    budget = budget_for([limits(0.7, 0.3)], Link())
    assert budget.survives(resolve_tau("auto", budget)) == ["late", "stop", "coordinator"]


def test_a_tau_by_hand_stands_and_says_what_it_does_not_survive():
    budget = budget_for([limits(1.0, 1.0)], Link())
    assert resolve_tau(0.31, budget) == 0.31
    assert budget.survives(0.1) == []
    assert budget.survives(budget.late) == ["late"]
    assert budget.survives(budget.lost_coordinator) == ["late", "coordinator"]
    assert budget.survives(budget.cut_off - 0.001) == ["late", "coordinator"]


def test_the_slowest_brake_counts_and_robots_that_stop_at_once_need_none():
    assert budget_for([limits(1.0, 4.0), limits(1.0, 0.5)], Link()).brake == 2.0
    assert budget_for([limits(1.0, None)], Link()).brake == 0.0
    assert budget_for([], Link()).brake == 0.0


def test_auto_is_a_whole_number_of_milliseconds():
    tau = resolve_tau("auto", budget_for([limits(1.0, 0.7)], Link()))
    assert math.isclose(tau * 1000.0, round(tau * 1000.0), abs_tol=1e-9)


def test_lateness_gets_at_most_half_of_tau():
    assert share_for_lateness(0.2) == pytest.approx(0.1)
    assert share_for_lateness(60.0) == pytest.approx(timing.LATENESS / SECOND)
    assert share_for_lateness(0.0) == 0.0
