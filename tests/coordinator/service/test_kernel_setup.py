"""Kernels that have to be compiled first are compiled by several processes, and that is told."""

from __future__ import annotations

import sys

import pytest

from coordinator.service import kernel_setup


@pytest.fixture
def called(monkeypatch, tmp_path):
    """What is compiled, where nothing is kept yet: names of parts, and what the caller does."""
    written = tmp_path / "parts"
    program = f"import sys; open({str(written)!r}, 'a').write(' '.join(sys.argv[1:]) + '.\\n')"
    monkeypatch.setattr(kernel_setup, "_WARM", (sys.executable, "-c", program))
    monkeypatch.setattr(kernel_setup, "_LOOK_S", 0.01)
    monkeypatch.setattr(kernel_setup, "is_filled", lambda: False)
    monkeypatch.setattr(kernel_setup.os, "cpu_count", lambda: 2)
    done = []
    monkeypatch.setattr(kernel_setup, "compile_rest", lambda: done.append("rest"))
    monkeypatch.setattr(kernel_setup, "load_kernels", lambda: done.append("loaded"))

    def run():
        kernel_setup.get_kernels_ready.__wrapped__()
        return written.read_text().split() if written.exists() else [], done

    return run


def test_parts_are_compiled_by_processes_and_the_rest_after_them(called, capsys):
    parts, done = called()
    assert sorted(parts[:-1]) == [f"{part}." for part in sorted(kernel_setup.PARTS)]
    assert parts[-1] == "."
    assert done == ["rest", "loaded"]
    assert "compiling the planner's kernels, once" in capsys.readouterr().err


def test_where_nothing_can_be_kept_this_process_compiles_alone(called, capsys, monkeypatch):
    monkeypatch.setattr(kernel_setup, "writable_place", lambda: None)
    assert called() == ([], ["rest", "loaded"])
    assert "for this process alone, as " in capsys.readouterr().err
