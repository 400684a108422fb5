"""NPZ files whose bytes follow from their arrays: deflated by libdeflate, without times.

``numpy.load`` reads them. ``numpy.savez_compressed`` would take several times as long.
"""

from __future__ import annotations

import io
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Mapping
from typing import Any

import deflate
import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

_LEVEL = 1
_LOCAL = struct.Struct("<4sHHHHHIIIHH")
_CENTRAL = struct.Struct("<4sHHHHHHIIIHHHHHII")
_END = struct.Struct("<4sHHHHIIH")
_DAMAGED = (
    OSError, EOFError, KeyError, ValueError, RuntimeError, struct.error, tokenize.TokenError,
    zipfile.BadZipFile, zlib.error,
)  # fmt: skip
"""What numpy and zipfile raise, by where the damage is: an array's header is Python, say."""
_VERSION, _DEFLATED = 20, 8
_MIDNIGHT, _FIRST_OF_1980 = 0, 0x21


def pack_npz(arrays: Mapping[str, NDArray[Any]]) -> bytes:
    """A compressed NPZ file; each array below 4 GiB."""
    parts: list[bytes | bytearray] = []
    entries: list[bytes] = []
    offset = 0
    for name, array in arrays.items():
        file_name = f"{name}.npy".encode("ascii")
        content = _npy(np.ascontiguousarray(array))
        data = deflate.deflate_compress(content, _LEVEL)
        common = (
            *(_VERSION, 0, _DEFLATED, _MIDNIGHT, _FIRST_OF_1980),
            *(deflate.crc32(content), len(data), len(content), len(file_name), 0),
        )
        entries.append(_CENTRAL.pack(b"PK\1\2", _VERSION, *common, 0, 0, 0, 0, offset) + file_name)
        parts += [_LOCAL.pack(b"PK\3\4", *common), file_name, data]
        offset += _LOCAL.size + len(file_name) + len(data)
    directory = b"".join(entries)
    count = len(entries)
    end = _END.pack(b"PK\5\6", 0, 0, count, count, len(directory), offset, 0)
    return b"".join((*parts, directory, end))


def _npy(array: NDArray[Any]) -> bytes:
    """What ``numpy.save`` writes, without its copies of copies."""
    header = io.BytesIO()
    npy.write_array_header_1_0(header, npy.header_data_from_array_1_0(array))
    return b"".join((header.getvalue(), array.data))


def unpack_npz(content: bytes, name: str) -> NDArray[Any]:
    """One array of an NPZ file.

    Raises:
        ValueError: damaged, or without that array.
    """
    try:
        with np.load(io.BytesIO(content), allow_pickle=False) as arrays:
            array: NDArray[Any] = arrays[name]
    except _DAMAGED as error:
        raise ValueError(f"damaged NPZ: {error}") from error
    return array
