"""`splinefleet --help`: commands by what they are for, and shown quickly."""

import re
import subprocess
import sys
from importlib.metadata import version

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


def test_the_page_on_answers_lists_every_command_that_answers_in_json():
    def takers(group, before=""):
        for name, command in group.commands.items():
            if hasattr(command, "commands"):
                yield from takers(command, f"{name} ")
            elif any("--json" in one.opts for one in command.params):
                yield before + name

    page = (ROOT / "docs" / "files.md").read_text()
    listed = " ".join(page.split()).split("These commands take `--json`:")[1].split("Messages")[0]
    assert sorted(re.findall(r"`([a-z ]+)`", listed)) == sorted(takers(typer.main.get_command(app)))


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


def test_the_version_is_told_without_a_command():
    answer = CliRunner().invoke(app, ["--version"])
    assert (answer.exit_code, answer.output) == (0, f"splinefleet {version('splinefleet')}\n")
