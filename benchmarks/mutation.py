"""Mutation testing of what safety rests on: `python -m benchmarks.mutation --count 600 --seed 1`.

A mutant is the product with one small damage: an operator, comparison, constant or condition
changed, a statement left out, two arguments swapped.  Each runs against the tests of its room in a
copy of the project; a mutant that no test notices survives.  Tests that fail, or take too long,
where nothing is damaged detect nothing: their mutants are left out.  Kernels that are damaged run
with compilation switched off.  Each result is a line of the file of results, and a run that was
stopped goes on after the last one.

Decides: which mutants there are, which are drawn, and what counts as detected.  A survivor that is
known to change nothing stands in benchmarks/mutation_verdicts.json with the reason.
"""

from __future__ import annotations

import argparse
import ast
import json
import os
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from random import Random
from typing import Final

from benchmarks.table import ROOT

VERDICTS: Final = Path(__file__).with_name("mutation_verdicts.json")
MEMORY: Final = 6 * 2**30
"""Bytes of address space that the tests of one mutant may take."""

NO_COMPILING: Final = "NUMBA_DISABLE_JIT"
COPIED: Final = (
    "protocol", "coordinator", "robot_agent", "sim", "benchmarks", "tests", "examples", "docs",
    "splinefleet.py", "pyproject.toml", "README.md", "CHANGELOG.md",
)  # fmt: skip


@dataclass(frozen=True)
class Room:
    """Files that are damaged, as patterns, and the tests that have to notice."""

    files: tuple[str, ...]
    tests: tuple[str, ...]


ROOMS: Final = {
    "proof": Room(
        ("coordinator/proof/*.py", "coordinator/scenario/margin.py"),
        ("tests/coordinator/proof", "tests/second_checker"),
    ),
    "agent": Room(("robot_agent/core/*.py",), ("tests/robot_agent/core",)),
    "fleet": Room(
        ("coordinator/fleet/*.py",),
        ("tests/coordinator/fleet", "tests/coordinator/mission", "tests/sim/world"),
    ),
    "authority": Room(
        ("coordinator/schedule/authority*.py", "coordinator/schedule/staircase_*.py",
         "coordinator/plan/staircases.py", "coordinator/plan/course_staircases.py"),
        ("tests/coordinator/schedule/test_authority.py",
         "tests/coordinator/schedule/test_staircase_making.py",
         "tests/coordinator/plan/test_course_staircases.py",
         "tests/coordinator/proof/test_precedence.py",
         "tests/coordinator/fleet/test_grants.py"),
    ),
    "wire": Room(
        ("protocol/shared_clock.py", "protocol/codec.py", "protocol/messages.py",
         "protocol/plan_*.py", "protocol/timeline.py", "protocol/curve.py",
         "coordinator/plan/wire.py"),
        ("tests/protocol/test_codec.py", "tests/protocol/test_curve.py",
         "tests/protocol/test_shared_clock.py", "tests/protocol/test_timeline.py",
         "tests/protocol/test_wire_format.py", "tests/coordinator/plan",
         "tests/coordinator/proof"),
    ),
}  # fmt: skip


@dataclass(frozen=True)
class Mutant:
    """One damage: bytes `begin` to `end` of a file become `text`."""

    room: str
    file: str
    line: int
    begin: int
    end: int
    text: str
    kind: str

    @property
    def kind_of_run(self) -> tuple[str, bool]:
        """Its room, and whether compilation is off."""
        return self.room, self.file.endswith("_kernels.py")

    @property
    def name(self) -> str:
        """What distinguishes it in the file of results."""
        return f"{self.file}:{self.begin}:{self.end}:{self.text}"

    def applied(self, source: bytes) -> bytes:
        """Return its file with the damage."""
        return source[: self.begin] + self.text.encode() + source[self.end :]

    def diff(self, source: bytes) -> tuple[str, str]:
        """Return the lines that it changes, before and after, without indentation."""
        first = source.rfind(b"\n", 0, self.begin) + 1
        last = source.find(b"\n", self.end)
        after = self.applied(source)
        until = last + len(after) - len(source)
        return source[first:last].decode().strip(), after[first:until].decode().strip()


_COMPARISONS: Final[dict[type[ast.cmpop], tuple[type[ast.cmpop], ...]]] = {
    ast.Lt: (ast.LtE, ast.GtE),
    ast.LtE: (ast.Lt, ast.Gt),
    ast.Gt: (ast.GtE, ast.LtE),
    ast.GtE: (ast.Gt, ast.Lt),
    ast.Eq: (ast.NotEq,),
    ast.NotEq: (ast.Eq,),
    ast.Is: (ast.IsNot,),
    ast.IsNot: (ast.Is,),
    ast.In: (ast.NotIn,),
    ast.NotIn: (ast.In,),
}
_OPERATORS: Final[dict[type[ast.operator], type[ast.operator]]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.FloorDiv: ast.Mult,
    ast.Mod: ast.Mult,
    ast.Pow: ast.Mult,
    ast.BitOr: ast.BitAnd,
    ast.BitAnd: ast.BitOr,
}
_NAMES: Final = {"min": "max", "max": "min", "any": "all", "all": "any", "minimum": "maximum",
                 "maximum": "minimum", "floor": "ceil", "ceil": "floor"}  # fmt: skip

