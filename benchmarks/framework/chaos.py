"""Many short episodes into an object store while everything breaks: each is there once, and whole.

Two commands fill one dataset at the same time, each with a share of the episodes, as two machines
would: one by processes, the other by the nodes of a Ray cluster. The dataset is in an S3 server
behind a proxy that refuses, delays, cuts off and forgets to answer some of the requests; what is
committed goes into a PostgreSQL. The database is restarted, a node is removed, and processes are
killed by chance, now and then a command itself. Each command is given again until it is done. Then
every committed file is read from the store and compared with its hash, after ``catalog gc`` nothing
else may be there, and the catalog, made again from the markers, has to agree.

Ray listens on all interfaces, so it is used only where this process may leave the network (root).
"""

from __future__ import annotations

import json
import os
import random
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path

import psutil

from benchmarks.framework.object_store import environment_set, s3_server
from benchmarks.framework.postgres_servers import (
    PostgresServer,
    debian_programs,
    running_postgres,
    wheel_programs,
)
from benchmarks.framework.ray_nodes import RayNodes, ray_nodes
from benchmarks.framework.recorded import run_carstage
from benchmarks.framework.spoiling_proxy import Spoil, SpoilingProxy, Spoilt
from benchmarks.loopback_only import enter
from carstage.bench.verdict import Figure, Verdict
from carstage.files.hashing import hash_of
from carstage.storage import open_store
from carstage.storage.remote_files import remote_files

_MOST_RUNS = 40
_RUN_S = 3600.0
_COMPARED = 3
_LOOK_S = 0.2
_RUN_SHARE, _RESTART_SHARE = 0.1, 0.1
"""Of the faults, how many are of a whole run, and how many of the database."""
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


_HOW = (
    *[Spoilt("answered", 503)] * 3,
    Spoilt("cut off"),
    Spoilt("no answer"),
    Spoilt("late"),
)
_SPOILT_SHARE = 0.03


@dataclass
class _Share:
    """A command that records a share of the episodes, given again until it is done."""

    name: str
    words: list[str]
    environment: Mapping[str, str]
    log: Path
    codes: list[int] = field(default_factory=list)
    process: psutil.Popen | None = None

    @property
    def done(self) -> bool:
        return bool(self.codes) and (not self.codes[-1] or len(self.codes) >= _MOST_RUNS)

    def go_on(self) -> None:
        """Take note of its end, and start it again unless it is done."""
        if self.process is not None and self.process.poll() is not None:
            self.codes.append(int(self.process.returncode))
            self.process = None
        if self.process is None and not self.done:
            with self.log.open("wb") as output:
                self.process = psutil.Popen(
                    [sys.executable, "-m", "carstage.cli", *self.words],
                    stdin=subprocess.DEVNULL,
                    stdout=output,
                    stderr=subprocess.STDOUT,
                    env={**os.environ, **self.environment},
                    start_new_session=True,
                )

    @property
    def last_words(self) -> str:
        """The end of what it said last."""
        return self.log.read_text("utf-8", "replace")[-1000:]

    def end(self) -> None:
        """Kill it where it still runs."""
        if self.process is not None:
            self.process.kill()
            self.process.wait()


