"""Running fuzz targets as processes with limits, and their outcomes.

Decides: the limits of time and memory.  Must not know: the targets.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from benchmarks.table import ROOT, Row

SECONDS: Final = 30
HANG_S: Final = 10
MEMORY_MB: Final = 1_500
_NICE: Final = 10
_GRACE_S: Final = 120.0
"""Extra time for imports, seeds and the last input [s]."""

_FOLDER: Final = ROOT / "benchmarks" / "results" / "fuzz"
_OUTCOMES: Final = {0: "no crash", 70: "hangs", 71: "takes too much memory", 77: "crashes"}


def fuzz(name: str, seconds: int = SECONDS) -> Row:
    """Run one target and return its figures."""
    folder = _FOLDER / name
    (folder / "corpus").mkdir(parents=True, exist_ok=True)
    command = [
        *(sys.executable, "-m", "benchmarks.fuzz.worker", name, str(folder / "corpus")),
        *(f"-max_total_time={seconds}", f"-timeout={HANG_S}", f"-rss_limit_mb={MEMORY_MB}"),
        *(f"-artifact_prefix={folder}/", "-print_final_stats=1"),
    ]
    memory = Path("/dev/shm")
    with (
        (folder / "said.txt").open("wb") as said,
        TemporaryDirectory(dir=memory if memory.is_dir() else None) as room,
    ):
        process = subprocess.Popen(
            ["nice", "-n", str(_NICE), *command],
            cwd=ROOT,
            env={**os.environ, "TMPDIR": room},
            stdin=subprocess.DEVNULL,
            stdout=said,
            stderr=subprocess.STDOUT,
        )
        try:
            code = process.wait(seconds + _GRACE_S)
        except subprocess.TimeoutExpired:
            code = 70
        finally:
            process.kill()
            process.wait()
    for old in [] if code else list(leftovers(name)):
        old.unlink()
    text = (folder / "said.txt").read_text(errors="replace")
    return {
        "target": name,
        "seconds": seconds,
        "inputs": int(_said(r"executed_units: (\d+)", text) or 0),
        "inputs/s": int(_said(r"exec_per_sec: +(\d+)", text) or 0),
        "corpus": int(_said(r".*corp: (\d+)/", text) or 0),
        "branches": int(_said(r".*cov: (\d+) ", text) or 0),
        "memory MB": int(_said(r"peak_rss_mb: +(\d+)", text) or 0),
        "outcome": _OUTCOMES.get(code, f"ended with code {code}"),
        "what": _said(r"\n=+ Uncaught Python exception: =+\n(.{1,80})", text),
    }


def fuzz_all(names: list[str], seconds: int = SECONDS, jobs: int = 1) -> list[Row]:
    """Run targets, `jobs` at a time."""
    with ThreadPoolExecutor(jobs) as pool:
        return list(pool.map(lambda name: fuzz(name, seconds), names))


def leftovers(name: str = "*") -> Iterator[Path]:
    """Yield the inputs that made a target crash and have not passed since."""
    for kind in ("crash", "timeout", "oom"):
        yield from sorted(_FOLDER.glob(f"{name}/{kind}-*"))


def _said(pattern: str, text: str) -> str:
    """Return the group of the last match; empty if there is none."""
    found = re.findall(pattern, text, re.DOTALL if pattern.startswith(".*") else 0)
    return found[-1] if found else ""
