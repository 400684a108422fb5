"""``carstage gui`` as a process: address, token, end, and what a new one takes over."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import sys
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from http.cookiejar import CookieJar
from pathlib import Path
from typing import Any

import pytest

COMMAND = [sys.executable, "-m", "carstage.cli", "gui", "--no-browser", "--port", "0"]
BESIDE = "127.0.0.2"
"""Another address of this machine alone, which counts as one that others can reach."""


@contextmanager
def gui(root: Path, *arguments: str) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """The process and the address that it printed."""
    with subprocess.Popen(
        [*COMMAND, "--datasets", str(root), *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    ) as process:
        assert process.stdout is not None
        try:
            match = re.search(r"http://\S+", process.stdout.readline())
            assert match is not None
            yield process, match[0]
        finally:
            process.kill()


def read(opener: urllib.request.OpenerDirector, url: str, body: Any = None) -> Any:
    data = None if body is None else json.dumps(body).encode()
    request = urllib.request.Request(url, data, {"Content-Type": "application/json"})
    request.method = "GET" if body is None else "PUT"
    with opener.open(request, timeout=60) as answer:
        return json.load(answer)


def browser() -> urllib.request.OpenerDirector:
    """Keeps cookies, as browsers do."""
    return urllib.request.build_opener(urllib.request.HTTPCookieProcessor(CookieJar()))


def test_a_server_that_was_killed_leaves_its_place_and_its_state_to_the_next(
    tmp_path: Path,
) -> None:
    with gui(tmp_path) as (process, url):
        state = read(browser(), f"{url}api/config")
        change = {"rev": state["rev"], "config": {**state["config"], "name": "kept"}}
        assert read(browser(), f"{url}api/config", change)["rev"] == 1
        second = subprocess.run(
            [*COMMAND, "--datasets", str(tmp_path)], capture_output=True, text=True, check=False
        )
        assert second.returncode == 2
        assert "Another `carstage gui`" in second.stderr
        process.send_signal(signal.SIGKILL)
        process.wait(30)
    with gui(tmp_path, "--host", BESIDE) as (process, url):
        assert "?token=" in url
        plain = url.split("?")[0]
        with pytest.raises(urllib.error.HTTPError) as refused:
            read(browser(), f"{plain}api/config")
        assert refused.value.code == 403
        refused.value.close()
        opener = browser()
        with opener.open(url, timeout=60) as answer:
            assert "token" not in answer.url
        assert read(opener, f"{plain}api/config")["config"]["name"] == "kept"
        process.send_signal(signal.SIGINT)
        assert process.wait(30) == 0
