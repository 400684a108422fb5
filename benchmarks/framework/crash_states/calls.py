"""What a command did to the files below a folder, from a log of ``strace``."""

from __future__ import annotations

import posixpath
import re
import shutil
import subprocess
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from carstage.errors import BadInputError

_CALLS = (
    *("write", "pwrite64", "writev", "pwritev", "pwritev2", "fallocate", "ftruncate", "truncate"),
    *("rename", "renameat", "renameat2", "link", "linkat", "unlink", "unlinkat", "rmdir"),
    *("mkdir", "mkdirat", "open", "openat", "creat", "fsync", "fdatasync", "lseek", "dup", "dup2"),
    *("dup3", "fcntl", "sendfile", "copy_file_range", "splice", "symlink", "symlinkat", "mmap"),
)
_LINE = re.compile(r"^(?P<process>\d+) +(?P<rest>.*)$")
_RESUMED = re.compile(r"^<\.\.\. \w+ resumed>(?P<rest>.*)$")
_CALL = re.compile(r"^(?P<name>\w+)\((?P<arguments>.*)\) += (?P<result>-?\d+)(?P<after>.*)$")
_HEX = r"((?:\\x[0-9a-f]{2})*)"
_TEXT = re.compile(rf'"{_HEX}"')
_DESCRIPTOR = re.compile(rf"^(\d+)<{_HEX}>(\(deleted\))?")
_RESULT_PATH = re.compile(rf"^<{_HEX}>(\(deleted\))?")
_BESIDE = re.compile(rf'(?:AT_FDCWD|\d+)<{_HEX}>, "{_HEX}"')
_UNFINISHED = " <unfinished ...>"


@dataclass(frozen=True, slots=True)
class Operation:
    """One thing that was done to the files below the folder.

    Attributes:
        kind: ``create``, ``write``, ``resize``, ``rename``, ``link``, ``unlink``, ``mkdir``,
            ``rmdir`` or ``sync``.
        path: relative to the folder; empty for itself.
        target: the new name of ``rename`` and ``link``.
        offset: where ``write`` begins, or the size that ``resize`` gives; -1: at the file's end.
        data: what ``write`` writes.
        begun: number of operations that had ended when this one began; what came later is not
            among what ``sync`` makes durable.
        grows_only: ``resize`` only makes files longer.
    """

    kind: str
    path: str
    target: str = ""
    offset: int = 0
    data: bytes = b""
    begun: int = 0
    grows_only: bool = False

    @property
    def place(self) -> str:
        """The kind of file it is done to: its path without what only numbers or names one."""
        parts = PurePosixPath(self.path).parts
        name = re.sub(r"[0-9a-f]{16}|\d{8}-\d{6}-[0-9a-f]{6}|\d+", "#", self.path)
        return name if len(parts) < 8 else re.sub(r"/[^/]*$", "/…", name)

    def __str__(self) -> str:
        return f"{self.kind} {self.path}"


def record_calls(command: Sequence[str], folder: Path, log: Path) -> list[Operation]:
    """Run a command and tell what it and its processes did to the files below a folder.

    Raises:
        BadInputError: there is no ``strace``, the command fails, or it changes files in a way that
            is not known here.
    """
    if shutil.which("strace") is None:
        raise BadInputError("There is no strace.", "Install it, as by `apt-get install strace`.")
    options = ["-f", "-y", "-qq", "-xx", "-s", str(1 << 24), "-e", f"trace={','.join(_CALLS)}"]
    done = subprocess.run(
        ["strace", *options, "-o", str(log), *command], capture_output=True, text=True, check=False
    )
    if done.returncode:
        raise BadInputError("The command fails under strace.", done.stderr[-500:])
    with log.open(encoding="ascii", errors="replace") as lines:
        return read_log(lines, folder)


