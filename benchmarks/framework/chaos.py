"""Many short episodes into an object store while everything breaks: each is there once, and whole.

Several workers record into an S3 server behind a proxy that refuses, delays, cuts off and forgets
to answer some of the requests. Meanwhile processes of the run are killed by chance, now and then
the run itself. The same command is given again until it is done. Then every committed file is read
from the store and compared with its hash, and after ``catalog gc`` nothing else may be there.
"""

from __future__ import annotations

import http.client
import os
import random
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import psutil

from benchmarks.framework.object_store import s3_server
from benchmarks.framework.recorded import run_carstage
from carstage.bench.verdict import Figure, Verdict
from carstage.files.hashing import hash_of
from carstage.storage import open_store
from carstage.storage.remote_files import remote_files

_MOST_RUNS = 40
_RUN_S = 3600.0
_COMPARED = 3
_CONFIG = """\
name: chaos
seed: 11
episodes: {episodes}
duration_s: 0.5
fps: 10
vehicles: {{count: 2}}
pedestrians: {{count: 1}}
image_size: [96, 54]
timing: {{warmup_ticks: 5}}
conversion: {{workers: 1}}
server: {{kind: embedded, self_test: "off"}}
rig:
  sensors:
    - {{id: CAM_FRONT, kind: rgb, pose: {{x: 1.5, z: 1.6}}}}
    - {{id: DEPTH_FRONT, kind: depth, pose: {{x: 1.5, z: 1.6}}}}
    - {{id: LIDAR_TOP, kind: lidar, pose: {{z: 1.9}}, attributes: {{channels: 16}}}}
"""


class FlakyProxy:
    """Stands before an S3 server and spoils some of its answers.

    Args:
        port: of the server.
        seed: of what is spoilt.
        share: of the requests that are.
    """

    def __init__(self, port: int, seed: int, share: float) -> None:
        self.spoilt: Counter[str] = Counter()
        draw, lock = random.Random(seed), threading.Lock()
        proxy = self

        class Handler(BaseHTTPRequestHandler):
            protocol_version = "HTTP/1.1"

            def _pass_on(self) -> None:
                body = self.rfile.read(int(self.headers.get("Content-Length") or 0))
                with lock:
                    how = draw.choice(_HOW) if draw.random() < share else "not at all"
                    proxy.spoilt[how] += 1
                if how == "cut off":
                    self.close_connection = True
                    return
                if how == "503":
                    self._answer(503, {}, b"")
                    return
                if how == "late":
                    time.sleep(1.0)  # what is measured; nothing is waited for
                upstream = http.client.HTTPConnection("127.0.0.1", port, timeout=60)
                try:
                    headers = {k: v for k, v in self.headers.items() if k.lower() != "host"}
                    headers["Host"] = self.headers["Host"]
                    upstream.request(self.command, self.path, body, headers)
                    answer = upstream.getresponse()
                    content = answer.read()
                finally:
                    upstream.close()
                if how == "no answer":  # it was done all the same
                    self.close_connection = True
                    return
                self._answer(answer.status, dict(answer.getheaders()), content)

            def _answer(self, status: int, headers: Mapping[str, str], content: bytes) -> None:
                self.send_response_only(status)
                length = str(len(content))
                for name, value in headers.items():
                    if name.lower() == "content-length":
                        length = value if self.command == "HEAD" else length
                    elif name.lower() not in ("transfer-encoding", "connection"):
                        self.send_header(name, value)
                self.send_header("Content-Length", length)
                self.end_headers()
                if self.command != "HEAD":
                    self.wfile.write(content)

            do_GET = do_PUT = do_POST = do_DELETE = do_HEAD = _pass_on  # noqa: N815

            def log_message(self, format: str, *args: object) -> None:
                """Say nothing."""

        class Server(ThreadingHTTPServer):
            daemon_threads = True

            def handle_error(self, request: Any, client_address: Any) -> None:
                """Killed clients leave connections that break: what this is about."""

        self._server = Server(("127.0.0.1", 0), Handler)
        self.url = f"http://127.0.0.1:{self._server.server_port}"

    @contextmanager
    def serving(self) -> Iterator[None]:
        """A stretch in which it answers."""
        thread = threading.Thread(target=self._server.serve_forever, daemon=True)
        thread.start()
        try:
            yield
        finally:
            self._server.shutdown()
            self._server.server_close()
            thread.join()


_HOW = ("503", "503", "503", "cut off", "no answer", "late")


