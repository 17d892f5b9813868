"""Campaigns: one measurement for each of many seeds, on several processes, with results in a file.

With `--kept FILE` each result is appended to a file as soon as it is there, as one line of JSON.  A
campaign that was interrupted, or that is to have more seeds, goes on from there: what was measured
by the same code is not measured again.

Decides: the command-line options of campaigns, and how they are run, kept and written.  Must not
know: what is measured.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any, Final, Generic, TypeVar, get_type_hints

import msgspec

from benchmarks.table import ROOT, Row, show

WORKERS: Final = 2
SAID: Final = 10.0
"""How often [s] progress is printed."""

_CODE: Final = ("benchmarks", "coordinator", "protocol", "robot_agent", "sim", "examples")
"""The folders whose sources results depend on, unless a measurement names its own."""

Asked = TypeVar("Asked")
Answer = TypeVar("Answer")


def parser_of(about: str | None, count: int) -> argparse.ArgumentParser:
    """Return a parser of the options that all campaigns have: count, from_seed, jobs, kept."""
    parser = argparse.ArgumentParser(description=about)
    parser.add_argument("--count", type=int, default=count)
    parser.add_argument("--from-seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=WORKERS, help="how many processes")
    parser.add_argument(
        "--kept", type=Path, help="a file with results to go on from; new ones are added"
    )
    return parser


def options(about: str | None, count: int, effort: int) -> argparse.Namespace:
    """Return the options on the command line: those of `parser_of`, and effort."""
    parser = parser_of(about, count)
    parser.add_argument("--effort", type=int, default=effort)
    return parser.parse_args()


def in_turn(
    measure: Callable[[Asked], Answer],
    asked: Sequence[Asked],
    jobs: int = WORKERS,
    kept: Path | None = None,
    stands_on: Sequence[str] = _CODE,
) -> list[Answer]:
    """Return the measurements of all seeds (or what else is asked), in order.

    Progress is printed on stderr.  With `kept` the return type of `measure` must be one that JSON
    has room for, and of equal things that are asked the answers are equal.  Raises RuntimeError
    with the first seed that has no result when a process dies.  `stands_on`: the folders on whose
    sources the measurement depends; results of other sources do not count.
    """
    kept_file = None if kept is None else _Kept(kept, measure, stands_on)
    answers: dict[int, Answer] = {} if kept_file is None else kept_file.among(asked)
    left = [index for index in range(len(asked)) if index not in answers]
    progress = _Progress(len(asked), len(answers))
    for index, answer in _answers(measure, asked, left, jobs):
        answers[index] = answer
        if kept_file is not None:
            kept_file.add(asked[index], answer)
        progress.tell(len(answers))
    return [answers[index] for index in range(len(asked))]


def record(name: str, tables: dict[str, list[Row]]) -> None:
    """Print tables and write them to benchmarks/results/NAME.json."""
    for title, rows in tables.items():
        show(title, rows)
    folder = ROOT / "benchmarks" / "results"
    folder.mkdir(exist_ok=True)
    (folder / f"{name}.json").write_text(json.dumps(tables, indent=1) + "\n")


def _answers(
    measure: Callable[[Asked], Answer], asked: Sequence[Asked], left: list[int], jobs: int
) -> Iterator[tuple[int, Answer]]:
    """Yield which one was asked, and its answer, as they come; one job needs no other process."""
    if jobs == 1 or not left:
        yield from ((index, measure(asked[index])) for index in left)
        return
    waiting = set(left)
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        futures = {pool.submit(measure, asked[index]): index for index in left}
        try:
            for future in as_completed(futures):
                answer = future.result()
                waiting.remove(futures[future])
                yield futures[future], answer
        except BrokenProcessPool:
            seed = asked[min(waiting)]
            raise RuntimeError(f"a process died with seed {seed} or one soon after") from None
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


class _Kept(Generic[Asked, Answer]):
    """The results of one measurement by this code in a file, which may have others as well."""

    def __init__(
        self, path: Path, measure: Callable[[Asked], Answer], stands_on: Sequence[str]
    ) -> None:
        called, told = measure, ""
        if isinstance(measure, partial):
            called, told = measure.func, json.dumps([measure.args, measure.keywords])
        self._path = path
        self._type: Any = get_type_hints(called)["return"]
        code = called.__code__  # type: ignore[attr-defined]
        self._what = {
            "code": _code_digest(stands_on),
            "what": f"{Path(code.co_filename).stem}.{code.co_name}{told}",
        }

    def among(self, asked: Sequence[Asked]) -> dict[int, Answer]:
        """Return the answers that the file has to what is asked, by its index.

        A line that was cut short when a process was killed counts for nothing.
        """
        text = self._path.read_text() if self._path.exists() else ""
        known: dict[str, Answer] = {}
        for line in text.splitlines():
            try:
                told = json.loads(line)
            except ValueError:
                continue
            if {name: told.get(name) for name in self._what} == self._what:
                known[json.dumps(told["asked"])] = msgspec.convert(told["answer"], self._type)
        names = [json.dumps(one) for one in asked]
        return {index: known[name] for index, name in enumerate(names) if name in known}

    def add(self, asked: Asked, answer: Answer) -> None:
        """Append an answer."""
        told = {**self._what, "asked": asked, "answer": msgspec.to_builtins(answer)}
        with self._path.open("a+b") as file:
            size = file.seek(0, 2)
            file.seek(max(size - 1, 0))
            is_whole = file.read(1) in (b"\n", b"")
            file.write(("" if is_whole else "\n").encode() + json.dumps(told).encode() + b"\n")


class _Progress:
    """How far a campaign is; `before` of `count` results were there when it began."""

    def __init__(self, count: int, before: int) -> None:
        self._count, self._before = count, before
        self._began = self._told = time.monotonic()
        if before:
            sys.stderr.write(f"{before} of {count} were done before\n")

    def tell(self, done: int) -> None:
        """Print progress on stderr, every SAID and at the end."""
        now = time.monotonic()
        if now - self._told < SAID and done < self._count:
            return
        self._told = now
        pace = (now - self._began) / (done - self._before)
        left = pace * (self._count - done) / 60.0
        sys.stderr.write(f"{done} of {self._count} done, {pace:.2f} s each, {left:.0f} min left\n")
        sys.stderr.flush()


def _code_digest(folders: Sequence[str] = _CODE) -> str:
    """Return a digest of the code and the scenarios in folders."""
    digest = hashlib.sha256(sys.version.encode())
    for folder in folders:
        for path in sorted((ROOT / folder).rglob("*")):
            if path.suffix in (".py", ".toml", ".c", ".h"):
                digest.update(str(path.relative_to(ROOT)).encode() + path.read_bytes())
    return digest.hexdigest()[:16]
