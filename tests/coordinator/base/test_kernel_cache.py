"""Machine code is kept for those who may read it, and never outlives what it was made from."""

from __future__ import annotations

import ctypes
import importlib
import os
import pkgutil
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import coordinator
from coordinator.base import kernel_cache

pytestmark = pytest.mark.processes

_ROOT = Path(__file__).resolve().parents[3]

_KERNELS = {
    "__init__.py": "",
    "factors.py": "FACTOR = 2.0\n",
    "deep/__init__.py": "",
    "deep/inner.py": """
from coordinator.base.compiled import compiled
from ..factors import FACTOR

@compiled
def scaled(x: float) -> float:
    return FACTOR * x
""",
    "outer.py": """
from coordinator.base.compiled import compiled
from coordinator.trial.deep import inner as kernels

@compiled
def shifted(x: float) -> float:
    return kernels.scaled(x) + 1.0
""",
}

_PROGRAM = """
from coordinator.trial.outer import shifted

hits = lambda: sum(shifted.stats.cache_hits.values())
print(shifted(3.0), "loaded" if hits() else "compiled")
"""

_WITHOUT_NUMBAS_OWN = """
import numba
del numba.core.caching.CompileResultCacheImpl
"""

_DROP_FROM_BOUNDING_SET, _OVERRIDE_PERMISSIONS = 24, 1  # PR_CAPBSET_DROP, CAP_DAC_OVERRIDE


def _obey_permissions() -> None:
    """Have the program that is started next obey permission bits even where root starts it."""
    ctypes.CDLL(None).prctl(_DROP_FROM_BOUNDING_SET, _OVERRIDE_PERMISSIONS, 0, 0, 0)


def _run(tree: Path, program: str = _PROGRAM, **settings: str) -> str:
    """Run a program on a tree's kernels, by somebody without a home, and return what it prints."""
    nobodys = {name: os.environ[name] for name in os.environ.keys() - {"HOME", "XDG_CACHE_HOME"}}
    done = subprocess.run(
        [sys.executable, "-c", program],
        cwd=tree,
        capture_output=True,
        text=True,
        timeout=120,
        env={**nobodys, "HOME": "/dev/null", "PYTHONPATH": str(tree), **settings},
        preexec_fn=_obey_permissions,
    )
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout.strip()


@pytest.fixture
def tree(tmp_path: Path) -> Iterator[Path]:
    """The packages, freshly copied, with a few small kernels in a package of their own."""
    made = tmp_path / "installed"
    for package in ("coordinator", "protocol"):
        ignored = shutil.ignore_patterns("__pycache__")
        shutil.copytree(_ROOT / package, made / package, ignore=ignored)
    for name, text in _KERNELS.items():
        file = made / "coordinator" / "trial" / name
        file.parent.mkdir(exist_ok=True)
        file.write_text(text, encoding="utf-8")
    yield made
    for folder in [made, *made.rglob("*/")]:
        folder.chmod(0o755)


def _lock(tree: Path) -> None:
    """Take the right to write away from everything in a tree."""
    for path in [*tree.rglob("*"), tree]:
        path.chmod(path.stat().st_mode & ~0o222)
    probe = "import sys\ntry:\n    open('probe', 'w')\nexcept OSError:\n    print('locked')"
    if _run(tree, probe) != "locked":
        pytest.skip("root cannot lose its rights here")


def _kept(folder: Path) -> list[str]:
    return sorted(file.name for file in folder.rglob("*.nbc"))


def test_kernels_compiled_at_set_up_serve_users_who_cannot_write(
    tree: Path, tmp_path: Path
) -> None:
    assert _run(tree) == "7.0 compiled"
    _lock(tree)
    mine = tmp_path / "mine"
    assert _run(tree, XDG_CACHE_HOME=str(mine)) == "7.0 loaded"
    assert _run(tree) == "7.0 loaded"
    assert not mine.exists()


def test_what_was_not_compiled_at_set_up_is_kept_with_the_user(tree: Path, tmp_path: Path) -> None:
    _lock(tree)
    mine = tmp_path / "mine"
    assert _run(tree, XDG_CACHE_HOME=str(mine)) == "7.0 compiled"
    assert len(_kept(mine / "splinefleet")) == 2
    assert _run(tree, XDG_CACHE_HOME=str(mine)) == "7.0 loaded"
    home = tmp_path / "home"
    assert _run(tree, HOME=str(home)) == "7.0 compiled"
    assert len(_kept(home / ".cache" / "splinefleet")) == 2