def measure_chaos(
    episodes: int = 60,
    workers: int = 4,
    seed: int = 1,
    every_s: float = 12.0,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Verdict:
    """Record under faults until all is there, then compare.

    Args:
        episodes: short ones, of half a second.
        workers: of the run.
        seed: of the faults.
        every_s: mean time between two kills.
        progress: called with the episodes committed and their number.
    """
    killed: Counter[str] = Counter()
    codes: list[int] = []
    began_s = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="carstage-chaos-") as name:
        scratch = Path(name)
        config = scratch / "config.yaml"
        config.write_text(_CONFIG.format(episodes=episodes))
        with s3_server(scratch / "server") as (bucket, environment), _set(environment):
            address, work = f"{bucket}/chaos", scratch / "work"
            proxy = FlakyProxy(int(environment["AWS_ENDPOINT_URL"].rpartition(":")[2]), seed, 0.03)
            spoiling = {**environment, "AWS_ENDPOINT_URL": proxy.url}
            words = ["run", str(config), "--out", address, "--work", str(work), "--json"]
            words += ["--workers", str(workers), "--retries", "5"]
            draw = random.Random(seed)
            with proxy.serving():
                while len(codes) < _MOST_RUNS and (not codes or codes[-1]):
                    codes.append(
                        _disturbed(words, spoiling, scratch / "run.log", draw, every_s, killed)
                    )
                    progress(len(open_store(address).committed()), episodes)
            output = (scratch / "run.log").read_text("utf-8", "replace")
            done_s = time.monotonic() - began_s
            collected = run_carstage("catalog", "gc", address, "--yes", environment=environment)
            figures = _compare(address, config, scratch)
    notes = [f"killed: {dict(killed)}", f"answers spoilt: {dict(proxy.spoilt)}"]
    notes += [f"exit codes of the runs: {codes}", f"catalog gc: {collected[-300:].strip()}"]
    if codes[-1]:
        notes.append(output[-1000:])
    return Verdict(
        "chaos",
        (
            Figure("committed_episodes", figures["committed"], "==", episodes),
            Figure("kills", killed.total(), ">=", 1),
            Figure("answers_spoilt", proxy.spoilt.total() - proxy.spoilt["not at all"], ">=", 1),
            Figure("runs_of_the_command", len(codes)),
            Figure("last_exit_code", codes[-1], "==", 0),
            Figure("files_read_and_compared", figures["files"], ">=", 1),
            Figure("files_that_differ", figures["differ"], "==", 0),
            Figure("episodes_that_differ_from_an_undisturbed_run", figures["others"], "==", 0),
            Figure("objects_of_no_episode_after_gc", figures["orphans"], "==", 0),
            Figure("minutes", done_s / 60),
        ),
        notes,
    )


def _disturbed(
    words: list[str],
    environment: Mapping[str, str],
    log: Path,
    draw: random.Random,
    every_s: float,
    killed: Counter[str],
) -> int:
    """Run a command to its end while its processes are killed; its exit code."""
    with log.open("wb") as output:
        process = psutil.Popen(
            [sys.executable, "-m", "carstage.cli", *words],
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=subprocess.STDOUT,
            env={**os.environ, **environment},
            start_new_session=True,
        )
    deadline_s = time.monotonic() + _RUN_S
    while time.monotonic() < deadline_s:
        try:
            return int(process.wait(draw.uniform(0.5, 1.5) * every_s))
        except psutil.TimeoutExpired:
            _kill_one(process, draw, killed)
    process.kill()
    return int(process.wait())


def _kill_one(process: psutil.Process, draw: random.Random, killed: Counter[str]) -> None:
    """Kill a process of the run, of each kind as probably; seldom the run itself."""
    by_kind: dict[str, list[psutil.Process]] = {}
    with suppress(psutil.Error):
        for child in process.children(recursive=True):
            with suppress(psutil.Error):
                by_kind.setdefault(_kind(child), []).append(child)
    kinds = sorted(by_kind)
    if not kinds or draw.random() < 0.1:
        killed["run"] += 1
        process.kill()
        return
    kind = draw.choice(kinds)
    with suppress(psutil.Error):
        draw.choice(sorted(by_kind[kind], key=lambda child: child.pid)).kill()
        killed[kind] += 1


def _kind(process: psutil.Process) -> str:
    text = " ".join(process.cmdline())
    for kind, sign in (
        ("server", "carstage_sim"),
        ("collector", "carstage.collector"),
        ("worker", "slot"),
        ("converter", "carstage.conversion"),
    ):
        if sign in text:
            return kind
    return "another"


def _compare(address: str, config: Path, scratch: Path) -> dict[str, int]:
    """What of the dataset is not as it should be."""
    files = remote_files(address)
    markers = open_store(address).committed()
    found: Counter[str] = Counter(committed=len(markers))
    listed = set()
    for marker in markers.values():
        prefix = f"episodes/{marker.episode_id}/{marker.attempt}/"
        for entry in marker.files:
            listed.add(prefix + entry.path)
            found["files"] += 1
            content = files.read(prefix + entry.path)
            found["differ"] += hash_of(content, entry.hash) != entry.hash
    present = {one.key for one in files.below("episodes")}
    found["orphans"] = len(present - listed) + len(files.below("leases"))
    undisturbed = scratch / "undisturbed"
    few = ["--set", f"episodes={_COMPARED}"]
    run_carstage("run", str(config), "--out", str(undisturbed), *few)
    for episode_id, marker in open_store(undisturbed).committed().items():
        other = markers.get(episode_id)
        found["others"] += other is None or other.files != marker.files
    return {key: found[key] for key in ("committed", "files", "differ", "orphans", "others")}


@contextmanager
def _set(environment: Mapping[str, str]) -> Iterator[None]:
    """A stretch in which this process reaches the server itself."""
    before = dict(os.environ)
    os.environ.update(environment)
    remote_files.cache_clear()
    try:
        yield
    finally:
        os.environ.clear()
        os.environ.update(before)
        remote_files.cache_clear()
