"""Memory that a card fills and the program reads: whose it is, and when it is used again."""

from __future__ import annotations

import numpy as np
import pytest

from carstage_sim.render.gpu import device

pytestmark = pytest.mark.xdist_group("gpu")
_SIZE = 1 << 12


def _brought(gpu, value, size=_SIZE):
    """Bytes of one value that went to the card and came back."""
    upload = gpu.upload(size)
    readback = gpu.readback(size)
    commands = gpu.commands()
    upload.write(np.full(size, value, np.uint8), commands)
    commands.copy(upload.buffer, 0, readback.buffer, 0, size)
    submission = commands.submit()
    upload.read_by(submission)
    return readback.bytes(submission)


def test_what_somebody_holds_is_not_written_over(software_gpu):
    held = [_brought(software_gpu, value) for value in range(5)]
    assert [set(array.tolist()) for array in held] == [{0}, {1}, {2}, {3}, {4}]


def test_memory_that_nobody_holds_is_used_again(software_gpu):
    first = _brought(software_gpu, 1)
    address = first.ctypes.data
    part = first[100:200]
    del first
    second = _brought(software_gpu, 2)
    assert second.ctypes.data != address, "a part was still held"
    assert set(part.tolist()) == {1}
    del part
    assert address in {_brought(software_gpu, 3).ctypes.data for _ in range(2)}


def test_beyond_what_may_be_lent_pictures_are_copied(software_gpu, monkeypatch):
    monkeypatch.setattr(device, "_MOST_LENT", 0)
    kept = _brought(software_gpu, 7)
    assert kept.flags.owndata or kept.base is None
    _brought(software_gpu, 8)
    assert set(kept.tolist()) == {7}


def test_large_arrays_are_copied_whole(software_gpu):
    count = 3 * device._PIECE + 17
    source = np.random.default_rng(0).integers(0, 256, count).astype(np.uint8)
    target = np.zeros(count, np.uint8)
    software_gpu.copy(target, source)
    assert np.array_equal(target, source)
