"""Arrays of a frame in a card's memory, as words, and how WGSL reads them by name.

An arena is a buffer of arrays that change together, so that what seldom changes stays on the card.
Where each array begins, its shape, and all single numbers stand in one directory.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carstage_sim.render.gpu.device import Gpu
from carstage_sim.render.gpu.values import Array, Record, Scalar, Value

ARENAS = ("town", "models", "sky", "moment")
"""Buffers: the town's surfaces, those of the models, the sky, and what changes in each tick."""

_PLACE: dict[tuple[str, str], str] = {
    ("light", "sky"): "sky",
    ("lamps", "thrown"): "sky",
    ("lamps", "near"): "sky",
}
_PLACE_OF_RECORD = {
    "static": "town",
    "actors": "models",
    "appearance": "models",
    "materials": "models",
}
_ENTRIES = 128
"""Arrays and numbers that a directory has room for."""

Source = Mapping[str, Any]
"""Records (named tuples) and arrays, by name."""


def _scalar(kind: np.dtype[Any]) -> Scalar:
    if kind.kind == "f":
        return "f32"
    return "bool" if kind.kind == "b" else "i32"


class Arenas:
    """The arrays that a program reads.

    Args:
        gpu: the card.
        example: a frame's records and arrays, for the types.

    Attributes:
        directory: the uniform buffer that tells where everything is.
    """

    def __init__(self, gpu: Gpu, example: Source) -> None:
        self._gpu = gpu
        self._example = example
        self._entries: dict[tuple[str, str], int] = {}
        self._texts: list[str] = []
        self._buffers = {name: gpu.storage(256) for name in ARENAS}
        self._members: dict[str, list[tuple[str, int]]] = {}
        self._seen: dict[str, Any] = {}
        self._arrays: dict[int, NDArray[Any]] = {}
        self._table = np.zeros((_ENTRIES, 4), np.int32)
        self._written = b""
        self.directory = gpu.uniform(self._table.nbytes)

    @property
    def buffers(self) -> list[Any]:
        """Buffers of the bind group, in the order of their bindings."""
        return [*self._buffers.values(), self.directory]

    def record(self, name: str) -> Record:
        """A record of the frame, for the translator."""
        return Record(name, lambda member: self.member(name, member))

    def member(self, record: str, name: str = "") -> Array | Value:
        """A record's array or number, or with an empty name an array that stands for itself."""
        key = (record, name)
        array = np.asarray(self._find(self._example, key))
        if key not in self._entries:
            self._entries[key] = len(self._entries)
            self._members.setdefault(record, []).append((name, self._entries[key]))
            self._seen.pop(record, None)
            if len(self._entries) > _ENTRIES:
                raise ValueError(f"more than {_ENTRIES} arrays in a program")
            if array.ndim:
                self._texts.append(self._reader(key, array))
        entry = f"directory[{self._entries[key]}]"
        if not array.ndim:
            return Value(f"bitcast<f32>({entry}.x)", "f32")
        sizes = tuple(f"{entry}.{axis}" for axis in "yzw"[: array.ndim])
        return Array(f"{record}_{name}", _scalar(array.dtype), array.ndim, sizes)

    def source(self, group: int) -> str:
        """Declarations and the functions that read the arrays."""
        declared = [
            f"@group({group}) @binding({k}) var<storage, read> {name}_words: array<u32>;"
            for k, name in enumerate(ARENAS)
        ]
        declared.append(
            f"@group({group}) @binding({len(ARENAS)}) "
            f"var<uniform> directory: array<vec4i, {_ENTRIES}>;"
        )
        return "\n".join([*declared, *self._texts])

    def _reader(self, key: tuple[str, str], array: NDArray[Any]) -> str:
        entry = f"directory[{self._entries[key]}]"
        place = "i"
        for index, size in zip("jk", "zw", strict=False):
            if array.ndim > "ijk".index(index):
                place = f"({place}) * {entry}.{size} + {index}"
        parameters = ", ".join(f"{index}: i32" for index in "ijk"[: array.ndim])
        word = f"{self._arena_of(key)}_words[u32({entry}.x + {place})]"
        scalar = _scalar(array.dtype)
        value = f"({word} != 0u)" if scalar == "bool" else f"bitcast<{scalar}>({word})"
        return f"fn {key[0]}_{key[1]}({parameters}) -> {scalar} {{ return {value}; }}"

    @staticmethod
    def _find(source: Source, key: tuple[str, str]) -> Any:
        record, name = key
        return getattr(source[record], name) if name else source[record]

    @staticmethod
    def _arena_of(key: tuple[str, str]) -> str:
        return _PLACE.get(key, _PLACE_OF_RECORD.get(key[0], "moment"))

    def update(self, source: Source) -> None:
        """Bring a frame's arrays to the card; arenas whose arrays are the same stay as they are."""
        stale = set()
        for record, members in self._members.items():
            values = source[record]
            if self._seen.get(record) is values:
                continue
            numbers, places = [], []
            for name, entry in members:
                value = getattr(values, name) if name else values
                if not np.ndim(value):
                    numbers.append(value)
                    places.append(entry)
                elif self._arrays.get(entry) is not value:
                    self._arrays[entry] = value
                    stale.add(self._arena_of((record, name)))
            self._table[places, 0] = np.array(numbers, np.float32).view(np.int32)
            self._seen[record] = values
        for arena in stale:
            self._fill(arena)
        if self._written != self._table.tobytes():
            self._written = self._table.tobytes()
            self._gpu.write(self.directory, self._table)

    def _fill(self, name: str) -> None:
        parts = []
        start = 0
        for key, entry in self._entries.items():
            array = self._arrays.get(entry)
            if array is None or self._arena_of(key) != name:
                continue
            self._table[entry, 0] = start
            self._table[entry, 1 : 1 + array.ndim] = array.shape
            parts.append(_words(array))
            start += array.size
        words = np.concatenate(parts)
        if self._buffers[name].size < words.nbytes:
            self._buffers[name] = self._gpu.storage(words.nbytes + words.nbytes // 4)
        self._gpu.write(self._buffers[name], words)


def _words(array: NDArray[Any]) -> NDArray[np.uint32]:
    """An array's elements as words, in their order."""
    flat = np.ascontiguousarray(array).reshape(-1)
    if flat.dtype.kind == "f":
        return flat.astype(np.float32, copy=False).view(np.uint32)
    if flat.dtype == np.uint32:
        return flat
    return flat.astype(np.int32, copy=False).view(np.uint32)
