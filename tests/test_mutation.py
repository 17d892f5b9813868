"""Mutation testing itself: what is damaged, which tests a mutant meets, what counts."""

import ast

import pytest

from benchmarks.covering_tests import Covering, covering
from benchmarks.mutants import ROOMS, drawn, mutants_of
from benchmarks.mutation import summary
from tests.test_readme import ROOT

SOURCE = b'''"""Text."""

MOST = 3


def near(a: int, b: int) -> bool:
    if not a:
        raise ValueError("a is 0")
    return abs(a - b) <= min(MOST, 2.0 * b)
'''


def damages(source):
    return {mutant.diff(source)[1] for mutant in mutants_of("agent", "f.py", source)}


def test_operators_comparisons_constants_conditions_and_statements_are_damaged():
    made = damages(SOURCE)
    assert {
        "MOST = 4",
        "if (not (not a)):",
        "if (a):",
        "return abs((a + b)) <= min(MOST, 2.0 * b)",
        "return (abs(a - b) < min(MOST, 2.0 * b))",
        "return (abs(a - b) > min(MOST, 2.0 * b))",
        "return abs(a - b) <= max(MOST, 2.0 * b)",
        "return abs(a - b) <= min(MOST, (2.0 / b))",
        "return abs(a - b) <= min(MOST, 4.0 * b)",
        "pass",
    } <= made
    assert not any("int" in one and "str" in one for one in made)


def test_every_mutant_is_a_program_that_differs():
    for mutant in mutants_of("agent", "f.py", SOURCE):
        damaged = mutant.applied(SOURCE)
        assert damaged != SOURCE
        ast.parse(damaged)
        assert mutant.first <= mutant.line <= mutant.last


def test_the_same_seed_draws_the_same_mutants_of_files_that_are_there():
    one, other = drawn(30, 5, ["agent", "wire"]), drawn(30, 5, ["agent", "wire"])
    assert one == other != drawn(30, 6, ["agent", "wire"])
    assert {mutant.room for mutant in one} == {"agent", "wire"}


@pytest.mark.parametrize("room", ROOMS)
def test_every_room_has_files_and_tests(room):
    assert all(list(ROOT.glob(pattern)) for pattern in ROOMS[room].files)
    assert all((ROOT / test).exists() for test in ROOMS[room].tests)


def a_test(name, seconds, lines):
    return Covering(name, seconds, {"f.py": frozenset(lines)})


def test_a_mutant_meets_the_tests_that_run_its_lines_then_the_others_of_their_files():
    (mutant,) = [one for one in mutants_of("agent", "f.py", SOURCE) if one.text == "(a + b)"]
    tests = [
        a_test("t1.py::quick", 0.1, [7]),
        a_test("t2.py::hits", 0.2, [7, 9]),
        a_test("t1.py::hits", 0.3, [9]),
        a_test("t1.py::hits_too", 0.4, [9]),
        a_test("t3.py::elsewhere", 0.5, [7]),
        a_test("t2.py::long", 100.0, [9]),
    ]
    names = [one.name for one in covering(mutant, tests, 10.0)]
    assert names == ["t2.py::hits", "t1.py::hits", "t1.py::hits_too", "t1.py::quick"]


def test_what_is_run_by_imports_alone_meets_every_test_within_its_budget():
    (mutant,) = [one for one in mutants_of("agent", "f.py", SOURCE) if one.text == "4"]
    tests = [a_test("t1.py::one", 1.0, [7]), Covering("t2.py::two", 2.0, {})]
    assert [one.name for one in covering(mutant, tests, 10.0)] == ["t1.py::one", "t2.py::two"]
    assert [one.name for one in covering(mutant, tests, 1.5)] == ["t1.py::one"]


def test_survivors_are_told_with_what_they_change():
    rows = [
        {"room": "agent", "file": "f.py", "line": 9, "kind": "operator", "result": "survived",
         "before": "a", "after": "b"},
        {"room": "agent", "file": "f.py", "line": 9, "kind": "operator", "result": "detected",
         "before": "a", "after": "c"},
    ]  # fmt: skip
    told = summary(rows)
    assert "50.0%" in told
    assert "- a\n+ b\n  no verdict yet" in told
    assert "+ c" not in told
