"""What is on a disk after each operation, and what a power cut may leave of it.

A file system promises little of what was not synced: data may be lost though the name is there,
names may be lost though the data is there, and a file's own sync does not make its name durable
(POSIX; what ext4 adds is not relied on). Each file and each folder keeps what it held since its
last sync, from which the states after a power cut are put together.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping
from pathlib import PurePosixPath
from typing import Generic, TypeVar

from benchmarks.framework.crash_states.calls import Operation
from carstage.errors import BadInputError

State = Mapping[str, bytes | None]
"""Contents of files by path; None: a folder."""

Content = TypeVar("Content")

VARIANTS = ("all written", "only what was synced", "data lost", "zeros", "torn", "by chance")
"""What may be left of the operations up to one.

All of them; only what was synced; every name, but no data that was not synced, or zeros for it;
all but the second half of the last write; of each file and of the names what stood there at some
moment since the last sync.
"""


class _Node(Generic[Content]):
    """A file or a folder, with what it held since its last sync, oldest first."""

    def __init__(self, first: Content) -> None:
        self.history: list[tuple[int, Content]] = [(-1, first)]

    @property
    def now(self) -> Content:
        return self.history[-1][1]

    @property
    def durable(self) -> Content:
        return self.history[0][1]

    def change(self, number: int, content: Content) -> None:
        self.history.append((number, content))

    def sync(self, begun: int) -> None:
        """Make durable what came before an operation."""
        earlier = [place for place, (number, _) in enumerate(self.history) if number < begun]
        del self.history[: earlier[-1] if earlier else 0]


class _File(_Node[bytes]):
    pass


class _Folder(_Node[Mapping[str, "_File | _Folder"]]):
    pass


class Disk:
    """A disk on which operations are done; empty and durable at first."""

    def __init__(self) -> None:
        self._root = _Folder({})
        self._count = 0
        self._last: tuple[_File, int, int] | None = None

    def apply(self, operation: Operation) -> None:
        """Do an operation.

        Raises:
            BadInputError: it is about a file that is not there.
        """
        number = self._count
        self._count += 1
        self._last = None
        kind, path = operation.kind, operation.path
        if kind == "create":
            self._name(path, _File(b""), number)
        elif kind == "mkdir":
            self._name(path, _Folder({}), number)
        elif kind in ("unlink", "rmdir"):
            self._name(path, None, number)
        elif kind == "link":
            self._name(operation.target, self._node(path), number)
        elif kind == "rename":
            self._rename(path, operation.target, number)
        elif kind == "sync":
            self._node(path).sync(operation.begun)
        else:
            self._write(operation, number)

    def state(self, variant: str, rng: random.Random) -> State:
        """What a power cut leaves now.

        Args:
            variant: one of ``VARIANTS``.
            rng: what ``by chance`` is drawn from.
        """
        of_file: Callable[[_File], bytes] = lambda file: file.now  # noqa: E731
        of_folder: Callable[[_Folder], Mapping[str, _File | _Folder]] = lambda one: one.now  # noqa: E731
        if variant == "only what was synced":
            of_file, of_folder = (lambda file: file.durable), (lambda folder: folder.durable)
        elif variant == "data lost":
            of_file = lambda file: file.durable  # noqa: E731
        elif variant == "zeros":
            of_file = lambda file: file.durable.ljust(len(file.now), b"\0")  # noqa: E731
        elif variant == "torn":
            of_file = self._torn
        elif variant == "by chance":
            moment = rng.randrange(self._count + 1)
            of_file = lambda file: rng.choice(file.history)[1]  # noqa: E731
            of_folder = lambda folder: _at(folder, moment)  # noqa: E731
        found: dict[str, bytes | None] = {}

        def walk(folder: _Folder, path: str) -> None:
            for name, node in sorted(of_folder(folder).items()):
                below = f"{path}/{name}" if path else name
                if isinstance(node, _Folder):
                    found[below] = None
                    walk(node, below)
                else:
                    found[below] = of_file(node)

        walk(self._root, "")
        return found

    def _torn(self, file: _File) -> bytes:
        if self._last is None or self._last[0] is not file or len(file.history) < 2:
            return file.now
        _, first, last = self._last
        middle = (first + last) // 2
        before = file.history[-2][1]
        return file.now[:middle] + before[middle:]

    def _folder(self, path: PurePosixPath) -> _Folder:
        here: _File | _Folder = self._root
        for part in path.parts:
            found = here.now.get(part) if isinstance(here, _Folder) else None
            if found is None:
                raise _lost(str(path))
            here = found
        if not isinstance(here, _Folder):
            raise _lost(str(path))
        return here

    def _node(self, path: str) -> _File | _Folder:
        place = PurePosixPath(path)
        if not place.parts:
            return self._root
        found = self._folder(place.parent).now.get(place.name)
        if found is None:
            raise _lost(path)
        return found

    def _name(self, path: str, node: _File | _Folder | None, number: int) -> None:
        place = PurePosixPath(path)
        folder = self._folder(place.parent)
        entries = {name: one for name, one in folder.now.items() if name != place.name}
        folder.change(number, entries if node is None else {**entries, place.name: node})

    def _rename(self, path: str, target: str, number: int) -> None:
        node = self._node(path)
        old, new = PurePosixPath(path), PurePosixPath(target)
        if old.parent == new.parent:  # one change of one folder, which is there or is not
            folder = self._folder(old.parent)
            entries = {name: one for name, one in folder.now.items() if name != old.name}
            folder.change(number, {**entries, new.name: node})
        else:
            self._name(target, node, number)
            self._name(path, None, number)

    def _write(self, operation: Operation, number: int) -> None:
        file = self._node(operation.path)
        if not isinstance(file, _File):
            raise _lost(operation.path)
        content, offset = file.now, operation.offset
        if operation.kind == "resize":
            short = content if operation.grows_only else content[:offset]
            file.change(number, short.ljust(offset, b"\0"))
            return
        if offset < 0:
            offset = len(content)
        end = offset + len(operation.data)
        file.change(number, content[:offset].ljust(offset, b"\0") + operation.data + content[end:])
        self._last = (file, offset, end)


def _at(folder: _Folder, moment: int) -> Mapping[str, _File | _Folder]:
    """The names of a folder at a moment, or what was synced since."""
    return next(
        (names for number, names in reversed(folder.history) if number <= moment), folder.durable
    )


def _lost(path: str) -> BadInputError:
    return BadInputError(
        f"The log of the run does something to {path}, which is not there.",
        "See what benchmarks.framework.crash_states.calls leaves out.",
    )
