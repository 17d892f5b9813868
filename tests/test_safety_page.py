"""docs/safety.md: the code and the tests that its steps name exist."""

import ast
import re
from functools import cache

import pytest

from tests.test_readme import ROOT

PAGE = (ROOT / "docs" / "safety.md").read_text()
CODE = re.findall(r"`([\w/]+\.py):([\w.]+)`", PAGE)
TESTS = re.findall(r"`(tests/[\w/]+\.py)::(\w+)`", PAGE)
ROWS = [
    row.strip("|").split(" | ")
    for table in PAGE.split("| step | code | tests |\n|---|---|---|\n")[1:]
    for row in table.split("\n\n")[0].splitlines()
]


@cache
def names_of(path):
    """Return the functions and classes of a file; methods as Class.method."""
    found = set()
    for node in ast.parse((ROOT / path).read_text()).body:
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            found.add(node.name)
        if isinstance(node, ast.ClassDef):
            found |= {f"{node.name}.{one.name}" for one in node.body if hasattr(one, "name")}
    return found


@pytest.mark.parametrize(("path", "name"), sorted({*CODE, *TESTS}), ids=lambda one: one)
def test_what_the_page_names_exists(path, name):
    assert name in names_of(path)


def test_every_step_names_code_and_tests():
    assert len(ROWS) > 25
    for step, code, tests in ROWS:
        assert re.search(r"`[\w/]+\.py:\w", code), step
        assert re.search(r"`tests/[\w/]+\.py::test_", tests), step


def test_every_step_of_further_courses_has_a_row():
    steps = re.findall(r"^(\d+)\. ", PAGE.split("## Further courses")[1].split("\n## ")[0], re.M)
    rows = {number for step, *_ in ROWS for number in re.findall(r"\d+", step.split(":")[0])}
    assert set(steps) <= rows


def test_no_file_is_named_without_a_name_in_it():
    assert len(re.findall(r"\.py\b", PAGE)) == len(CODE) + len(TESTS)
