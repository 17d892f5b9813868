"""Tables that fit a terminal of 80 columns: long cells wrap, so that rows get taller.

Decides: how columns shrink.  Must not know: what the columns contain.
"""

from __future__ import annotations

from rich.table import Table
from rich.text import Text


def plain_table(*columns: str, title: str = "") -> Table:
    """Return a table with these columns, each at least as wide as the longest word of its name."""
    table = Table(title=Text(title) if title else None, title_justify="left", title_style="")
    for column in columns:
        widest = max((len(word) for word in column.split()), default=1)
        table.add_column(column, overflow="fold", min_width=widest)
    return table