def test_without_any_folder_kernels_are_compiled_for_the_process(tree: Path) -> None:
    _lock(tree)
    assert _run(tree) == _run(tree, XDG_CACHE_HOME="not/absolute") == "7.0 compiled"


def test_a_folder_that_others_may_write_is_not_believed(tree: Path, tmp_path: Path) -> None:
    _lock(tree)
    mine = tmp_path / "splinefleet"
    mine.mkdir()
    mine.chmod(0o777)
    assert _run(tree, XDG_CACHE_HOME=str(tmp_path)) == "7.0 compiled"
    assert _kept(mine) == []


@pytest.mark.parametrize("kind", ["nbi", "nbc"])
def test_files_that_a_crash_cut_short_are_as_good_as_none(
    tree: Path, tmp_path: Path, kind: str
) -> None:
    assert _run(tree) == "7.0 compiled"
    for file in tree.rglob(f"*.{kind}"):
        file.write_bytes(b"")
    _lock(tree)
    assert _run(tree, XDG_CACHE_HOME=str(tmp_path)) == "7.0 compiled"
    assert _run(tree, XDG_CACHE_HOME=str(tmp_path)) == "7.0 loaded"


def test_files_of_another_time_or_place_are_the_same_sources(tree: Path, tmp_path: Path) -> None:
    assert _run(tree) == "7.0 compiled"
    for file in (tree / "coordinator" / "trial").rglob("*.py"):
        os.utime(file, (1, 1))
    assert _run(tree) == "7.0 loaded"
    moved = tree.rename(tmp_path / "moved")
    assert _run(moved) == "7.0 loaded"
    moved.rename(tree)


@pytest.mark.parametrize(
    ("file", "old", "new", "answer"),
    [
        ("factors.py", "2.0", "20.0", "61.0"),
        ("deep/inner.py", "FACTOR * x", "FACTOR * x * x", "19.0"),
        ("outer.py", "+ 1.0", "+ 2.0", "8.0"),
    ],
)
def test_who_calls_a_kernel_that_was_edited_is_compiled_anew(
    tree: Path, file: str, old: str, new: str, answer: str
) -> None:
    assert _run(tree) == "7.0 compiled"
    source = tree / "coordinator" / "trial" / file
    source.write_text(source.read_text(encoding="utf-8").replace(old, new), encoding="utf-8")
    assert _run(tree) == f"{answer} compiled"
    assert _run(tree) == f"{answer} loaded"


def test_with_a_numba_that_takes_no_cache_of_ours_its_own_is_told_where(
    tree: Path, tmp_path: Path
) -> None:
    program = _WITHOUT_NUMBAS_OWN + _PROGRAM
    assert _run(tree, program) == "7.0 compiled"
    assert _run(tree, program) == "7.0 loaded"
    source = tree / "coordinator" / "trial" / "factors.py"
    source.write_text("FACTOR = 20.0\n", encoding="utf-8")
    assert _run(tree, program) == "61.0 compiled"
    shutil.rmtree(tree / "coordinator" / "__pycache__")
    _lock(tree)
    assert _run(tree, program) == "61.0 compiled"
    assert _run(tree, program, XDG_CACHE_HOME=str(tmp_path / "mine")) == "61.0 compiled"
    assert _run(tree, program, XDG_CACHE_HOME=str(tmp_path / "mine")) == "61.0 loaded"


def test_each_kernel_that_a_kernel_calls_is_among_the_sources_of_its_file() -> None:
    called = 0
    for module in pkgutil.walk_packages(coordinator.__path__, "coordinator."):
        source = Path(module.module_finder.path) / f"{module.name.rpartition('.')[2]}.py"  # type: ignore[union-attr]
        if module.ispkg:
            continue
        if "import compiled" not in source.read_text(encoding="utf-8"):
            continue
        for one in vars(importlib.import_module(module.name)).values():
            if hasattr(one, "py_func"):
                called += 1
                file = Path(one.py_func.__code__.co_filename)
                assert file in kernel_cache.sources_of(source), (source, file)
    assert called > 100
