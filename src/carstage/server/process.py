"""A server's process: in a group of its own, its output in a log, ended by its own id."""

from __future__ import annotations

import os
import signal
import subprocess
import threading
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path

from carstage.files.scratch import Scratch

STOP_S = 10.0
KILL_S = 10.0
_TAIL_BYTES = 16_384
_LAST_WORDS_S = 2.0
"""For the last lines of a process that has ended to come through its pipe."""


class ServerProcess:
    """Runs one command; stdout and stderr go to one log file.

    Args:
        command: program and arguments.
        log_path: file that the output is appended to; None uses a temporary one.
        environment: added to this process's environment.
        marker: the first word(s) of the line on stdout that :meth:`wait_line` waits for.
    """

    def __init__(
        self,
        command: Sequence[str],
        *,
        log_path: Path | None,
        environment: Mapping[str, str] | None = None,
        marker: str = "",
    ) -> None:
        self._marker = marker.encode()
        self._line = ""
        self._seen = threading.Event()
        self._ended = threading.Event()
        if log_path is None:
            self._temporary_log: Scratch | None = Scratch("carstage-server-", ".log", folder=False)
            self.log_path = self._temporary_log.path
        else:
            self._temporary_log = None
            self.log_path = log_path
            log_path.parent.mkdir(parents=True, exist_ok=True)
        with self.log_path.open("ab") as log:
            self._log_start = log.tell()
            self._process = subprocess.Popen(
                list(command),
                stdin=subprocess.PIPE,  # its end shows the watch that this process is gone
                stdout=subprocess.PIPE,
                stderr=log,
                env={**os.environ, **(environment or {})},
                start_new_session=True,
            )
        self._copier = threading.Thread(target=self._copy_output, name="server-output", daemon=True)
        self._copier.start()
        self._waiter = threading.Thread(target=self._await_end, name="server-end", daemon=True)
        self._waiter.start()

    @property
    def pid(self) -> int:
        """Its process id and the id of its group."""
        return self._process.pid

    @property
    def exit_code(self) -> int | None:
        """Its exit status, None while it runs."""
        if not self._ended.is_set() and self._is_over():
            self._ended.wait(KILL_S)  # the thread that waits for its end is about to say so
        return self._process.returncode if self._ended.is_set() else None

    def wait_line(self, timeout_s: float) -> str:
        """Wait for the line that begins with the marker; empty when it ended or time is up."""
        self._seen.wait(timeout_s)
        return self._line

    def wait_end(self, timeout_s: float) -> bool:
        """Wait for its end, at most ``timeout_s``; return whether it ended."""
        return self._ended.wait(timeout_s)

    def tail(self, lines: int) -> str:
        """The last lines of its log, those of an earlier process in the same file left out.

        Of a process that has ended they hold all that it wrote.
        """
        if self._ended.is_set():
            self._copier.join(_LAST_WORDS_S)
        try:
            with self.log_path.open("rb") as log:
                end = log.seek(0, os.SEEK_END)
                log.seek(max(self._log_start, end - _TAIL_BYTES))
                text = log.read().decode("utf-8", "replace")
        except FileNotFoundError:
            return ""
        return "\n".join(text.rstrip().splitlines()[-lines:])

    def kill(self) -> None:
        """End its whole group at once; :meth:`stop` gives the rest back."""
        if not self._ended.is_set():
            self._signal(signal.SIGKILL)
            self.wait_end(KILL_S)

    def stop(self) -> None:
        """End its whole group: SIGTERM, then SIGKILL for what is left."""
        if not self._ended.is_set():
            self._signal(signal.SIGTERM)
            self._signal(signal.SIGCONT)  # one that is held still would not hear of it
        if not self.wait_end(STOP_S):
            self._signal(signal.SIGKILL)
            self.wait_end(KILL_S)
        self._copier.join(KILL_S)
        for stream in (self._process.stdin, self._process.stdout):
            if stream is not None:
                with suppress(BrokenPipeError):
                    stream.close()
        if self._temporary_log is not None:
            self._temporary_log.remove()

    def _signal(self, number: signal.Signals) -> None:
        with suppress(ProcessLookupError):
            os.killpg(self._process.pid, number)

    def _is_over(self) -> bool:
        try:
            found = os.waitid(os.P_PID, self._process.pid, os.WEXITED | os.WNOHANG | os.WNOWAIT)
        except ChildProcessError:  # reaped
            return True
        return found is not None

    def _await_end(self) -> None:
        # Seen, not yet reaped: its id, and with it the id of its group, is still its own. What it
        # leaves behind in the group goes with it.
        with suppress(ChildProcessError):  # somebody else in this process has reaped it
            os.waitid(os.P_PID, self._process.pid, os.WEXITED | os.WNOWAIT)
            self._signal(signal.SIGKILL)
        self._process.wait()
        self._ended.set()

    def _copy_output(self) -> None:
        output = self._process.stdout
        assert output is not None
        with self.log_path.open("ab", buffering=0) as log:
            for line in output:
                with suppress(OSError):  # a full disk: who stops reading stops the server
                    log.write(line)
                if self._marker and not self._line and line.startswith(self._marker):
                    self._line = line.decode("utf-8", "replace").strip()
                    self._seen.set()
        self._seen.set()