class _Chaos:
    """What goes wrong, drawn by chance; the database and the node come first."""

    def __init__(
        self, shares: Sequence[_Share], database: PostgresServer, nodes: RayNodes | None, seed: int
    ) -> None:
        self._shares = shares
        self._database = database
        self._nodes = nodes
        self._draw = random.Random(seed)
        self._first = deque([self._restart, *([self._remove_node] if nodes else [])])
        self.done: Counter[str] = Counter()

    def pause_s(self, mean_s: float) -> float:
        """Seconds until the next fault."""
        return self._draw.uniform(0.5, 1.5) * mean_s

    def strike(self) -> None:
        """Let one thing go wrong."""
        if self._first:
            self._first.popleft()()
        elif self._draw.random() < _RESTART_SHARE:
            self._restart()
        else:
            self._kill()

    def _restart(self) -> None:
        self._database.stop()
        self._database.start()
        self.done["database restarted"] += 1

    def _remove_node(self) -> None:
        if self._nodes is not None:
            self._nodes.remove()
            self.done["Ray node removed"] += 1

    def _kill(self) -> None:
        """Kill a process of a run, of each kind as probably; seldom a run itself."""
        running: list[psutil.Process] = [one.process for one in self._shares if one.process]
        found = [] if self._nodes is None else self._nodes.processes()
        for process in running:
            with suppress(psutil.Error):
                found += process.children(recursive=True)
        by_kind: dict[str, list[psutil.Process]] = {}
        for one in found:
            with suppress(psutil.Error):
                if kind := _kind(one):
                    by_kind.setdefault(kind, []).append(one)
        if by_kind and running and self._draw.random() < _RUN_SHARE:
            by_kind = {"run": running}
        if by_kind:
            kind = self._draw.choice(sorted(by_kind))
            with suppress(psutil.Error):
                self._draw.choice(sorted(by_kind[kind], key=lambda one: one.pid)).kill()
                self.done[kind] += 1


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
        workers: of both commands together.
        seed: of the faults.
        every_s: mean time between two faults.
        progress: called with the episodes committed and their number.
    """
    without_ray = _leave_the_network()
    began_s = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="carstage-chaos-") as name, ExitStack() as stack:
        scratch = Path(name)
        config = scratch / "config.yaml"
        config.write_text(_CONFIG.format(episodes=episodes))
        bucket, environment = stack.enter_context(s3_server(scratch / "server"))
        stack.enter_context(environment_set(environment))
        database = stack.enter_context(running_postgres(_postgres_programs()))
        catalog = {"CARSTAGE_CATALOG": database.good_address}
        port = int(environment["AWS_ENDPOINT_URL"].rpartition(":")[2])
        proxy = stack.enter_context(SpoilingProxy(port, _flaky(seed)).serving())
        spoiling = {**environment, "AWS_ENDPOINT_URL": proxy.url, **catalog}
        each = max(1, workers // 2)
        nodes = None
        if not without_ray:
            # One more than workers: a node is removed.
            nodes = stack.enter_context(ray_nodes(each + 1, spoiling, scratch))
        address = f"{bucket}/chaos"
        shares = [
            _share(number, config, address, each, spoiling, nodes if number == 2 else None)
            for number in (1, 2)
        ]
        chaos = _Chaos(shares, database, nodes, seed)

        def count() -> int:
            committed = _committed(address)
            progress(committed, episodes)
            return committed

        _go_through(shares, chaos, every_s, count)
        done_s = time.monotonic() - began_s
        collected = run_carstage("catalog", "gc", address, "--yes", environment=environment)
        figures = _compare(address, config, scratch)
        in_catalog = _compare_catalog(address, catalog)
        words = [one.last_words for one in shares if one.codes[-1:] != [0]]
    notes = [f"faults: {dict(chaos.done)}", f"answers spoilt: {dict(proxy.spoilt)}"]
    notes += [f"exit codes of {one.name}: {one.codes}" for one in shares]
    notes += [f"catalog gc: {collected[-300:].strip()}", without_ray or "with a Ray cluster"]
    notes += words
    spoilt = proxy.spoilt.total() - proxy.spoilt["not at all"]
    found = _figures(episodes, figures, in_catalog, shares, chaos, spoilt, done_s)
    return Verdict("chaos", found, notes)


def _flaky(seed: int) -> Spoil:
    """Spoils some requests, drawn by chance."""
    draw = random.Random(seed)

    def spoil(method: str, path: str) -> Spoilt | None:
        del method, path
        return draw.choice(_HOW) if draw.random() < _SPOILT_SHARE else None

    return spoil


def _share(
    number: int,
    config: Path,
    address: str,
    workers: int,
    environment: Mapping[str, str],
    nodes: RayNodes | None,
) -> _Share:
    work = config.parent / f"work-{number}"
    words = ["run", str(config), "--out", address, "--work", str(work), "--json"]
    words += ["--workers", str(workers), "--retries", "5", "--shard", f"{number}/2"]
    if nodes is not None:
        words += ["--ray-address", nodes.address]
        environment = {**environment, **nodes.variables}
    name = "processes" if nodes is None else "Ray"
    return _Share(f"share {number} ({name})", words, environment, config.parent / f"{number}.log")


def _go_through(
    shares: Sequence[_Share], chaos: _Chaos, every_s: float, progress: Callable[[], int]
) -> None:
    """Give the commands again and again, and let things go wrong, until all are done.

    Faults become rarer while nothing is committed: on a busy machine an episode may take longer
    than the time between two of them.
    """
    pause, deadline_s = threading.Event(), time.monotonic() + _RUN_S
    next_s = time.monotonic() + chaos.pause_s(every_s)
    done, rarer = 0, 1.0
    try:
        while not all(one.done for one in shares) and time.monotonic() < deadline_s:
            for one in shares:
                one.go_on()
            if time.monotonic() >= next_s:
                chaos.strike()
                before, done = done, progress()
                rarer = 1.0 if done > before else 1.5 * rarer
                next_s = time.monotonic() + rarer * chaos.pause_s(every_s)
            pause.wait(_LOOK_S)
        progress()
    finally:
        for one in shares:
            one.end()


def _leave_the_network() -> str:
    """Enter a network of this process alone; else why there is none, and so no Ray."""
    if find_spec("ray") is None:
        return "without Ray, which is not installed: pip install 'carstage[ray]'"
    try:
        enter()
    except OSError as error:
        return f"without Ray, which needs a network namespace (root): {error.strerror}"
    return ""


def _postgres_programs() -> Path:
    programs = debian_programs() or wheel_programs()
    if programs is None:
        raise RuntimeError("There is no PostgreSQL; is the dev extra installed?")
    return programs


def _committed(address: str) -> int:
    return len(open_store(address).committed())


def _kind(process: psutil.Process) -> str:
    """What a process is of a run; empty where it is nothing of it, such as Ray's own."""
    text = " ".join(process.cmdline())
    for kind, sign in (
        ("server", "carstage_sim"),
        ("collector", "carstage.collector"),
        ("worker", "carstage.runs.slot"),
        ("actor", "ray::SlotActor"),
        ("converter", "carstage.conversion"),
    ):
        if sign in text:
            return kind
    return ""


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


