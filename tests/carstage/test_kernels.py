"""Kernels are compiled wherever the package lies, and kept by their package's sources."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

import carstage
from carstage.cache import CACHE_VARIABLE
from carstage.kernels import compiled, kernel_cache

CODECS = Path(str(carstage.__file__)).parent / "codecs"


def among_the_codecs() -> Callable[..., Any]:
    """A function whose source seems to be a codec's."""
    names: dict[str, Any] = {}
    exec(compile("def more(n): return n + 1", str(CODECS / "png.py"), "exec"), names)
    function: Callable[..., Any] = names["more"]
    return function


@pytest.fixture(autouse=True)
def forgotten_keys() -> Iterator[None]:
    kernel_cache.cache_clear()
    yield
    kernel_cache.cache_clear()


def test_kernels_are_kept_under_the_hash_of_their_package(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path))
    assert compiled(among_the_codecs())(2) == 3
    (folder,) = (tmp_path / "kernels").iterdir()
    assert folder == kernel_cache(CODECS)
    assert list(folder.rglob("*.nbi"))


def test_kernels_work_where_no_machine_code_can_be_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path / "file"))
    assert compiled(among_the_codecs())(2) == 3
