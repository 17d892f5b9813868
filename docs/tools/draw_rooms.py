"""The picture of docs/architecture.md: the rooms, their sizes and their imports, from the code.

Run `python docs/tools/draw_rooms.py` from the root of the repository after a room was added or
renamed.  The order of the rooms is that of the import contracts in pyproject.toml.

Decides: the picture.  Must not know: what the rooms are for.
"""

from __future__ import annotations

import ast
import sys
import tomllib
from collections import Counter
from collections.abc import Collection
from pathlib import Path
from typing import Any, Final

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch, Rectangle

ROOT: Final = Path(__file__).resolve().parents[2]
PICTURE: Final = ROOT / "docs" / "img" / "rooms.svg"
_PACKAGES: Final = {
    "sim": "#f3dcc8",
    "coordinator": "#cfe0f2",
    "robot_agent": "#d6ead0",
    "protocol": "#e6daf0",
}
_BOX: Final = 7.2
"""Width of a room's box, in cells."""


def rooms() -> list[str]:
    """Return all rooms, as `package.room`, from the top layer down; a package may be one room."""
    layers = {
        contract["containers"][0]: [
            room.strip() for layer in contract["layers"] for room in layer.split("|")
        ]
        for contract in _contracts()
        if contract["type"] == "layers" and "containers" in contract
    }
    found = [f"{package}.{room}" for package in ("sim", "coordinator") for room in layers[package]]
    return [*found, "robot_agent", "robot_agent.core", "protocol"]


def pure() -> set[str]:
    """Return the rooms that the import contracts keep free of links, clocks, threads and files."""
    for contract in _contracts():
        if contract["name"].startswith("Pure rooms"):
            return set(contract["source_modules"])
    raise LookupError("pyproject.toml has no contract for the pure rooms")


def _contracts() -> list[dict[str, Any]]:
    """Return the import contracts of pyproject.toml."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text())
    return list(settings["tool"]["importlinter"]["contracts"])


def room_of(module: str, known: Collection[str]) -> str | None:
    """Return which of the rooms a module is in, by its dotted name; None when it is in none."""
    parts = module.split(".")
    pair = ".".join(parts[:2])
    return pair if pair in known else parts[0] if parts[0] in known else None


def count() -> tuple[Counter[str], Counter[tuple[str, str]]]:
    """Return the modules of each room, and how many of them import each other room's modules."""
    known = set(rooms())
    sizes: Counter[str] = Counter()
    imports: Counter[tuple[str, str]] = Counter()
    for package in _PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            name = ".".join(path.relative_to(ROOT).with_suffix("").parts)
            room = room_of(name, known)
            if room is None:
                continue
            sizes[room] += path.name != "__init__.py"
            for module in sorted(_imported(ast.parse(path.read_text()))):
                other = room_of(module, known)
                if other is not None and other != room:
                    imports[room, other] += 1
    return sizes, imports


def _imported(tree: ast.AST) -> set[str]:
    """Return the modules that a file imports, those inside functions too."""
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            deep = len(node.module.split(".")) > 1 or node.module not in _PACKAGES
            found |= {node.module if deep else f"{node.module}.{a.name}" for a in node.names}
    return found


def draw(path: Path) -> None:
    """Write the picture: a box per room, top layer first, and a shaded table of imports."""
    names = rooms()
    sizes, imports = count()
    most = max(imports.values())
    figure = Figure(figsize=(12.6, 10.4))
    axes = figure.add_axes((0.01, 0.01, 0.98, 0.98))
    axes.set_axis_off()
    size = len(names)
    axes.set_xlim(-_BOX - 1.4, size + 1.6)
    axes.set_ylim(size + 0.7, -4.9)
    rows = {name: index for index, name in enumerate(names)}
    is_pure = pure()
    for name, row in rows.items():
        _draw_room(axes, name, row, sizes[name], name in is_pure)
        _draw_lines(axes, row, size)
    for (room, other), number in imports.items():
        x, y = rows[other], rows[room]
        shade = 0.12 + 0.88 * (number / most) ** 0.5
        axes.add_patch(Rectangle((x, y), 1, 1, color=mpl.colormaps["Blues"](0.85 * shade)))
        colour = "white" if shade > 0.66 else "#1a2a3a"
        axes.text(x + 0.5, y + 0.52, str(number), ha="center", va="center", size=8, color=colour)
    _draw_packages(axes, names)
    note = "how many imports lead from the room of the row to the room of the column"
    axes.text(size, -4.2, note, size=10, ha="right", color="#445")
    told = {"Date": None, "Creator": "splinefleet"} if path.suffix == ".svg" else None
    with mpl.rc_context({"svg.fonttype": "none", "svg.hashsalt": "splinefleet"}):
        figure.savefig(path, dpi=110, facecolor="white", metadata=told)


def _draw_room(axes: Axes, name: str, row: int, modules: int, is_pure: bool) -> None:
    """Draw a room's box in its row, and its name above its column."""
    package, _, room = name.partition(".")
    colour = _PACKAGES[package]
    box = FancyBboxPatch(
        (-_BOX, row + 0.1), _BOX - 0.25, 0.8, boxstyle="round,pad=0,rounding_size=0.2",
        facecolor=colour, edgecolor="#556", linewidth=0.8,
    )  # fmt: skip
    axes.add_patch(box)
    word = "module" if modules == 1 else "modules"
    axes.text(-_BOX + 0.25, row + 0.53, room or package, va="center", size=10.5, weight="bold")
    axes.text(-0.5, row + 0.53, f"{modules} {word}", va="center", ha="right", size=8.5)
    axes.add_patch(Rectangle((row, row), 1, 1, facecolor=colour, edgecolor="none"))
    axes.text(row + 0.42, -0.2, room or package, rotation=60, size=9, ha="left", va="bottom")
    if is_pure:
        axes.text(-3.0, row + 0.53, "pure", va="center", ha="right", size=8.5, color="#345")


def _draw_lines(axes: Axes, row: int, size: int) -> None:
    """Draw the thin lines of a row and of its column."""
    for line in ([(0, size), (row, row)], [(row, row), (0, size)]):
        axes.plot(*line, color="#e4e7ec", linewidth=0.6, zorder=0)


def _draw_packages(axes: Axes, names: list[str]) -> None:
    """Frame each package's rows, its name at the left."""
    size = len(names)
    for package in _PACKAGES:
        rows = [row for row, name in enumerate(names) if name.split(".")[0] == package]
        top, bottom = rows[0], rows[-1] + 1
        for edge in (top, bottom):
            axes.plot((-_BOX - 1.2, size), (edge, edge), color="#889", linewidth=1.0)
        if len(rows) > 2:
            middle = (top + bottom) / 2
            axes.text(-_BOX - 0.65, middle, package, rotation=90, va="center", ha="center", size=12)


if __name__ == "__main__":
    draw(Path(sys.argv[1]) if len(sys.argv) > 1 else PICTURE)
