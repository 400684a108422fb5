"""Payloads of one segment in a file of their own, and the reservation of disk space.

Standard library only, Python 3.8.
"""

from __future__ import annotations

import ctypes
import mmap
import os
from typing import Any, Optional, Tuple

from carstage.rawlog.format import BLOCK_BYTES, FREE, UNSEALED

_ZEROS = bytes(1 << 20)


class MappedPayloads:
    """A file of equal slots, mapped into memory: the paper's raw store.

    It is as large as one segment's frames (for a camera: fps * width * height * channels) from the
    start; a record that names a slot is written only after the slot is filled.

    Args:
        path: the file; it must not exist.
        slots: how many payloads it holds.
        slot_bytes: size of each.

    Raises:
        OSError: whatever the file system says; a full disk says so here, not by a signal later.
    """

    def __init__(self, path: str, slots: int, slot_bytes: int) -> None:
        self.path = path
        self._slots = slots
        self._slot_bytes = slot_bytes
        self._used = 0
        self._map: Optional[mmap.mmap] = None
        self._fd = os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o644)
        try:
            size = slots * slot_bytes
            if not reserve(self._fd, size):
                _fill(self._fd, size)
            os.ftruncate(self._fd, size)
            self._map = mmap.mmap(self._fd, size)
        except BaseException:
            self.close()
            raise

    def put(self, payload: memoryview) -> Optional[int]:
        """Copy a payload into the next slot; its number, or ``None`` when it does not fit."""
        if self._map is None or self._used == self._slots or payload.nbytes != self._slot_bytes:
            return None
        slot = self._used
        self._map[slot * self._slot_bytes : (slot + 1) * self._slot_bytes] = payload
        self._used += 1
        return slot

    def finish(self, durable: bool = True) -> None:
        """Cut off the slots that were never used, bring all to the disk if asked to, and close."""
        if self._map is not None:
            self._map.close()
            self._map = None
        os.ftruncate(self._fd, self._used * self._slot_bytes)
        if durable:
            os.fsync(self._fd)
        self.close()

    def close(self) -> None:
        """Close the file as it is; closing twice is fine."""
        if self._map is not None:
            self._map.close()
            self._map = None
        if self._fd >= 0:
            os.close(self._fd)
            self._fd = -1


class BlockPayloads:
    """A file whose payloads begin at blocks; that of a removed segment is used again.

    What is written over pages that the system holds already costs a copy; new pages cost several,
    above all where the host of a virtual machine has to find them first. Beyond this segment's
    payloads stand those of earlier ones, which no record names.

    Args:
        path: the file; it must not exist.
        expected_bytes: reserve that much on disk, when the file system can; 0 reserves nothing.

    Raises:
        OSError: whatever the file system says.
    """

    def __init__(self, path: str, expected_bytes: int = 0) -> None:
        self.path = path
        self._end = 0
        self._fd, used = open_free(path)
        if expected_bytes > 0 and not used:
            reserve(self._fd, expected_bytes)

    def put(self, payload: memoryview) -> Optional[int]:
        """Copy a payload to the next free block; its number."""
        block = self._end // BLOCK_BYTES
        place = self._end
        self._end += -(-payload.nbytes // BLOCK_BYTES) * BLOCK_BYTES
        # A signal or a nearly full disk may cut a write short: go on where it stopped.
        while payload.nbytes:
            written = os.pwrite(self._fd, payload, place)
            place += written
            payload = payload[written:]
        return block

    def finish(self, durable: bool = True) -> None:
        """Bring all to the disk if asked to, and close."""
        if durable:
            os.fsync(self._fd)
        self.close()

    def close(self) -> None:
        """Close the file as it is; closing twice is fine."""
        if self._fd >= 0:
            os.close(self._fd)
            self._fd = -1


def open_free(path: str) -> Tuple[int, bool]:
    """Open a file that does not exist for writing: one that a removed segment left, or a new one.

    Args:
        path: ends with ``.open``; what is left in its folder ends with ``.free`` instead.

    Returns:
        The descriptor, and whether the file was used before and has its old content.
    """
    folder, name = os.path.split(path)
    ending = name[name.index(".") : -len(UNSEALED)] + FREE
    flags = os.O_WRONLY | os.O_CLOEXEC
    for other in os.listdir(folder or "."):
        if other.endswith(ending):
            os.rename(os.path.join(folder, other), path)
            return os.open(path, flags), True
    return os.open(path, flags | os.O_CREAT | os.O_EXCL, 0o644), False


def _fill(fd: int, size: int) -> None:
    """Allocate by writing zeros, where the file system cannot reserve: a hole could not be filled
    on a full disk, and writing to it through a map would end the process.
    """
    written = 0
    while written < size:
        written += os.pwrite(fd, _ZEROS[: size - written], written)


def reserve(fd: int, size: int) -> bool:
    """Reserve ``size`` bytes for an open file; return whether the file system really did.

    The file's length stays what was written: after a crash, reserved bytes must not look like the
    payload of a record that was cut short.

    The system call is made directly: where a file system does not have it, C libraries imitate
    ``posix_fallocate`` by writing to every block, which costs more than it saves. A file system
    that says yes and allocates nothing is left out too.
    """
    call = _FALLOCATE
    if call is None or call(fd, _FALLOC_FL_KEEP_SIZE, 0, size) != 0:
        return False
    if os.fstat(fd).st_blocks * 512 >= size:
        return True
    os.ftruncate(fd, 0)
    return False


def _find_fallocate() -> Any:
    try:
        call = ctypes.CDLL(None, use_errno=True).fallocate
    except (OSError, AttributeError):
        return None
    call.argtypes = [ctypes.c_int, ctypes.c_int, ctypes.c_int64, ctypes.c_int64]
    call.restype = ctypes.c_int
    return call


_FALLOCATE = _find_fallocate()
_FALLOC_FL_KEEP_SIZE = 1  # linux/falloc.h
