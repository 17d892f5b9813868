"""Mutants: the product with one small damage each.

An operator, comparison, constant or condition changed, a statement left out, two arguments
swapped.  Decides: which files are damaged, how, which tests have to notice, and which mutants are
drawn.  Must not know: how they are run (mutation.py).
"""

from __future__ import annotations

import ast
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from random import Random
from typing import Final

from benchmarks.table import ROOT


@dataclass(frozen=True)
class Room:
    """Files that are damaged, as patterns, and the tests that have to notice."""

    files: tuple[str, ...]
    tests: tuple[str, ...]


ROOMS: Final = {
    "proof": Room(
        ("coordinator/proof/*.py", "coordinator/scenario/margin.py"),
        ("tests/coordinator/proof", "tests/second_checker", "tests/coordinator/findings",
         "tests/coordinator/scenario/test_margin.py"),
    ),
    "agent": Room(
        ("robot_agent/core/*.py",),
        ("tests/robot_agent/core", "tests/firmware/test_golden.py",
         "tests/firmware/test_two_languages.py"),
    ),
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
         "tests/coordinator/planning/test_course_proposal.py",
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
    """One damage: bytes `begin` to `end` of a file become `text`.

    It lies in the lines `first` to `last`: from the beginning of its statement to its own end.
    """

    room: str
    file: str
    line: int
    first: int
    last: int
    begin: int
    end: int
    text: str
    kind: str

    @property
    def is_plain(self) -> bool:
        """Whether its tests run without compilation."""
        return self.file.endswith("_kernels.py")

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


def _visited(node: ast.AST, statement: int = 1) -> Iterator[tuple[ast.AST, int]]:
    """Yield the nodes that are damaged, and the lines where their statements begin.

    These are no annotations, texts, decorators or words of errors.
    """
    if isinstance(node, ast.stmt):
        statement = node.lineno
    yield node, statement
    if isinstance(node, (ast.JoinedStr, ast.Raise, ast.Import, ast.ImportFrom)):
        return
    for field, value in ast.iter_fields(node):
        if field in ("annotation", "returns", "decorator_list", "bases", "type_params"):
            continue
        for child in value if isinstance(value, list) else [value]:
            if isinstance(child, ast.AST):
                yield from _visited(child, statement)


def mutants_of(room: str, file: str, source: bytes) -> list[Mutant]:
    """Return all mutants of a file."""
    starts = [0]
    for line in source.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))
    found = []
    for node, statement in _visited(ast.parse(source)):
        for place, text, kind in _changes(node):
            begin = starts[place.lineno - 1] + place.col_offset  # type: ignore[attr-defined]
            end = starts[place.end_lineno - 1] + place.end_col_offset  # type: ignore[attr-defined]
            line = source.count(b"\n", 0, begin) + 1
            last: int = place.end_lineno  # type: ignore[attr-defined]
            found.append(Mutant(room, file, line, statement, last, begin, end, text, kind))
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
