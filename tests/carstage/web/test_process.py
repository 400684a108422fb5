"""``carstage gui`` as a process: address, token, end, and what a new one takes over."""

from __future__ import annotations

import json
import re
import signal
import socket
import subprocess
import sys
import tempfile
import urllib.error
import urllib.request
import webbrowser
from collections.abc import Iterator
from contextlib import contextmanager
from http.cookiejar import CookieJar
from ipaddress import ip_address
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest

from carstage.web.opening import open_in_browser
from carstage.web.settings import EVERY_ADDRESS, WebSettings

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


def test_other_users_of_the_machine_are_asked_for_the_token(tmp_path: Path) -> None:
    with gui(tmp_path) as (_, url):
        address, _, token = url.partition("?token=")
        assert address.startswith("http://127.0.0.1:")
        assert len(token) >= 32
        with pytest.raises(urllib.error.HTTPError) as refused:
            read(browser(), f"{address}api/config")
        assert refused.value.code == 403
        refused.value.close()
        opener = browser()
        opener.open(url, timeout=60).close()
        assert read(opener, f"{address}api/config")["rev"] == 0


def test_without_a_token_it_listens_on_loopback_alone(tmp_path: Path) -> None:
    command = [*COMMAND, "--datasets", str(tmp_path), "--no-token", "--host", BESIDE]
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    assert ended.returncode == 2
    assert "--no-token" in ended.stderr


@pytest.mark.parametrize("every", EVERY_ADDRESS)
def test_the_printed_address_of_every_address_is_one_of_this_machine(every: str) -> None:
    host = urlsplit(WebSettings(roots=(Path(),), host=every).url).hostname
    assert host is not None
    assert not ip_address(host).is_unspecified
    if ":" not in host:  # not every machine has IPv6
        with socket.socket() as here:
            here.bind((host, 0))  # which only an own address can be


def test_the_browser_gets_the_token_by_a_file_of_its_owner(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened: list[str] = []
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setattr(webbrowser, "open", opened.append)
    path = open_in_browser("http://127.0.0.1:1/?token=secret")
    assert opened == [path.as_uri()]
    assert path.stat().st_mode & 0o077 == 0
    assert "url=http://127.0.0.1:1/?token=secret" in path.read_text()


def test_a_server_that_was_killed_leaves_its_place_and_its_state_to_the_next(
    tmp_path: Path,
) -> None:
    with gui(tmp_path, "--no-token") as (process, url):
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


def test_no_temporary_folder_outlives_the_interface_but_until_the_next_after_a_crash(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    monkeypatch.setenv("TMPDIR", str(temporary))
    folders: list[list[Path]] = []
    for number in (signal.SIGKILL, signal.SIGTERM, signal.SIGINT):
        with gui(tmp_path / "datasets", "--no-token") as (process, _):
            folders.append(list(temporary.iterdir()))
            process.send_signal(number)
            process.wait(30)
    assert [len(found) for found in folders] == [1, 1, 1]
    assert folders[0] != folders[1]
    assert not list(temporary.iterdir())
