"""Packs the robot's core into one module that fits a small MicroPython board.

The code is that of robot_agent/core and of protocol/, statement by statement.  What a board has no
use for goes: docstrings, annotations, the words of errors, imports within the bundle.  Numbers
that have names become literals, and the events of the state machine small integers.

Decides: what is in the bundle, and in which order.  Run as `python -m firmware.micropython.bundle
[--native] FILE.py`; mpy-cross makes an .mpy of it.  With --native it is the shell alone, for a
robot whose core is native code (native/build.py).
"""

from __future__ import annotations

import ast
import importlib
import sys
from pathlib import Path
from typing import Final

from robot_agent.core import transitions

ROOT: Final = Path(__file__).resolve().parents[2]
MODULES: Final = (
    "protocol.phases",
    "protocol.timing",
    "protocol.curve",
    "protocol.timeline",
    "robot_agent.core.transitions",
    "robot_agent.core.clock_sync",
    "robot_agent.core.leader",
    "robot_agent.core.resting_place",
    "robot_agent.core.steering",
    "robot_agent.core.ride",
    "robot_agent.core.agent",
    "firmware.micropython.messages",
    "firmware.micropython.robot",
    "firmware.micropython.loop",
)
"""In an order in which each imports only those before it."""

NATIVE: Final = ("firmware.micropython.native_robot", "firmware.micropython.loop")
"""The modules of a robot whose core is native code."""

_IMPORTS: Final = """from array import array
from binascii import crc32
from math import atan2, cos, floor, inf, sin, sqrt
from struct import pack, pack_into, unpack_from
"""

_EVENTS: Final = {
    value: number
    for number, (name, value) in enumerate(vars(transitions).items())
    if name.isupper() and isinstance(value, str)
}

_WORDS_FOR_PEOPLE: Final = frozenset({"COMMAND_NAMES", "PHASE_NAMES", "FAULT_NAMES", "fault_name"})


def bundle(modules: tuple[str, ...] = MODULES) -> str:
    """Return the source of one module of several."""
    body = [statement for name in modules for statement in _Packer(name).statements()]
    module = ast.fix_missing_locations(ast.Module(body, []))
    while _drop_unused(module):
        pass
    return _IMPORTS + ast.unparse(_Shortener().visit(module)) + "\n"


def _drop_unused(module: ast.Module) -> bool:
    """Drop functions that nothing names, and return whether there were any."""
    used = {"Robot", "run", "hear", "tick", "hear_driver_error"}
    for node in ast.walk(module):
        if isinstance(node, ast.Attribute):
            used.add(node.attr)
        elif isinstance(node, ast.Name):
            used.add(node.id)
    found = False
    for node in ast.walk(module):
        if isinstance(node, ast.Module | ast.ClassDef):
            left = [one for one in node.body if not _is_unused(one, used)]
            found = found or len(left) < len(node.body)
            node.body = left
    return found


def _is_unused(statement: ast.stmt, used: set[str]) -> bool:
    if not isinstance(statement, ast.FunctionDef) or statement.name.startswith("__"):
        return False
    return statement.name not in used


class _Shortener(ast.NodeTransformer):
    """Gives private names two or three letters: a board keeps every name in memory."""

    def __init__(self) -> None:
        self._short: dict[str, str] = {}

    def generic_visit(self, node: ast.AST) -> ast.AST:
        """Shorten the names of a node, whatever it is."""
        for field in ("id", "attr", "arg", "name"):
            name = getattr(node, field, None)
            if isinstance(name, str) and name.startswith("_") and not name.startswith("__"):
                setattr(node, field, self._short.setdefault(name, f"_{len(self._short):x}"))
        return super().generic_visit(node)


class _Packer(ast.NodeTransformer):
    """Packs one module.

    Private names of a module get its name, because several modules have a `_check`.
    """

    def __init__(self, name: str) -> None:
        self._source = ast.parse((ROOT / (name.replace(".", "/") + ".py")).read_text())
        self._module = importlib.import_module(name)
        self._short = name.rpartition(".")[2]
        self._own = {
            target
            for statement in self._source.body
            for target in _defined(statement)
            if target.startswith("_")
        }

    def statements(self) -> list[ast.stmt]:
        """Return the statements of the module that are left."""
        left = []
        for statement in self._source.body:
            names = _defined(statement)
            is_constant = names and all(self._constant(name) is not None for name in names)
            if is_constant or isinstance(statement, ast.Import | ast.ImportFrom | ast.Expr):
                continue
            if _WORDS_FOR_PEOPLE.isdisjoint(names):
                left.append(self.visit(statement))
        return left

    def visit_Name(self, node: ast.Name) -> ast.expr:
        """Put a constant in place of its name."""
        value = self._constant(node.id)
        if isinstance(node.ctx, ast.Load) and value is not None:
            return ast.Constant(value)
        return ast.Name(self._named(node.id), node.ctx)

    def visit_Attribute(self, node: ast.Attribute) -> ast.expr:
        """Put an event, or the table of events, in place of `transitions.NAME`."""
        if isinstance(node.value, ast.Name) and node.value.id == "transitions":
            event = _EVENTS.get(str(getattr(transitions, node.attr)))
            return ast.Name(node.attr) if event is None else ast.Constant(event)
        return self.generic_visit(node)  # type: ignore[return-value]

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.stmt:
        """Drop docstring and annotations."""
        node.name, node.returns = self._named(node.name), None
        for argument in [*node.args.args, *node.args.kwonlyargs]:
            argument.annotation = None
        return self._bare(node)

    def visit_ClassDef(self, node: ast.ClassDef) -> ast.stmt:
        """Drop the docstring."""
        node.name = self._named(node.name)
        return self._bare(node)

    def visit_AnnAssign(self, node: ast.AnnAssign) -> ast.stmt:
        """Drop the annotation."""
        assert node.value is not None
        return self.visit_Assign(ast.Assign([node.target], node.value, lineno=node.lineno))

    def visit_Assign(self, node: ast.Assign) -> ast.stmt:
        """Visit an assignment as usual."""
        return self.generic_visit(node)  # type: ignore[return-value]

    def visit_Raise(self, node: ast.Raise) -> ast.stmt:
        """Drop the words of an error."""
        if isinstance(node.exc, ast.Call):
            node.exc = node.exc.func
        return node

    def _bare(self, node: ast.FunctionDef | ast.ClassDef) -> ast.stmt:
        if ast.get_docstring(node) is not None:
            node.body = node.body[1:] or [ast.Pass()]
        return self.generic_visit(node)  # type: ignore[return-value]

    def _constant(self, name: str) -> int | float | None:
        """Return the number that a module's constant stands for; None for other names."""
        value = getattr(self._module, name, None) if name.isupper() else None
        if isinstance(value, str):
            return _EVENTS.get(value)
        if isinstance(value, int | float) and abs(value) < float("inf"):
            return value
        return None

    def _named(self, name: str) -> str:
        return f"_{self._short}{name}" if name in self._own else name


def _defined(statement: ast.stmt) -> list[str]:
    """Return the names that a statement of a module defines."""
    if isinstance(statement, ast.FunctionDef | ast.ClassDef):
        return [statement.name]
    if not isinstance(statement, ast.Assign):
        return []
    targets = [
        one
        for target in statement.targets
        for one in (target.elts if isinstance(target, ast.Tuple) else [target])
    ]
    return [one.id for one in targets if isinstance(one, ast.Name)]


if __name__ == "__main__":
    Path(sys.argv[-1]).write_text(bundle(NATIVE if "--native" in sys.argv[1:-1] else MODULES))