Change = tuple[ast.AST, str, str]
"""The node whose text is replaced, by what, and the kind of damage."""


def _changes(node: ast.AST) -> Iterator[Change]:
    """Yield the damages of one node."""
    if isinstance(node, ast.Compare) and len(node.ops) == 1:
        for other in _COMPARISONS.get(type(node.ops[0]), ()):
            damaged = ast.Compare(node.left, [other()], node.comparators)
            yield node, f"({ast.unparse(damaged)})", "comparison"
    elif isinstance(node, ast.BinOp) and type(node.op) in _OPERATORS:
        damaged_op = ast.BinOp(node.left, _OPERATORS[type(node.op)](), node.right)
        yield node, f"({ast.unparse(damaged_op)})", "operator"
    elif isinstance(node, ast.BoolOp):
        other_op = ast.Or() if isinstance(node.op, ast.And) else ast.And()
        yield node, f"({ast.unparse(ast.BoolOp(other_op, node.values))})", "operator"
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, (ast.USub, ast.Not)):
        yield node, f"({ast.unparse(node.operand)})", "operator"
    elif isinstance(node, ast.Constant):
        yield from _other_constants(node)
    elif isinstance(node, ast.Call):
        yield from _other_calls(node)
    elif isinstance(node, (ast.If, ast.While, ast.IfExp)):
        yield node.test, f"(not ({ast.unparse(node.test)}))", "condition"
    elif isinstance(node, (ast.Assign, ast.AugAssign, ast.Raise, ast.Break, ast.Continue)):
        if not isinstance(node, ast.Assign) or not isinstance(node.targets[0], ast.Name):
            yield node, "pass", "statement"
    elif isinstance(node, ast.Expr) and isinstance(node.value, ast.Call):
        yield node, "pass", "statement"


def _other_constants(node: ast.Constant) -> Iterator[Change]:
    value = node.value
    if isinstance(value, bool):
        yield node, str(not value), "constant"
    elif isinstance(value, int):
        yield node, str(value + 1), "constant"
    elif isinstance(value, float):
        yield node, repr(2.0 * value or 1.0), "constant"


def _other_calls(node: ast.Call) -> Iterator[Change]:
    name = node.func.attr if isinstance(node.func, ast.Attribute) else ast.unparse(node.func)
    if len(node.args) >= 2 and name not in {*_NAMES, "isinstance", "hypot"}:
        first, second, *rest = node.args
        if ast.dump(first) != ast.dump(second) and not isinstance(first, ast.Starred):
            yield (
                node,
                ast.unparse(ast.Call(node.func, [second, first, *rest], node.keywords)),
                ("arguments"),
            )
    if name in _NAMES:
        text = ast.unparse(node.func)
        yield node.func, text[: len(text) - len(name)] + _NAMES[name], "operator"


def _visited(node: ast.AST) -> Iterator[ast.AST]:
    """Yield the nodes that are damaged: no annotations, texts, decorators or words of errors."""
    yield node
    if isinstance(node, (ast.JoinedStr, ast.Raise, ast.Import, ast.ImportFrom)):
        return
    for field, value in ast.iter_fields(node):
        if field in ("annotation", "returns", "decorator_list", "bases", "type_params"):
            continue
        for child in value if isinstance(value, list) else [value]:
            if isinstance(child, ast.AST):
                yield from _visited(child)


def mutants_of(room: str, file: str, source: bytes) -> list[Mutant]:
    """Return all mutants of a file."""
    starts = [0]
    for line in source.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))
    found = []
    for node in _visited(ast.parse(source)):
        for place, text, kind in _changes(node):
            begin = starts[place.lineno - 1] + place.col_offset  # type: ignore[attr-defined]
            end = starts[place.end_lineno - 1] + place.end_col_offset  # type: ignore[attr-defined]
            line = source.count(b"\n", 0, begin) + 1
            found.append(Mutant(room, file, line, begin, end, text, kind))
    return found


def drawn(count: int, seed: int, rooms: Sequence[str]) -> list[Mutant]:
    """Return mutants drawn by a seed, from rooms in proportion to how many they have."""
    every = [
        mutant
        for room in rooms
        for pattern in ROOMS[room].files
        for path in sorted(ROOT.glob(pattern))
        for mutant in mutants_of(room, str(path.relative_to(ROOT)), path.read_bytes())
    ]
    return Random(seed).sample(every, min(count, len(every)))


def copied(folder: Path) -> None:
    """Copy the project, with the machine code of its kernels."""
    for name in COPIED:
        if (ROOT / name).is_dir():
            shutil.copytree(ROOT / name, folder / name, symlinks=True)
        else:
            shutil.copy(ROOT / name, folder / name)