def read_log(lines: Iterator[str], folder: Path) -> list[Operation]:
    """The operations of a log, in the order in which they ended.

    Raises:
        BadInputError: files are changed in a way that is not known here.
    """
    reader = _Reader(str(folder))
    waiting: dict[str, tuple[str, int]] = {}
    for line in lines:
        found = _LINE.match(line)
        if found is None:
            continue
        process, rest = found["process"], found["rest"]
        begun = len(reader.operations)
        if rest.endswith(_UNFINISHED):
            waiting[process] = (rest.removesuffix(_UNFINISHED), begun)
            continue
        resumed = _RESUMED.match(rest)
        if resumed is not None:
            first, begun = waiting.pop(process, ("", begun))
            rest = first + resumed["rest"]
        call = _CALL.match(rest)
        if call is not None and int(call["result"]) >= 0:
            reader.take(call, begun)
    return reader.operations


class _Opened:
    """Where an open file is written next; several descriptors may share it."""

    def __init__(self, at_end: bool) -> None:
        self.at_end = at_end
        self.offset = 0


class _Reader:
    def __init__(self, folder: str) -> None:
        self.operations: list[Operation] = []
        self._folder = folder
        self._opened: dict[tuple[str, int], _Opened] = {}
        self._known: set[str] = set()
        handlers: dict[str, Callable[[re.Match[str], int], None]] = {
            **dict.fromkeys(("open", "openat", "creat"), self._open),
            **dict.fromkeys(("dup", "dup2", "dup3", "fcntl"), self._duplicate),
            **dict.fromkeys(("fsync", "fdatasync"), self._sync),
            **dict.fromkeys(("mkdir", "mkdirat"), self._make_folder),
            **dict.fromkeys(("rename", "renameat", "renameat2", "link", "linkat"), self._move),
            **dict.fromkeys(("unlink", "unlinkat", "rmdir"), self._remove),
            **dict.fromkeys(("write", "writev"), self._write),
            **dict.fromkeys(("pwrite64", "pwritev", "pwritev2"), self._write_at),
            **dict.fromkeys(("ftruncate", "fallocate"), self._resize),
            "lseek": self._seek,
            "mmap": self._map,
        }
        self._handlers: Mapping[str, Callable[[re.Match[str], int], None]] = handlers

    def take(self, call: re.Match[str], begun: int) -> None:
        """Note a call that went well, if it is about files below the folder."""
        handler = self._handlers.get(call["name"], self._unknown)
        handler(call, begun)

    def _below(self, path: str) -> str | None:
        path = posixpath.normpath(path)
        if path == self._folder:
            return ""
        start = f"{self._folder}/"
        return path[len(start) :] if path.startswith(start) else None

    def _descriptor(self, call: re.Match[str]) -> tuple[str, int] | None:
        """Path and number of the descriptor that is a call's first argument."""
        found = _DESCRIPTOR.match(call["arguments"])
        if found is None or found[3]:
            return None
        path = self._below(_decoded(found[2]))
        return None if path is None else (path, int(found[1]))

    def _paths(self, call: re.Match[str]) -> list[str | None]:
        """The paths that a call names; None for those elsewhere."""
        arguments = call["arguments"]
        if call["name"].endswith(("at", "at2")):
            found = [
                str(PurePosixPath(_decoded(one[1]), _decoded(one[2])))
                for one in _BESIDE.finditer(arguments)
            ]
        else:
            found = [_decoded(one[1]) for one in _TEXT.finditer(arguments)]
        return [self._below(path) for path in found]

    def _note(self, kind: str, path: str, begun: int, **more: object) -> None:
        self.operations.append(Operation(kind, path, begun=begun, **more))  # type: ignore[arg-type]

    def _open(self, call: re.Match[str], begun: int) -> None:
        named = _RESULT_PATH.match(call["after"])
        path = None if named is None or named[2] else self._below(_decoded(named[1]))
        if path is None:
            return
        flags = call["arguments"].rpartition('"')[2]
        number = int(call["result"])
        if "O_DIRECTORY" not in flags and ("O_WRONLY" in flags or "O_RDWR" in flags):
            self._opened[path, number] = _Opened("O_APPEND" in flags)
            if "O_CREAT" in flags and path not in self._known:
                self._known.add(path)
                self._note("create", path, begun)
            elif "O_TRUNC" in flags:
                self._note("resize", path, begun)

    def _duplicate(self, call: re.Match[str], begun: int) -> None:
        del begun
        source = self._descriptor(call)
        if source is None or (call["name"] == "fcntl" and "F_DUPFD" not in call["arguments"]):
            return
        if source in self._opened:
            self._opened[source[0], int(call["result"])] = self._opened[source]

    def _sync(self, call: re.Match[str], begun: int) -> None:
        where = self._descriptor(call)
        if where is not None:
            self._note("sync", where[0], begun)

    def _make_folder(self, call: re.Match[str], begun: int) -> None:
        for path in self._paths(call):
            if path is not None:
                self._note("mkdir", path, begun)

    def _move(self, call: re.Match[str], begun: int) -> None:
        paths = self._paths(call)
        if paths == [None, None]:
            return
        source, target = paths
        if source is None or target is None:
            raise _not_known(call, "from or to another folder")
        kind = "link" if call["name"].startswith("link") else "rename"
        if source != target:
            self._note(kind, source, begun, target=target)
            self._known.add(target)
        if kind == "rename":
            self._known.discard(source)
            for path, number in [key for key in self._opened if key[0] == source]:
                self._opened[target, number] = self._opened.pop((path, number))

    def _remove(self, call: re.Match[str], begun: int) -> None:
        for path in self._paths(call):
            if path is not None:
                is_folder = call["name"] == "rmdir" or "AT_REMOVEDIR" in call["arguments"]
                self._note("rmdir" if is_folder else "unlink", path, begun)
                self._known.discard(path)

    def _write(self, call: re.Match[str], begun: int) -> None:
        where = self._descriptor(call)
        if where is None:
            return
        opened = self._opened.get(where)
        if opened is None:
            raise _not_known(call, f"to a descriptor of {where[0]} that was opened elsewhere")
        data = self._data(call)
        offset = -1 if opened.at_end else opened.offset
        self._note("write", where[0], begun, offset=offset, data=data)
        opened.offset += len(data)

    def _write_at(self, call: re.Match[str], begun: int) -> None:
        where = self._descriptor(call)
        if where is None:
            return
        numbers = re.findall(r"-?\d+", re.sub(r"^.*[\"\]]", "", call["arguments"]))
        self._note("write", where[0], begun, offset=int(numbers[1]), data=self._data(call))

    def _data(self, call: re.Match[str]) -> bytes:
        after = call["arguments"].partition(", ")[2]
        written = b"".join(_bytes(one[1]) for one in _TEXT.finditer(after))
        return written[: int(call["result"])]

    def _resize(self, call: re.Match[str], begun: int) -> None:
        where = self._descriptor(call)
        if where is None:
            return
        values = call["arguments"].split(", ")[1:]
        if call["name"] == "ftruncate":
            self._note("resize", where[0], begun, offset=int(values[0]))
        elif values[0] == "0":
            end = int(values[1]) + int(values[2])
            self._note("resize", where[0], begun, offset=end, grows_only=True)
        elif values[0] != "FALLOC_FL_KEEP_SIZE":
            raise _not_known(call, values[0])

    def _seek(self, call: re.Match[str], begun: int) -> None:
        del begun
        where = self._descriptor(call)
        if where is not None and where in self._opened:
            self._opened[where].offset = int(call["result"])

    def _map(self, call: re.Match[str], begun: int) -> None:
        del begun
        found = re.search(rf"MAP_SHARED[^,]*, \d+<{_HEX}>", call["arguments"])
        writes = found is not None and "PROT_WRITE" in call["arguments"]
        if found is not None and writes and self._below(_decoded(found[1])) is not None:
            raise _not_known(call, "through memory")

    def _unknown(self, call: re.Match[str], begun: int) -> None:
        del begun
        if call["name"] == "truncate" or call["name"].startswith("symlink"):
            touched = any(path is not None for path in self._paths(call))
        else:
            paths = re.findall(rf"\d+<{_HEX}>", call["arguments"])
            touched = any(self._below(_decoded(path)) is not None for path in paths)
        if touched:
            raise _not_known(call, "as no other run did")


def _bytes(text: str) -> bytes:
    return bytes.fromhex(text.replace("\\x", ""))


def _decoded(text: str) -> str:
    return _bytes(text).decode("utf-8", "surrogateescape")


def _not_known(call: re.Match[str], why: str) -> BadInputError:
    return BadInputError(
        f"The run changes files by {call['name']}, {why}.",
        "Teach benchmarks.framework.crash_states this call.",
    )
