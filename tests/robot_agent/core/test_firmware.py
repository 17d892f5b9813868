"""What a microcontroller has to run may stand on nothing that it does not have."""

from __future__ import annotations

import ast
import inspect
import json
import os
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.robot_agent.core.phases import MOTION, PATH
from tests.robot_agent.core.rides import RULES

ROOT = Path(__file__).parents[3]
FIRMWARE = (
    "robot_agent/core/agent.py",
    "robot_agent/core/leader.py",
    "robot_agent/core/resting_place.py",
    "robot_agent/core/ride.py",
    "robot_agent/core/transitions.py",
    "robot_agent/core/steering.py",
    "robot_agent/core/clock_sync.py",
    "protocol/curve.py",
    "protocol/timeline.py",
    "protocol/phases.py",
    "protocol/timing.py",
)
TREES = {name: ast.parse((ROOT / name).read_text()) for name in FIRMWARE}


def words(text: str) -> set[str]:
    return set(text.split())


LIBRARIES = {
    "math": words(
        "acos acosh asin asinh atan atan2 atanh ceil copysign cos cosh degrees e exp fabs floor "
        "fmod frexp inf isclose isfinite isinf isnan ldexp log log10 log2 modf nan pi pow radians "
        "sin sinh sqrt tan tanh tau trunc"
    ),
    "array": {"array"},
    "struct": {"calcsize", "pack", "pack_into", "unpack", "unpack_from"},
}
"""The modules of MicroPython 1.28 in use, and what they offer: no `math.hypot`, for one."""

BUILTINS = words(
    "abs all any bool bytearray bytes divmod enumerate float int isinstance len list dict max min "
    "range reversed round set sorted str sum tuple zip ArithmeticError IndexError KeyError "
    "OverflowError TypeError ValueError ZeroDivisionError"
)
METHODS = words(
    "append clear copy count extend index insert pop remove reverse sort get items keys values "
    "update"
)
KEYWORDS = {"sorted": {"key", "reverse"}, "min": {"key", "default"}, "max": {"key", "default"}}
"""What built-in functions take by name; `zip` for one has no `strict`."""

SYNTAX = words(
    "Module Import ImportFrom alias ClassDef FunctionDef arguments arg Return Raise Assign "
    "AugAssign AnnAssign For While If Break Continue Pass Expr Try ExceptHandler BoolOp BinOp "
    "UnaryOp IfExp Compare Call Attribute Subscript Slice Starred Name Constant Tuple List Dict "
    "JoinedStr FormattedValue ListComp GeneratorExp comprehension keyword Load Store And Or Add "
    "Sub Mult Div FloorDiv Mod Pow LShift RShift BitAnd BitOr Not UAdd USub Eq NotEq Lt LtE Gt "
    "GtE Is IsNot In NotIn NamedExpr"
)
"""The syntax that MicroPython has and that makes sense in a control loop."""

CLOCKS = {"monotonic", "monotonic_ns", "perf_counter", "perf_counter_ns", "process_time", "sleep"}


class Unannotated(ast.NodeTransformer):
    """Takes annotations away, which MicroPython reads and ignores, and doc strings."""

    def visit_arg(self, node):
        node.annotation = None
        return node

    def visit_FunctionDef(self, node):
        node.returns = None
        return self.generic_visit(node)

    def visit_AnnAssign(self, node):
        assert node.value is not None, "a bare annotation"
        return self.generic_visit(
            ast.copy_location(ast.Assign(targets=[node.target], value=node.value), node)
        )


def bare(name: str) -> ast.Module:
    """Return a module as MicroPython sees it."""
    return Unannotated().visit(ast.parse((ROOT / name).read_text()))


def defined_names() -> set[str]:
    """Return what firmware calls its own functions, methods, classes, attributes, constants."""
    names = set()
    for tree in TREES.values():
        for node in ast.walk(tree):
            if isinstance(node, ast.FunctionDef | ast.ClassDef):
                names.add(node.name)
            elif isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store):
                names.add(node.attr)
        for node in tree.body:
            if isinstance(node, ast.Assign):
                names |= {target.id for target in node.targets if isinstance(target, ast.Name)}
    return names


OWN = defined_names()


def faults_of(tree: ast.Module) -> list[str]:
    """Return what MicroPython would stumble over, with line numbers."""
    bound = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name) and _stores(node)}
    bound |= {node.arg for node in ast.walk(tree) if isinstance(node, ast.arg)}
    bound |= {
        (node.asname or node.name).split(".")[0]
        for node in ast.walk(tree)
        if isinstance(node, ast.alias)
    }
    bound |= {n.name for n in ast.walk(tree) if isinstance(n, ast.FunctionDef | ast.ClassDef)}
    bound |= {n.name for n in ast.walk(tree) if isinstance(n, ast.ExceptHandler) and n.name}
    return [
        f"line {getattr(node, 'lineno', 0)}: {fault}"
        for node in ast.walk(tree)
        for fault in (*_syntax(node), *_strings(node), *_words(node, bound))
    ]


def _stores(node: ast.Name) -> bool:
    return isinstance(node.ctx, ast.Store)


def _syntax(node: ast.AST):
    if type(node).__name__ not in SYNTAX:
        yield f"{type(node).__name__} is no syntax for firmware"
    if isinstance(node, ast.FunctionDef | ast.ClassDef) and node.decorator_list:
        yield f"{node.name} is decorated"
    if isinstance(node, ast.ClassDef) and (node.bases or node.keywords):
        yield f"class {node.name} is derived"
    if isinstance(node, ast.arguments) and (node.posonlyargs or node.kwonlyargs):
        yield "an argument that goes only by position, or only by name"
    if isinstance(node, ast.Try) and not node.handlers:
        yield "a try that catches nothing"


