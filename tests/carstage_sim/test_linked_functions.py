"""Functions that only kernels call are compiled as parts of kernels."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from carstage_sim.cache import CACHE_VARIABLE
from carstage_sim.kernels import device, inlined, kernel


def test_functions_are_compiled_into_a_kernel_once_for_all_constants(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path))

    @device
    def scaled(value, factor, doubled):  # type: ignore[no-untyped-def]
        return value * factor * (2 if doubled else 1)

    @inlined
    def shifted(value, by):  # type: ignore[no-untyped-def]
        return scaled(value, 3, False) + by

    @kernel
    def both(values):  # type: ignore[no-untyped-def]
        for i in range(len(values)):
            values[i] = shifted(values[i], 5.0) + scaled(values[i], 7, True)

    values = np.array([1.0, -2.5])
    both(values)
    assert values.tolist() == [1 * 3 + 5 + 1 * 7 * 2, -2.5 * 3 + 5 - 2.5 * 7 * 2]
    functions: list[object] = [scaled, shifted]
    assert [len(one.overloads) for one in functions] == [1, 1]  # type: ignore[attr-defined]
    with pytest.raises(TypeError, match="at most 1 argument"):
        scaled(1.0, 2, False)
