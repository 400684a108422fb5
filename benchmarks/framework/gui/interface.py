"""A ``carstage gui`` process, and what is asked of it without a browser."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from carstage.errors import ServerError

_ANSWER_S = 180.0
_END_S = 30.0
_LOOK_S = 0.2
_OVER = ("ended", "dead")


class Interface:
    """A server of the interface on a free port.

    Args:
        url: that it has printed.
        datasets: its folder of datasets.
    """

    def __init__(self, url: str, datasets: Path) -> None:
        self.url = url
        self.datasets = datasets

    def get(self, path: str) -> Any:
        """The answer to a GET of ``/api`` + path."""
        return self._ask("GET", path, None)

    def post(self, path: str, body: Any = None) -> Any:
        """The answer to a POST."""
        return self._ask("POST", path, {} if body is None else body)

    def put_config(self, config: dict[str, Any]) -> None:
        """Make a configuration the shared one."""
        state = self.get("/config")
        self._ask("PUT", "/config", {"rev": state["rev"], "config": config, "author": "bench"})

    def run(self, run_id: str) -> dict[str, Any]:
        """The summary of a run."""
        summary: dict[str, Any] = self.get(f"/runs/{run_id}")["run"]
        return summary

    def await_tick(self, run_id: str, tick: int) -> None:
        """Wait until a run has recorded so many ticks.

        Raises:
            ServerError: it ended before, or it took too long.
        """
        deadline_s = time.monotonic() + _ANSWER_S
        while time.monotonic() < deadline_s:
            run = self.run(run_id)
            if ((run["current"] or {}).get("ticks_done") or 0) >= tick:
                return
            if run["alive"] in _OVER:
                raise ServerError(f"The run ended early: {run['state']}, {run['message']}.")
            time.sleep(_LOOK_S)
        raise ServerError(f"The run had no {tick} ticks within {_ANSWER_S:g} s.")

    def stop(self, run_id: str) -> None:
        """End a run, at once where it does not finish its frame in time."""
        for _ in range(2):
            if self.run(run_id)["alive"] in _OVER:
                return
            self.post(f"/runs/{run_id}/stop")
            deadline_s = time.monotonic() + _END_S
            while self.run(run_id)["alive"] not in _OVER and time.monotonic() < deadline_s:
                time.sleep(_LOOK_S)

    def _ask(self, method: str, path: str, body: Any) -> Any:
        request = urllib.request.Request(
            f"{self.url}api{path}",
            None if body is None else json.dumps(body).encode(),
            {"Content-Type": "application/json"},
            method=method,
        )
        with urllib.request.urlopen(request, timeout=_ANSWER_S) as answer:
            return json.load(answer)


@contextmanager
def interface(datasets: Path) -> Iterator[Interface]:
    """``carstage gui`` over a folder, warm: it has answered what the first page asks.

    Raises:
        ServerError: it did not start.
    """
    command = [sys.executable, "-m", "carstage.cli", "gui", "--no-browser", "--no-token"]
    command += ["--port", "0"]
    with subprocess.Popen(
        [*command, "--datasets", str(datasets)],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    ) as process:
        assert process.stdout is not None
        try:
            match = re.search(r"http://\S+", process.stdout.readline())
            if match is None:
                raise ServerError("`carstage gui` printed no address.", "Run it to see why.")
            served = Interface(match[0], datasets)
            vehicle = served.get("/config")["config"]["ego"]["blueprint"]
            for path in ("/schema", "/description", f"/vehicles/{vehicle}"):
                served.get(path)
            yield served
        finally:
            process.terminate()
            try:
                process.wait(_END_S)
            except subprocess.TimeoutExpired:
                process.kill()
