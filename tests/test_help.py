"""`splinefleet --help`: commands by what they are for, and shown quickly."""

import re
import subprocess
import sys

import typer.main
from typer.testing import CliRunner

from splinefleet import app
from tests.test_readme import ROOT

PANELS = ["Plan", "Run", "Operate", "Inspect", "Keys"]


def test_every_command_is_in_a_panel():
    main = typer.main.get_command(app)
    panels = {name: command.rich_help_panel for name, command in main.commands.items()}
    assert {name for name, panel in panels.items() if panel not in PANELS} == set()
    assert set(panels.values()) == set(PANELS)


def test_the_panels_are_shown_in_the_order_of_the_work():
    shown = CliRunner().invoke(app, ["--help"], prog_name="splinefleet").output
    assert [word for word in re.findall(r"╭─ (\w+) ─", shown) if word != "Options"] == PANELS


def test_the_help_loads_no_planner():
    code = (
        "import sys; sys.argv = ['splinefleet', '--help']; import splinefleet, contextlib\n"
        "with contextlib.suppress(SystemExit): splinefleet.main()\n"
        "heavy = {'numpy', 'numba', 'zenoh', 'mcap', 'matplotlib'} & set(sys.modules)\n"
        "sys.exit(' '.join(heavy) or 0)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, ""), done.stderr
