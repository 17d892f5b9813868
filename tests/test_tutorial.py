"""The tutorial runs as it is printed, and the library is what it says."""

from __future__ import annotations

import ast
import doctest
import re
import subprocess
import sys

import pytest
from typer.testing import CliRunner

import coordinator
from coordinator.planning import library
from splinefleet import app
from tests.test_readme import ROOT

TUTORIAL = (ROOT / "docs" / "tutorial.md").read_text()
BLOCKS = re.findall(r"```python\n(.*?)```", TUTORIAL, re.DOTALL)


def test_every_line_of_the_tutorial_gives_what_it_says(tmp_path, monkeypatch):
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    monkeypatch.chdir(tmp_path)
    test = doctest.DocTestParser().get_doctest("\n".join(BLOCKS), {}, "tutorial", None, 0)
    assert len(test.examples) > 25
    told = []
    result = doctest.DocTestRunner(verbose=False).run(test, out=told.append)
    assert result.failed == 0, "".join(told)


def test_the_tutorial_uses_every_function_of_the_library():
    functions = [name for name in coordinator.__all__ if name[0].islower()]
    assert len(functions) == 7
    for name in [*functions, "Plan", "Scenario", "InputError", "PlanError"]:
        assert any(re.search(rf"\b{name}\b", block) for block in BLOCKS), name


def test_the_package_gives_the_names_of_the_library_and_no_others():
    assert coordinator.__all__ == library.__all__
    for name in coordinator.__all__:
        given = getattr(coordinator, name)
        assert given is getattr(library, name)
        assert given.__doc__
    with pytest.raises(AttributeError, match="no attribute 'plans'"):
        _ = coordinator.plans


def test_the_names_are_known_to_type_checkers_too():
    tree = ast.parse((ROOT / "coordinator" / "__init__.py").read_text())
    imports = [node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
    known = [alias.name for node in imports for alias in node.names]
    assert set(coordinator.__all__) <= set(known)
    assert (ROOT / "coordinator" / "py.typed").exists()


def test_importing_the_package_alone_loads_no_planner():
    code = "import sys, coordinator; sys.exit('numba' in sys.modules or 'numpy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=False).returncode == 0


def test_commands_are_completed():
    asked = {"_SPLINEFLEET_COMPLETE": "complete_bash", "COMP_WORDS": "splinefleet pl"}
    told = CliRunner().invoke(app, [], prog_name="splinefleet", env=asked | {"COMP_CWORD": "1"})
    assert told.stdout.split() == ["plan", "plot"]
