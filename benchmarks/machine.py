"""Measurements of processes of this machine."""

from __future__ import annotations

import os
from pathlib import Path


def memory_mb(process: int) -> float:
    """Return the resident memory [MB] of the process with this id; 0 when it has ended."""
    try:
        pages = int(Path(f"/proc/{process}/statm").read_text().split()[1])
    except FileNotFoundError:
        return 0.0
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6
