"""Campaigns go on where they stopped: nothing is measured twice by the same code."""

import json
import math
from functools import partial
from typing import NamedTuple, get_type_hints

import msgspec
import pytest

from benchmarks import (
    beyond,
    campaign,
    disturbance,
    operator_campaign,
    order_campaign,
    quality,
    reliability,
    safety,
)
from benchmarks.firmware import trials
from sim.campaigns.latencies import Latencies


class Measured(NamedTuple):
    seed: int
    late: float
    said: tuple[str, ...]
    counts: dict[str, int]


measured: list[object] = []


def measure(seed: int) -> Measured:
    measured.append(seed)
    if seed == 99:
        raise ArithmeticError
    return Measured(seed, math.inf if seed == 2 else 0.1 * seed, ("a", "ü"), {"done": seed})


def scaled(moment: tuple[str, float], by: float = 1.0) -> float:
    measured.append(moment)
    return moment[1] * by


@pytest.fixture(autouse=True)
def _nothing_measured():
    measured.clear()


def run(path, seeds, jobs=1):
    measured.clear()
    return campaign.in_turn(measure, seeds, jobs, path)


def test_what_is_kept_is_not_measured_again_and_is_the_same(tmp_path):
    path = tmp_path / "kept.jsonl"
    first = run(path, range(4))
    assert measured == [0, 1, 2, 3]
    assert run(path, range(2, 6)) == [*first[2:], *map(measure, (4, 5))]
    assert measured[:2] == [4, 5]
    assert [json.loads(line)["asked"] for line in path.read_text().splitlines()] == list(range(6))


def test_without_a_file_everything_is_measured(tmp_path):
    assert run(None, range(2)) == run(None, range(2)) == [measure(0), measure(1)]
    assert list(tmp_path.iterdir()) == []


def test_a_campaign_that_fails_keeps_what_it_has(tmp_path):
    path = tmp_path / "kept.jsonl"
    with pytest.raises(ArithmeticError):
        run(path, [7, 99, 8])
    run(path, [7, 8])
    assert measured == [8]


def test_a_line_that_was_cut_short_is_measured_again_and_harms_no_other(tmp_path):
    path = tmp_path / "kept.jsonl"
    run(path, range(3))
    path.write_bytes(path.read_bytes()[:-20])
    run(path, range(4))
    assert measured == [2, 3]
    run(path, range(4))
    assert measured == []


def test_other_code_and_other_measurements_are_measured_for_themselves(tmp_path, monkeypatch):
    path = tmp_path / "kept.jsonl"
    moments = [("R1", 0.5), ("R1", 1.5)]
    for by in (1.0, 2.0, 1.0):
        assert campaign.in_turn(partial(scaled, by=by), moments, 1, path) == [0.5 * by, 1.5 * by]
    assert measured == 2 * moments
    run(path, range(2))
    monkeypatch.setattr(campaign, "_code_digest", lambda _: "of other code")
    run(path, range(2))
    assert measured == [0, 1]


def test_the_digest_is_of_all_code_and_the_same_each_time(tmp_path, monkeypatch):
    before = campaign._code_digest()
    assert campaign._code_digest() == before
    (tmp_path / "sim").mkdir()
    (tmp_path / "sim" / "a.py").write_text("x = 1")
    monkeypatch.setattr(campaign, "ROOT", tmp_path)
    one = campaign._code_digest()
    (tmp_path / "sim" / "a.py").write_text("x = 2")
    assert len({before, one, campaign._code_digest()}) == 3


def test_a_measurement_may_stand_on_folders_of_its_own(tmp_path, monkeypatch):
    monkeypatch.setattr(campaign, "ROOT", tmp_path)
    path, source = tmp_path / "kept.jsonl", tmp_path / "firmware" / "a.c"
    source.parent.mkdir()
    for text in ("int a;", "int a;", "int b;"):
        source.write_text(text)
        campaign.in_turn(measure, [1], 1, path)
        campaign.in_turn(measure, [1], 1, path, ["firmware"])
    assert measured == [1, 1, 1]


def test_progress_says_how_many_are_left(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(campaign, "SAID", 0.0)
    path = tmp_path / "kept.jsonl"
    run(path, range(1))
    run(path, range(3))
    said = capsys.readouterr().err.splitlines()
    assert [line.split(" done")[0] for line in said[1:]] == [
        "1 of 3 were",
        "2 of 3",
        "3 of 3",
    ]


@pytest.mark.parametrize(
    "measures",
    [
        (order_campaign.run_seed, order_campaign.Result(3, ("x",), {"done": 2}, 0, ("kill",))),
        (operator_campaign.run_seed, operator_campaign.Result(3, ("x",), ("kill",), 9, 1, 0)),
        (reliability._death, reliability.Death("R1", 0.5, 3, 0, False, ())),
        (
            reliability.outcome,
            reliability.Outcome(
                3, (), ("a",), True, (), (), 1, 2, {"R": "x"}, (), 1, 2.5, Latencies((0.5,))
            ),
        ),
        (beyond.measure, beyond.Result("open", 1, ("a",), (), 1, 0.5)),
        (disturbance.measure, disturbance.Result(0.5, math.inf, 0.1, 2.0, 3, 0, 0, 1)),
        (quality.measure, quality.Found(1, "a", 2, 0.5, 0.4, True, 1.0, 2.0)),
        (quality.measure, "no plan"),
        (trials.fleet_trial, trials.FleetTrial(4, 5, ["R1 R2"], [])),
        (trials.exact_trial, trials.EventTrial(3_400, 3_000, 0, 0.0)),
        (safety.outcome, safety.Outcome(1, "a", 2, "planned", "", math.inf, 1.0)),
    ],
)
def test_the_results_of_each_campaign_can_be_kept(measures):
    function, result = measures
    text = json.dumps(msgspec.to_builtins(result))
    assert msgspec.convert(json.loads(text), get_type_hints(function)["return"]) == result