def _compare_catalog(address: str, catalog: Mapping[str, str]) -> dict[str, int]:
    """In how many episodes the catalog differs from the dataset, before and after a rebuild."""
    found = {}
    for moment in ("before", "after"):
        if moment == "after":
            run_carstage("catalog", "rebuild", address, environment=catalog)
        ended = subprocess.run(
            [sys.executable, "-m", "carstage.cli", "catalog", "verify", address, "--json"],
            env={**os.environ, **catalog},
            capture_output=True,
            text=True,
        )
        try:
            found[moment] = len(json.loads(ended.stdout.splitlines()[-1])["differences"])
        except (IndexError, ValueError) as error:
            raise RuntimeError(ended.stderr[-2000:]) from error
    return found


def _figures(
    episodes: int,
    found: Mapping[str, int],
    in_catalog: Mapping[str, int],
    shares: Sequence[_Share],
    chaos: _Chaos,
    spoilt: int,
    done_s: float,
) -> tuple[Figure, ...]:
    done = chaos.done
    others = ("database restarted", "Ray node removed")
    return (
        Figure("committed_episodes", found["committed"], "==", episodes),
        Figure("processes_killed", done.total() - sum(done[one] for one in others)),
        Figure("database_restarts", done["database restarted"], ">=", 1),
        Figure("ray_nodes_removed", done["Ray node removed"]),
        Figure("answers_spoilt", spoilt, ">=", 1),
        Figure("times_the_commands_were_given", sum(len(one.codes) for one in shares)),
        Figure("commands_not_done", sum(one.codes[-1:] != [0] for one in shares), "==", 0),
        Figure("files_read_and_compared", found["files"], ">=", 1),
        Figure("files_that_differ", found["differ"], "==", 0),
        Figure("episodes_that_differ_from_an_undisturbed_run", found["others"], "==", 0),
        Figure("objects_of_no_episode_after_gc", found["orphans"], "==", 0),
        Figure("differences_of_the_catalog_before_rebuild", in_catalog["before"]),
        Figure("differences_of_the_catalog_after_rebuild", in_catalog["after"], "==", 0),
        Figure("minutes", done_s / 60),
    )
