"""Errors of the system, given to single calls of a run by ``strace --inject``.

A run under ``strace`` first tells which calls it makes on which files below its dataset. A trial
then draws one of these calls, and an error that the system may answer with there.
"""

from __future__ import annotations

import random
import re
import shutil
import subprocess
from collections import Counter
from contextlib import ExitStack
from pathlib import Path
from typing import ClassVar

from benchmarks.framework.faults.command import Moment, RunCommand
from benchmarks.framework.faults.kinds import Fault
from carstage.errors import BadInputError

RUN_ID = "first"
_WRITES = ("write", "pwrite64", "writev", "pwritev", "pwritev2")
_NAMES = ("rename", "renameat", "renameat2", "link", "linkat", "mkdir", "mkdirat")
_ERRORS: dict[str, tuple[str, ...]] = {
    **dict.fromkeys(_WRITES, ("ENOSPC", "EIO")),
    **dict.fromkeys(("fsync", "fdatasync"), ("EIO", "ENOSPC")),
    **dict.fromkeys(_NAMES, ("ENOSPC", "EIO", "ENOMEM")),
    **dict.fromkeys(("ftruncate", "fallocate"), ("ENOSPC", "EIO")),
    **dict.fromkeys(("unlink", "unlinkat"), ("EIO", "ENOMEM")),
    "openat": ("EMFILE", "ENOMEM", "EIO", "ENOSPC"),
    "mmap": ("ENOMEM",),
}
"""What may be answered, by call."""
_ANYWHERE = ("fsync", "link", "rename")
"""Calls that only the dataset's files meet: they are also tried by number, whatever their file."""
_ANYWHERE_SHARE = 0.2
_MOST_PER_CALL = 6
_CALL = re.compile(r"^(?P<process>\d+) +(?P<call>\w+)\((?P<rest>.*)$")
_DESCRIPTOR = re.compile(r"^\d+<(?P<path>/[^>]*)>")
_QUOTED = re.compile(r'"(?P<path>/[^"]*)"')

Call = tuple[str, str, int]
"""Name, path relative to the dataset (empty: whatever it is), and which one of its process."""


def strace_command(log: Path, *options: str) -> list[str]:
    """``strace`` over a command and all its processes.

    Raises:
        BadInputError: it is not installed.
    """
    if shutil.which("strace") is None:
        raise BadInputError("There is no strace.", "Install it, as by `apt-get install strace`.")
    calls = ",".join(_ERRORS)
    return ["strace", "-f", "-y", "-qq", "-o", str(log), "-e", f"trace={calls}", *options]


def calls_of(log: Path, out: Path) -> list[Call]:
    """The calls that a log of a run has on the files below its dataset; each name path by path.

    Names that are drawn by chance differ from run to run and are left out.
    """
    counts: Counter[tuple[str, str, str]] = Counter()
    anywhere: Counter[tuple[str, str]] = Counter()
    for line in log.read_text("utf-8", "replace").splitlines():
        found = _CALL.match(line)
        if found is None or " = -1 ENOENT" in line:
            continue
        call, rest = found["call"], found["rest"]
        if call in _ANYWHERE:
            anywhere[call, found["process"]] += 1
        named = _DESCRIPTOR.match(rest)
        paths = [named["path"]] if named else [one["path"] for one in _QUOTED.finditer(rest)]
        for path in paths:
            if path.startswith(f"{out}/"):
                counts[call, path[len(str(out)) + 1 :], found["process"]] += 1
    most: dict[tuple[str, str], int] = {}
    for (call, path, _), count in counts.items():
        most[call, path] = max(count, most.get((call, path), 0))
    for (call, _), count in anywhere.items():
        most[call, ""] = max(count, most.get((call, ""), 0))
    by_chance = re.compile(r"\.[0-9a-f]{16}|\.status\.json\.|\.plan\.json\.|\.process\.json\.")
    return sorted(
        (call, path, number)
        for (call, path), count in most.items()
        if not by_chance.search(path)
        for number in range(1, (count if not path else min(count, _MOST_PER_CALL)) + 1)
    )


def survey(command: list[str], out: Path, log: Path) -> list[Call]:
    """The calls of a run.

    Args:
        command: the run.
        out: its dataset.
        log: file for what ``strace`` writes.

    Raises:
        BadInputError: there is no ``strace``, or the run fails under it.
    """
    done = subprocess.run(
        [*strace_command(log), *command], capture_output=True, text=True, check=False
    )
    if done.returncode:
        raise BadInputError("The run fails under strace.", done.stderr[-500:])
    return calls_of(log, out)


def draw_call(rng: random.Random, calls: list[Call]) -> Call:
    """One of the calls: each name and each place as probable as the others, not each call."""
    anywhere = rng.random() < _ANYWHERE_SHARE
    eligible = [call for call in calls if (call[1] == "") == anywhere]
    name = rng.choice(sorted({call[0] for call in eligible}))
    place = rng.choice(sorted({_place(call[1]) for call in eligible if call[0] == name}))
    return rng.choice([c for c in eligible if c[0] == name and _place(c[1]) == place])


def _place(path: str) -> str:
    """The kind of place that a path is: its folders without what only numbers them."""
    return re.sub(r"[0-9a-f]{16}|\d+|[^/]*\.(png|npy|npz)$", "#", path)


class IoError(Fault):
    """An error of the system at one call of the run, or the same call of several processes."""

    name: ClassVar[str] = "io_error"
    sweeps: ClassVar[bool] = True

    def __init__(self, rng: random.Random, calls: list[Call]) -> None:
        super().__init__(rng)
        self.call, self.path, self.number = draw_call(rng, calls)
        self.error = rng.choice(_ERRORS[self.call])
        self.moment = Moment("run_started")
        self.run_id = RUN_ID
        self._log = Path()
        where = self.path or "any file"
        self.detail = f"{self.call} {self.number} of {where}: {self.error}"

    def prepare(self, stack: ExitStack, folder: Path, ports: tuple[int, int]) -> Path:
        """See ``Fault``."""
        out = super().prepare(stack, folder, ports)
        self._log = folder / "strace.log"
        inject = f"inject={self.call}:error={self.error}:when={self.number}"
        only = ["-P", str(out / self.path)] if self.path else []
        self.prefix = strace_command(self._log, "-e", inject, *only)
        return out

    def strike(self, run: RunCommand) -> bool:
        """It strikes by itself."""
        del run
        return False

    def has_struck(self) -> bool:
        """Whether any call got the error."""
        return self._log.exists() and "(INJECTED)" in self._log.read_text("utf-8", "replace")

    def wrong(self) -> list[str]:
        """Files that were synced again after that failed, and not written anew in between.

        What the system could not write it may have dropped: a second call that succeeds says
        nothing of it.
        """
        if self.call not in ("fsync", "fdatasync") or not self.path or not self._log.exists():
            return []
        failed = False
        for line in self._log.read_text("utf-8", "replace").splitlines():
            found = _CALL.match(line)
            if found is None or " resumed>" in line:
                continue
            if "(INJECTED)" in line:
                failed = "O_DIRECTORY" not in line and "." in Path(self.path).name
            elif found["call"] in (*_NAMES, *_WRITES, "unlink", "unlinkat") or (
                found["call"] == "openat" and "O_TRUNC" in line
            ):
                failed = False
            elif failed and found["call"] in ("fsync", "fdatasync") and line.endswith("= 0"):
                return [f"{self.path} was synced again and believed"]
        return []
