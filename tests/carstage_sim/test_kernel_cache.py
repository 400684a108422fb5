"""Machine code of kernels is used again for exactly the sources that it was compiled from."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path
from types import ModuleType

import pytest

from carstage_sim import kernels
from carstage_sim.cache import CACHE_VARIABLE

KERNEL = """
from carstage_sim.kernels import kernel
from kernels_of_a_test.callee import FACTOR

@kernel
def scaled(value):
    return FACTOR * value
"""


def imported_again(name: str) -> ModuleType:
    for loaded in [known for known in sys.modules if known.startswith("kernels_of_a_test")]:
        del sys.modules[loaded]
    kernels.kernel_cache_key.cache_clear()
    importlib.invalidate_caches()
    return importlib.import_module(name)


def test_an_edit_beside_a_kernel_compiles_it_anew_and_one_elsewhere_does_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package, elsewhere = tmp_path / "kernels_of_a_test", tmp_path / "elsewhere"
    for folder in (package, elsewhere):
        folder.mkdir()
        (folder / "__init__.py").touch()
    (package / "outer.py").write_text(KERNEL)
    (package / "callee.py").write_text("FACTOR = 2\n")
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path / "cache"))
    monkeypatch.setenv("PYTHONDONTWRITEBYTECODE", "1")
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    monkeypatch.syspath_prepend(tmp_path)
    first = imported_again("kernels_of_a_test.outer").scaled
    assert (first(3), sum(first.stats.cache_misses.values())) == (6, 1)
    (elsewhere / "__init__.py").write_text("EDITED = True\n")
    same = imported_again("kernels_of_a_test.outer").scaled
    assert (same(3), sum(same.stats.cache_hits.values())) == (6, 1)
    (package / "callee.py").write_text("FACTOR = 5\n")
    edited = imported_again("kernels_of_a_test.outer").scaled
    assert edited(3) == 15


def test_where_nothing_can_be_written_each_process_compiles_for_itself(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package = tmp_path / "kernels_of_a_test"
    package.mkdir()
    (package / "__init__.py").touch()
    (package / "outer.py").write_text(KERNEL)
    (package / "callee.py").write_text("FACTOR = 2\n")
    (tmp_path / "file").touch()
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path / "file"))
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    monkeypatch.syspath_prepend(tmp_path)
    scaled = imported_again("kernels_of_a_test.outer").scaled
    assert scaled(3) == 6
    assert not list(tmp_path.rglob("*.nb?"))
