"""One fuzz target in this process: `python -m benchmarks.fuzz.worker TARGET CORPUS [OPTION ...]`.

The options are libFuzzer's.  Compiled kernels are not instrumented: numba could not compile them.
"""

from __future__ import annotations

import importlib
import sys
import warnings
from pathlib import Path
from typing import Final

from benchmarks.fuzz.table import MODULES

_WATCHED: Final = ["coordinator", "protocol", "robot_agent", "tomllib", "yaml", "ezdxf", "mcap"]
_ROOT: Final = Path(__file__).parents[2]
_COMPILING: Final = ("compiled", "kernel_cache", "quick_loading")


def _compiled() -> list[str]:
    """Return the names of modules with compiled functions, and of those that compile them."""
    files = (_ROOT / "coordinator").rglob("*.py")
    found = [file for file in files if "import compiled" in file.read_text(encoding="utf-8")]
    kernels = [".".join(file.relative_to(_ROOT).with_suffix("").parts) for file in found]
    return [*(f"coordinator.{name}" for name in _COMPILING), *kernels]


def main() -> None:
    """Put the target's seeds into the corpus and fuzz until libFuzzer ends the process."""
    import atheris

    warnings.simplefilter("ignore")
    name, corpus, *options = sys.argv[1:]
    with atheris.instrument_imports(include=_WATCHED, exclude=_compiled()):
        target = importlib.import_module(f"benchmarks.fuzz.{MODULES[name]}").TARGETS[name]
        folder = Path(corpus)
        folder.mkdir(parents=True, exist_ok=True)
        for number, seed in enumerate(target.seeds()):
            (folder / f"seed-{number}").write_bytes(seed)
            target.attempt(seed)  # within the block, so that late imports are instrumented, too
    for crash in sorted(folder.parent.glob("crash-*")):
        target.attempt(crash.read_bytes())
    arguments = [sys.argv[0], str(folder), f"-max_len={target.longest}", *options]

    def mutate(data: bytes, most: int, seed: int) -> bytes:
        changed: bytes = target.mutate(data, seed) if seed % 2 else b""
        return changed if 0 < len(changed) <= most else bytes(atheris.Mutate(data, most))

    if target.mutate is None:
        atheris.Setup(arguments, target.attempt)
    else:
        atheris.Setup(arguments, target.attempt, custom_mutator=mutate)
    atheris.Fuzz()


if __name__ == "__main__":
    main()
