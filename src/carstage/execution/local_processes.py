"""Slots that are processes on this machine."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Mapping
from contextlib import suppress
from typing import Any

from carstage.errors import WorkerLostError
from carstage.execution.slots import LineBuffer, Slot, SlotEnd, SlotProgram, SlotsExecutor

_READ_BYTES = 1 << 16
_TAIL_BYTES = 2000
_LAST_S = 5.0


class SlotProcess(Slot):
    """``python -m MODULE`` in a session of its own, so that Ctrl-C reaches the run alone.

    Args:
        program: what it runs.

    Raises:
        WorkerLostError: it cannot be started.
    """

    def __init__(self, program: SlotProgram) -> None:
        self._buffer = LineBuffer()
        self._log_path = program.log_path
        try:
            program.log_path.parent.mkdir(parents=True, exist_ok=True)
            with program.log_path.open("ab") as log:
                self._log_start = log.tell()
                self._process = subprocess.Popen(
                    [sys.executable, "-m", program.module],
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    stderr=log,
                    env={**os.environ, **program.environment},
                    start_new_session=True,
                )
        except OSError as error:
            raise WorkerLostError(f"A worker cannot be started: {error}.") from error
        os.set_blocking(self.fileno(), False)

    @property
    def pid(self) -> int:
        """Its process id."""
        return self._process.pid

    def fileno(self) -> int:
        """The descriptor of its messages."""
        assert self._process.stdout is not None
        return self._process.stdout.fileno()

    def read(self) -> list[dict[str, Any]]:
        """See ``Slot.read``."""
        try:
            data = os.read(self.fileno(), _READ_BYTES)
        except BlockingIOError:
            return []
        if not data:
            self.ended = True
        return self._buffer.messages(data)

    def send(self, message: Mapping[str, Any]) -> None:
        """See ``Slot.send``."""
        assert self._process.stdin is not None
        with suppress(BrokenPipeError):  # it has ended, which its own line tells
            self._process.stdin.write(json.dumps(message).encode() + b"\n")
            self._process.stdin.flush()

    def interrupt(self) -> None:
        """Send it SIGINT."""
        self._process.send_signal(signal.SIGINT)

    def kill(self) -> None:
        """Send it SIGKILL; what it has started ends with it, as its line breaks."""
        self._process.kill()

    def close(self) -> SlotEnd:
        """See ``Slot.close``."""
        try:
            self._process.wait(_LAST_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        for stream in (self._process.stdin, self._process.stdout):
            assert stream is not None
            with suppress(BrokenPipeError):
                stream.close()
        code = self._process.returncode
        how = f"exit status {code}." if code >= 0 else f"signal {-code}."
        return SlotEnd(" ".join(filter(None, (how, self._log_tail()))), certain=True)

    def _log_tail(self) -> str:
        with suppress(OSError), self._log_path.open("rb") as log:
            size = log.seek(0, os.SEEK_END)
            log.seek(max(self._log_start, size - _TAIL_BYTES))
            text = log.read().decode("utf-8", "replace").strip()
            return f"Its last words: {text}" if text else ""
        return ""


class LocalProcesses(SlotsExecutor):
    """Several workers on this machine, each in a process of its own."""

    def open_slot(self, number: int, program: SlotProgram) -> SlotProcess:
        """See ``SlotsExecutor.open_slot``."""
        del number
        return SlotProcess(program)
