"""A damaged NPZ file is a ``ValueError``, wherever the damage is."""

from __future__ import annotations

import numpy as np
import pytest

from carstage.codecs.npz import pack_npz, unpack_npz

ARRAY = np.random.default_rng(0).integers(0, 40, (40, 50)).astype(np.float32)
CONTENT = pack_npz({"flow": ARRAY})


def test_what_is_packed_is_unpacked() -> None:
    np.testing.assert_array_equal(unpack_npz(CONTENT, "flow"), ARRAY)


def test_a_damaged_byte_is_damage_or_changes_nothing() -> None:
    for at in range(0, len(CONTENT), 3):
        content = bytearray(CONTENT)
        content[at] ^= 0xFF
        try:
            array = unpack_npz(bytes(content), "flow")
        except ValueError:
            continue
        np.testing.assert_array_equal(array, ARRAY)


def test_a_locked_archive_is_damage() -> None:
    content = bytearray(CONTENT)
    content[CONTENT.index(b"PK\1\2") + 8] |= 1
    with pytest.raises(ValueError, match="encrypted"):
        unpack_npz(bytes(content), "flow")
