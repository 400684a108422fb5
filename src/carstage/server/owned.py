"""What servers share that run as a process of ours."""

from __future__ import annotations

from carstage.server.base import TAIL_LINES, Server
from carstage.server.process import ServerProcess


class OwnedServer(Server):
    """A server whose process :meth:`start` makes; it is stopped by its own process group."""

    def __init__(self) -> None:
        super().__init__()
        self._process: ServerProcess | None = None

    def stop(self) -> None:
        """End its process group."""
        if self._process is not None:
            self._process.stop()
        self._endpoint = None

    def kill(self) -> None:
        """End its process group at once."""
        if self._process is not None:
            self._process.kill()
        self.stop()

    def alive(self) -> bool:
        """Whether its process runs."""
        return self._process is not None and self._process.exit_code is None

    def log_tail(self, lines: int = TAIL_LINES) -> str:
        """The last lines of its log."""
        return self._process.tail(lines) if self._process is not None else ""

    @property
    def exit_code(self) -> int | None:
        """Exit status of its process once it ended."""
        return self._process.exit_code if self._process is not None else None
