"""Plain values of the command line are read without pydantic; all others as typer reads them."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.processes

_ROOT = Path(__file__).resolve().parents[3]

_PROGRAM = """
import sys
from pathlib import Path
from typing import Annotated, Literal

import typer

if sys.argv[1] == "without":
    parameter, types = typer.core._TyperParameter, typer._param_types
    del typer.core._TyperParameter, typer._param_types
    sys.modules["typer._param_types"] = None
from coordinator.cli.quick_options import read_quickly

if sys.argv[1] == "without":
    typer.core._TyperParameter = parameter
    typer._param_types = sys.modules["typer._param_types"] = types

app = typer.Typer(pretty_exceptions_enable=False)


@app.command()
def show(
    file: Path,
    there: Annotated[Path | None, typer.Option(exists=True)] = None,
    name: str = "none",
    kind: Literal["a", "b"] | None = None,
    number: Annotated[int, typer.Option(min=1)] = 3,
    many: list[str] = [],
    pair: tuple[float, float] | None = None,
    parsed: Annotated[int | None, typer.Option(parser=len)] = None,
    flag: bool = False,
) -> None:
    print(repr((file, there, name, kind, number, many, pair, parsed, flag)))


if sys.argv.pop(1) != "usually":
    read_quickly()
try:
    app(standalone_mode=False)
except typer.TyperException as error:
    print(type(error).__name__, error.format_message())
print("pydantic" in sys.modules)
"""


def _run(folder: Path, program: str, how: str, line: str) -> list[str]:
    (folder / "program.py").write_text(program, encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "program.py", how, *line.split()],
        cwd=folder,
        capture_output=True,
        text=True,
        check=True,
        timeout=60,
        env=os.environ | {"PYTHONPATH": str(_ROOT)},
    )
    return done.stdout.splitlines()


@pytest.mark.parametrize(
    "line",
    [
        "a.toml --name R1 --there program.py --flag",
        "a.toml --there absent.toml",
        "a.toml --kind c",
        "a.toml --kind a --number 2 --many x --many y --pair 1 2.5 --parsed four",
        "a.toml --number 0",
        "--name R1",
    ],
)
def test_a_command_line_is_read_as_it_is_without_the_shortcut(tmp_path: Path, line: str) -> None:
    quickly, usually = (_run(tmp_path, _PROGRAM, how, line) for how in ("quickly", "usually"))
    assert quickly[:-1] == usually[:-1]


def test_a_typer_that_has_other_names_within_reads_in_its_own_way(tmp_path: Path) -> None:
    line = "a.toml --name R1 --kind a --number 2"
    assert _run(tmp_path, _PROGRAM, "without", line) == _run(tmp_path, _PROGRAM, "usually", line)


def test_texts_and_paths_and_absent_options_need_no_validator(tmp_path: Path) -> None:
    program = _PROGRAM.replace("    many: list[str] = [],\n", "").replace("many, ", "")
    assert _run(tmp_path, program, "usually", "a.toml --name R1")[-1] == "True"
    assert _run(tmp_path, program, "quickly", "a.toml --name R1")[-1] == "False"