def _strings(node: ast.AST):
    """Nested quotes, conversions and braces are what f-strings cannot do there."""
    if isinstance(node, ast.FormattedValue) and node.conversion != -1:
        yield "a conversion in an f-string"
    if isinstance(node, ast.FormattedValue) and any(
        isinstance(inner, ast.Constant) and isinstance(inner.value, str)
        for inner in ast.walk(node.value)
    ):
        yield "a string inside of an f-string"
    if isinstance(node, ast.JoinedStr) and any(
        isinstance(part, ast.Constant) and ("{" in part.value or "}" in part.value)
        for part in node.values
    ):
        yield "a brace in an f-string"


def _words(node: ast.AST, bound: set[str]):
    if isinstance(node, ast.Name) and node.id not in BUILTINS | bound:
        yield f"{node.id} is no builtin for firmware"
    if isinstance(node, ast.Attribute) and node.attr not in METHODS | OWN:
        yield f".{node.attr} is not known"
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in BUILTINS:
        known = KEYWORDS.get(node.func.id, set())
        for keyword in node.keywords:
            if keyword.arg not in known:
                yield f"{node.func.id} takes no {keyword.arg}"


@pytest.mark.parametrize("name", FIRMWARE)
def test_a_firmware_module_imports_only_what_micropython_and_the_firmware_have(name):
    own = {other.removesuffix(".py").replace("/", ".") for other in FIRMWARE}
    for node in ast.walk(TREES[name]):
        if isinstance(node, ast.Import):
            assert {alias.name for alias in node.names} <= set(LIBRARIES)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0
            wanted = {alias.name for alias in node.names}
            modules = {f"{node.module}.{name}" for name in wanted}
            assert node.module in own | set(LIBRARIES) or modules <= own
            assert wanted <= LIBRARIES.get(node.module, wanted)


@pytest.mark.parametrize("name", FIRMWARE)
def test_a_firmware_module_keeps_to_what_micropython_has(name):
    assert faults_of(bare(name)) == []


@pytest.mark.parametrize(
    "source",
    [
        "match 1:\n  case 1: pass",
        "x = f'{1!r}'",
        "x = f'{{'",
        "x = f\"{d['a']}\"; d = {}",
        "x = 'ab'.removeprefix('a')",
        "x = (5).bit_count()",
        "def f(a, /): return a",
        "def f(*, a): return a",
        "@f\ndef f(): pass",
        "class A(list): pass",
        "x = list(zip([1], [2], strict=True))",
        "with x: x = 1",
        "async def f(): pass",
        "x = breakpoint()",
        "x = lambda: 1",
        "try:\n  pass\nexcept* ValueError:\n  pass",
    ],
)
def test_what_firmware_must_not_use_is_found(source):
    assert faults_of(ast.parse(source))


def short_ride(agent, path, motion, rules):
    """Drive an agent along a plan for 3 s, on ideal wheels; returns where it was and its phases."""
    from math import cos, sin

    start = 5_000_000_000
    agent.hear_command(7, 1, 1, 1, 0, 0, 0, 0, False, 0)
    agent.hear_plan(7, 1, 0, 0, rules, path, motion)
    agent.clock_due(0)
    agent.hear_clock(7, 0, 1_000_000, 1_000_000, 2_000_000)
    x, y, heading = agent.ride.follower.start_pose()
    agent.tick(1_000, x, y, heading)
    seen = [agent.phase]
    agent.hear_command(7, 1, 2, 1, 1, start, start, 1000, False, start)
    for tick in range(300):
        now = start + tick * 10_000_000
        if tick % 10 == 0:
            phase, granted = 1 if tick < 200 else 2, 10 * tick + 1000
            agent.hear_command(7, 1, 3 + tick, 1, phase, start, now, granted, False, now)
        agent.tick(now, x, y, heading)
        way = agent.drive_speed * 0.01
        turn = way * agent.drive_curvature
        x += way * cos(heading + 0.5 * turn)
        y += way * sin(heading + 0.5 * turn)
        heading += turn
        if tick % 20 == 0:
            seen += [x, y, heading, agent.phase]
    return seen


@pytest.mark.skipif(shutil.which("micropython") is None, reason="no micropython on this machine")
def test_micropython_drives_as_this_python_does(tmp_path):
    for name in FIRMWARE:
        (tmp_path / name).parent.mkdir(exist_ok=True)
        shutil.copy(ROOT / name, tmp_path / name)
    script = tmp_path / "ride.py"
    script.write_text(
        "import json\nfrom robot_agent.core.agent import Agent\n\n\n"
        f"{inspect.getsource(short_ride)}\n\n"
        f"print(json.dumps(short_ride(Agent(0.5), {PATH!r}, {MOTION!r}, {RULES!r})))\n"
    )
    done = subprocess.run(
        ["micropython", str(script)],
        env={**os.environ, "MICROPYPATH": str(tmp_path)},
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    from robot_agent.core.agent import Agent

    assert json.loads(done.stdout) == pytest.approx(
        short_ride(Agent(0.5), PATH, MOTION, RULES), abs=1e-3
    )


def test_robots_read_no_clock_that_can_be_set():
    for path in sorted((ROOT / "robot_agent").glob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Import):
                assert "datetime" not in {alias.name for alias in node.names}, path
            elif isinstance(node, ast.ImportFrom):
                assert node.module not in ("time", "datetime"), path
            elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
                assert node.value.id != "time" or node.attr in CLOCKS, path


def test_only_the_loop_and_the_import_of_a_driver_catch_every_exception():
    for path in sorted((ROOT / "robot_agent").glob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ExceptHandler):
                caught = ast.unparse(node.type) if node.type else ""
                broad = caught in ("", "Exception", "BaseException")
                assert not broad or path.name in ("loop.py", "driver_file.py"), path
