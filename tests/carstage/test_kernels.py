"""Kernels are compiled wherever the package lies."""

from __future__ import annotations

import numba
import pytest

from carstage.kernels import compiled


def test_kernels_work_where_no_machine_code_can_be_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    compile_for_now = numba.njit

    def without_cache(*arguments: object, **options: object) -> object:
        if "cache" in options:
            raise RuntimeError("cannot cache function: no locator available")
        return compile_for_now(*arguments, **options)

    monkeypatch.setattr(numba, "njit", without_cache)
    assert compiled(lambda number: number + 1)(2) == 3
