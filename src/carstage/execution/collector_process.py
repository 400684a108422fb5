"""The collector as a child process: started on a plan, read through a pipe, ended by its id."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any

from carstage.cache import home_folder
from carstage.errors import CollectorError
from carstage.execution import foreign_python

_READ_BYTES = 1 << 16
_LONGEST_LINE_BYTES = 1 << 20
_STOP_S = 20.0
_TAIL_BYTES = 4000
_COLLECTOR = "carstage.collector"
_PLAN_FROM_INPUT = "-"


class InterpreterError(CollectorError):
    """The interpreter that should run the collector cannot be started; another try ends alike."""


_WITH_FOLDERS = """
import os, runpy, sys
sys.path[:] = sys.path[1:] + sys.argv.pop(1).split(os.pathsep)
runpy.run_module(sys.argv.pop(1), run_name="__main__", alter_sys=True)
"""
"""Runs a module as ``python -m`` does; arguments: folders to look in after all others, its name."""


def interpreter_command(python: str, module: str, folders: Sequence[str] = ()) -> list[str]:
    """The command that runs a module with an interpreter, up to its arguments.

    Args:
        python: the interpreter.
        module: one of ``carstage``; with this Python, any.
        folders: where this Python looks for modules last.
    """
    if folders:
        return [python, "-c", _WITH_FOLDERS, os.pathsep.join(folders), module]
    if python == sys.executable:
        return [python, "-m", module]
    return [python, foreign_python.__file__, module]


def _spawned(command: Sequence[str], log_path: Path) -> tuple[int, subprocess.Popen[bytes]]:
    """A process that ends with its standard input, and where its part of the log begins.

    Raises:
        OSError: it cannot be started.
    """
    with log_path.open("ab") as log:
        begin = log.tell()
        process = subprocess.Popen(
            [*command, "--exit-with-input"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=log,
            start_new_session=True,
            # Without one the client crashes, and it makes a folder there.
            env={**os.environ, "HOME": str(home_folder())},
        )
        return begin, process


def _close(process: subprocess.Popen[bytes]) -> None:
    for stream in (process.stdin, process.stdout):
        if stream is not None:
            with suppress(BrokenPipeError):
                stream.close()


class CollectorAhead:
    """An interpreter of the collector that is started before there is a plan.

    It loads the client meanwhile, which takes as long as the rest of the collector's start.

    Args:
        log_path: file that its standard error is appended to.
        python: interpreter with the ``carla`` wheel that fits the server.

    Raises:
        OSError: it cannot be started.
    """

    def __init__(self, log_path: Path, python: str) -> None:
        self.log_path = log_path
        self.log_start, self.process = _spawned(
            [*interpreter_command(python, _COLLECTOR), _PLAN_FROM_INPUT], log_path
        )

    def take(self, plan_path: Path) -> bool:
        """Give it its plan; returns whether it takes it. It belongs to the caller then."""
        stream = self.process.stdin
        assert stream is not None
        place = os.fsencode(plan_path)
        if self.process.poll() is not None or b"\n" in place:  # it is told by one line
            self.end()
            return False
        try:
            stream.write(place + b"\n")
            stream.flush()
        except BrokenPipeError:
            self.end()
            return False
        return True

    def end(self) -> None:
        """End it without a plan; it holds nothing."""
        with suppress(ProcessLookupError):
            os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait()
        _close(self.process)


class CollectorProcess:
    """One run of ``python -m carstage.collector``, in a process group of its own.

    A context manager: leaving it asks the collector to end (it finishes the frame and gives
    everything back) and kills its group when it does not within some seconds. Closing its standard
    input has the same effect, so it also ends when this process is killed.

    Args:
        plan: the collector's plan (docs/formats/run-folder.md).
        plan_path: where the plan is written.
        log_path: file that its standard error is appended to.
        python: interpreter with the ``carla`` wheel that fits the server.
        module: what it runs; another one speaks the same way (measurements have such clients, and
            servers that are not CARLA).
        folders: where Python looks for modules last.
        ahead: a process that waits for a plan, to be used instead of a new one, if it still can.

    Raises:
        InterpreterError: on entering, where the interpreter cannot be started.
    """

    def __init__(
        self,
        plan: Mapping[str, Any],
        *,
        plan_path: Path,
        log_path: Path,
        python: str = sys.executable,
        module: str = _COLLECTOR,
        folders: Sequence[str] = (),
        ahead: CollectorAhead | None = None,
    ) -> None:
        self._plan = plan
        self._plan_path = plan_path
        self._log_path = log_path
        self._python = python
        self._module = module
        self._folders = folders
        self._ahead = ahead
        self._process: subprocess.Popen[bytes] | None = None
        self._buffer = b""
        self._log_start = 0
        self.ended = False
        """Whether its standard output is closed."""

    def __enter__(self) -> CollectorProcess:
        self._plan_path.write_text(json.dumps(self._plan), "utf-8")
        ahead = self._ahead
        if ahead is not None and ahead.take(self._plan_path):
            self._log_start, self._process = ahead.log_start, ahead.process
        else:
            self._start()
        os.set_blocking(self.fileno(), False)
        return self

    def _start(self) -> None:
        command = interpreter_command(self._python, self._module, self._folders)
        try:
            self._log_start, self._process = _spawned(
                [*command, str(self._plan_path)], self._log_path
            )
        except OSError as error:
            # Only what is said of the file is the interpreter's fault: not a lack of memory.
            kind = CollectorError if error.filename is None else InterpreterError
            raise kind(
                f"The collector's interpreter {self._python} cannot be started: {error.strerror}.",
                "Check server.client_python, or leave it to `auto`.",
            ) from error

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        process = self._started
        try:
            if process.poll() is None:
                self.end(_STOP_S)
        finally:
            self.kill()
            process.wait()
            _close(process)

    @property
    def _started(self) -> subprocess.Popen[bytes]:
        if self._process is None:
            raise CollectorError("The collector is not started.", "Use it as a context manager.")
        return self._process

    @property
    def pid(self) -> int:
        """Its process id, which is its process group's, too."""
        return self._started.pid

    @property
    def exit_code(self) -> int | None:
        """Its exit status, negative when a signal ended it; None while it runs."""
        return self._started.poll()

    def fileno(self) -> int:
        """The descriptor of its events, for ``selectors``; readable when there are some."""
        stream = self._started.stdout
        assert stream is not None
        return stream.fileno()

    def read_events(self) -> list[dict[str, Any]]:
        """The events that have come, without waiting; sets ``ended`` at the end of the stream.

        Raises:
            CollectorError: a line is not an event.
        """
        try:
            data = os.read(self.fileno(), _READ_BYTES)
        except BlockingIOError:
            return []
        if not data:
            self.ended = True
        *lines, self._buffer = (self._buffer + data).split(b"\n")
        if len(self._buffer) > _LONGEST_LINE_BYTES:
            raise CollectorError(
                "The collector wrote a line that does not end.", f"See {self._log_path}."
            )
        return [self._parse(line) for line in lines if line.strip()]

    def send_line(self, line: str) -> None:
        """Write a line to its standard input, for a module that reads there.

        Raises:
            CollectorError: it does not read any more.
        """
        stream = self._started.stdin
        assert stream is not None
        try:
            stream.write(line.encode() + b"\n")
            stream.flush()
        except BrokenPipeError as error:
            raise CollectorError("The collector has ended.", f"See {self._log_path}.") from error

    def stop(self) -> None:
        """Ask it to end after the frame that it is at."""
        self._started.terminate()

    def end(self, within_s: float) -> None:
        """Ask it to end, and kill it when it has not done so in time."""
        self.stop()
        if self.wait(within_s) is None:
            self.kill()

    def kill(self) -> None:
        """End it and everything that it started, at once."""
        with suppress(ProcessLookupError):
            os.killpg(self.pid, signal.SIGKILL)

    def wait(self, timeout_s: float) -> int | None:
        """Wait for its end, reading and dropping what it still says; its exit code, or None."""
        process = self._started
        os.set_blocking(self.fileno(), True)
        try:
            process.communicate(timeout=timeout_s)  # closes its standard input, too
        except subprocess.TimeoutExpired:
            return None
        return process.returncode

    def log_tail(self) -> str:
        """The last lines that it wrote to its log, empty when it wrote none."""
        with suppress(OSError), self._log_path.open("rb") as log:
            size = log.seek(0, os.SEEK_END)
            log.seek(max(self._log_start, size - _TAIL_BYTES))
            return log.read().decode("utf-8", "replace").strip()
        return ""

    def _parse(self, line: bytes) -> dict[str, Any]:
        try:
            event = json.loads(line)
        except ValueError:
            event = None
        if not isinstance(event, dict) or not isinstance(event.get("event"), str):
            raise CollectorError(
                f"The collector wrote a line that is no event: {line[:80]!r}.",
                f"See {self._log_path}.",
            )
        return event