def ordered_tests(mutant: Mutant) -> list[str]:
    """Return the tests of a mutant's room, those named after its file first."""
    tests, stem = ROOMS[mutant.room].tests, Path(mutant.file).stem
    own = [str(p.relative_to(ROOT)) for p in sorted((ROOT / "tests").rglob(f"test_{stem}.py"))]
    return [*own, *tests]


def run(mutant: Mutant, folder: Path, limit: float, quick: bool) -> str:
    """Return "detected", "timeout" or "survived"."""
    path = folder / mutant.file
    source = path.read_bytes()
    path.write_bytes(mutant.applied(source))
    environment = os.environ | {"PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1"}
    if mutant.kind_of_run[1]:
        environment[NO_COMPILING] = "1"
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider"]
    command += ["--quick"] * quick + ordered_tests(mutant)
    process = subprocess.Popen(
        command, cwd=folder, env=environment, start_new_session=True,
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY)),
    )  # fmt: skip
    try:
        return "detected" if process.wait(limit) else "survived"
    except subprocess.TimeoutExpired:
        return "timeout"
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()
        path.write_bytes(source)


def main() -> None:
    """Run the mutants that were drawn and are not in the file of results yet, then sum up."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.mutation")
    parser.add_argument("--count", type=int, default=600)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--rooms", nargs="+", choices=ROOMS, default=list(ROOMS))
    parser.add_argument("--limit", type=float, default=900.0, help="seconds for one mutant")
    parser.add_argument("--minutes", type=float, default=1e9, help="begin no mutant after this")
    parser.add_argument("--quick", action="store_true", help="a tenth of the sweeps over seeds")
    parser.add_argument("--kept", type=Path, default=ROOT / "benchmarks/results/mutants.jsonl")
    asked = parser.parse_args()
    asked.kept.parent.mkdir(exist_ok=True)
    chosen = drawn(asked.count, asked.seed, asked.rooms)
    done = {row["name"]: row for row in _rows(asked.kept)}
    end = time.monotonic() + 60.0 * asked.minutes
    sound: dict[tuple[str, bool], str] = {}
    with tempfile.TemporaryDirectory() as name, asked.kept.open("a") as kept:
        folder = Path(name)
        copied(folder)
        for mutant in chosen:
            if mutant.name in done or time.monotonic() > end:
                continue
            how = mutant.kind_of_run
            if how not in sound:
                whole = replace(mutant, begin=0, end=0, text="")
                sound[how] = run(whole, folder, asked.limit, asked.quick)
            if sound[how] != "survived":
                continue
            began = time.monotonic()
            result = run(mutant, folder, asked.limit, asked.quick)
            before, after = mutant.diff((ROOT / mutant.file).read_bytes())
            row = asdict(mutant) | {
                "name": mutant.name, "result": result, "before": before, "after": after,
                "seconds": round(time.monotonic() - began, 1),
            }  # fmt: skip
            done[mutant.name] = row
            kept.write(json.dumps(row) + "\n")
            kept.flush()
    for (room, is_plain), result in sound.items():
        if result != "survived":
            off = " without compilation" if is_plain else ""
            sys.stdout.write(
                f"left out: {room}{off}, whose tests do not pass undamaged: {result}\n"
            )
    sys.stdout.write(summary([done[one.name] for one in chosen if one.name in done]))


def _rows(path: Path) -> list[dict[str, str]]:
    return [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []


def summary(rows: Sequence[dict[str, str]]) -> str:
    """Return scores by room and the survivors as diffs.

    Adjusted: survivors that are known to change nothing are left out.
    """
    known = {(one["file"], one["before"], one["after"]): one for one in _verdicts()}
    lines = ["room       mutants  detected  survived  changes nothing  raw    adjusted"]
    survivors = [row for row in rows if row["result"] == "survived"]
    for room in [*ROOMS, "all"]:
        own = [row for row in rows if room in (row["room"], "all")]
        if not own:
            continue
        left = [row for row in own if row["result"] == "survived"]
        same = sum((row["file"], row["before"], row["after"]) in known for row in left)
        seen = len(own) - len(left)
        raw, adjusted = seen / len(own), seen / max(len(own) - same, 1)
        lines.append(
            f"{room:10} {len(own):7} {seen:9} {len(left):9} {same:16} {raw:6.1%} {adjusted:9.1%}"
        )
    for row in survivors:
        verdict = known.get((row["file"], row["before"], row["after"]))
        lines += ["", f"{row['file']}:{row['line']} ({row['kind']})"]
        lines += [f"- {row['before']}", f"+ {row['after']}"]
        lines += [f"  changes nothing: {verdict['why']}"] if verdict else ["  no verdict yet"]
    return "\n".join(lines) + "\n"


def _verdicts() -> list[dict[str, str]]:
    return json.loads(VERDICTS.read_text()) if VERDICTS.exists() else []


if __name__ == "__main__":
    main()
