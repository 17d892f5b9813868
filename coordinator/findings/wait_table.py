"""Shows waits as a table for people: who waits where, how long, for whom, at which zone.

Decides: the columns.  Must not know: plans or logs.
"""

from __future__ import annotations

from collections.abc import Sequence

from rich.table import Table
from rich.text import Text

from coordinator.base.text_table import plain_table
from coordinator.findings.wait_summary import WaitSummary, longest
from coordinator.scenario.checks import printable


def waits_table(waits: Sequence[WaitSummary], most: int | None = None) -> Table:
    """Return a table with a line for each wait, or for the `most` longest ones.

    The last column says how much later the two robots would arrive in total if the other one
    waited.
    """
    shown = list(waits) if most is None else longest(waits, most)
    title = (
        f"waits, the {len(shown)} longest of {len(waits)}" if len(shown) < len(waits) else "waits"
    )
    epochs = len({wait.epoch for wait in waits}) > 1
    columns = ("robot", "at m", "for s", "lets pass", "its zone m", "their zone m", "other way")
    table = plain_table(*(["epoch"] if epochs else []), *columns, title=title)
    for wait in shown:
        cells = [
            wait.robot,
            "start" if wait.s <= 0.0 else f"{wait.s:.2f}",
            f"{wait.wait:.2f}",
            wait.yields_to,
            _stretch(wait.zone),
            _stretch(wait.their_zone),
            wait.other_way,
        ]
        cells = [str(wait.epoch), *cells] if epochs else cells
        table.add_row(*(Text(printable(cell)) for cell in cells))
    return table


def _stretch(zone: tuple[float, float]) -> str:
    return f"{zone[0]:.2f} to {zone[1]:.2f}"
