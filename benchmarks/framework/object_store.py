"""What it costs to record into an object store instead of a folder.

The same episode is recorded in turn into a folder and into a local S3 server (LocalBucket, a
package of the ``dev`` extra). What counts is the time from the reservation of its attempt to its
commit. The server works on the same cores, as it would not in earnest.

One more episode is recorded and validated through a proxy that counts requests, and all its objects
are read one after the other and many at a time: whether many small objects hurt.
"""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from pathlib import Path

from benchmarks.framework.recorded import run_carstage
from benchmarks.framework.spoiling_proxy import SpoilingProxy
from carstage.bench.verdict import Figure, Verdict
from carstage.server.ports import free_port
from carstage.storage.remote_files import remote_files

MOST_RATIO = 1.15
_START_S = 30.0
_READERS = 16
_FPS = 10
_KINDS = ("PUT", "GET", "HEAD", "LIST", "DELETE", "POST")
_CONFIG = """\
name: object store
seed: 4
duration_s: {seconds}
fps: 10
vehicles: {{count: 5}}
pedestrians: {{count: 5}}
image_size: [640, 360]
server: {{kind: embedded, self_test: "off"}}
rig:
  sensors:
    - {{id: CAM_LEFT, kind: rgb, pose: {{x: 1.0, y: -0.4, z: 1.6, yaw_deg: -60}}}}
    - {{id: CAM_FRONT, kind: rgb, pose: {{x: 1.5, z: 1.6}}}}
    - {{id: CAM_RIGHT, kind: rgb, pose: {{x: 1.0, y: 0.4, z: 1.6, yaw_deg: 60}}}}
"""


@contextmanager
def s3_server(folder: Path) -> Iterator[tuple[str, dict[str, str]]]:
    """A local S3 server; gives the address of its bucket, and the environment of its clients.

    Raises:
        RuntimeError: it does not start.
    """
    (folder / "bucket").mkdir(parents=True)
    port = free_port()
    url = f"http://127.0.0.1:{port}"
    program = [sys.executable, "-m", "localbucket", "--port", str(port), str(folder)]
    null = subprocess.DEVNULL
    server = subprocess.Popen(program, stdin=null, stdout=null, stderr=null)
    try:
        deadline_s = time.monotonic() + _START_S
        while True:
            with suppress(OSError):
                urllib.request.urlopen(url, timeout=5).close()
                break
            if server.poll() is not None or time.monotonic() > deadline_s:
                raise RuntimeError("LocalBucket does not start; is the dev extra installed?")
            time.sleep(0.05)
        keys = {"AWS_ACCESS_KEY_ID": "user", "AWS_SECRET_ACCESS_KEY": "secret"}
        yield "s3://bucket", {"AWS_ENDPOINT_URL": url, "AWS_REGION": "us-east-1", **keys}
    finally:
        server.kill()
        server.wait()


def measure_object_store(
    rounds: int = 3,
    seconds: float = 5.0,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Verdict:
    """Record into a folder and into a store in turn.

    Args:
        rounds: episodes into each; 0: count requests and objects alone.
        seconds: simulated ones of an episode.
        progress: called with the episodes recorded and their total number.

    Raises:
        RuntimeError: a run failed; with the end of what it said.
    """
    spent_s: dict[str, list[float]] = {"folder": [], "store": []}
    with tempfile.TemporaryDirectory(prefix="carstage-object-store-") as name:
        scratch = Path(name)
        config = scratch / "config.yaml"
        config.write_text(_CONFIG.format(seconds=seconds))
        with s3_server(scratch / "server") as (bucket, environment):
            if rounds:
                _episode_s(config, str(scratch / "warm"), scratch / "warm", {})
            for number in range(rounds):
                folder = scratch / f"folder-{number}"
                spent_s["folder"].append(_episode_s(config, str(folder), folder, {}))
                work = scratch / f"work-{number}"
                address = f"{bucket}/{number}"
                spent_s["store"].append(_episode_s(config, address, work, environment))
                progress(2 * (number + 1), 2 * rounds)
            counted = _count_requests(config, scratch, bucket, environment)
    figures = [Figure("frames_of_an_episode", round(seconds * _FPS))]
    figures += [Figure(name, value) for name, value in counted.items()]
    if rounds:
        folder_s, store_s = (statistics.median(spent_s[where]) for where in ("folder", "store"))
        ratio = Figure("store_over_folder", store_s / folder_s, "<=", MOST_RATIO)
        figures = [Figure("folder_s", folder_s), Figure("store_s", store_s), ratio, *figures]
    return Verdict(
        "object-store",
        tuple(figures),
        [f"{where}: {', '.join(f'{s:.1f} s' for s in times)}" for where, times in spent_s.items()],
    )


def _episode_s(config: Path, out: str, work: Path, environment: Mapping[str, str]) -> float:
    """Seconds from the reservation of the episode's attempt to its commit."""
    words = ("run", str(config), "--out", out, "--work", str(work))
    run_carstage(*words, environment=environment)
    (events,) = work.glob("runs/*/events.jsonl")
    times = {e["event"]: e["time"] for e in map(json.loads, events.read_text().splitlines())}
    return float(times["episode_committed"] - times["attempt_reserved"])


def _count_requests(
    config: Path, scratch: Path, bucket: str, environment: Mapping[str, str]
) -> dict[str, float]:
    """What one episode has in objects, and what recording and reading it asks of the store."""
    kinds: Counter[str] = Counter()

    def count(method: str, path: str) -> None:
        kinds["LIST" if "list-type=" in path else method] += 1

    port = int(environment["AWS_ENDPOINT_URL"].rpartition(":")[2])
    address, found = f"{bucket}/counted", dict[str, float]()
    with SpoilingProxy(port, count).serving() as proxy:
        through = {**environment, "AWS_ENDPOINT_URL": proxy.url}
        _episode_s(config, address, scratch / "counted", through)
        found |= {f"{kind}_requests_to_record": kinds[kind] for kind in _KINDS}
        kinds.clear()
        cache = {"CARSTAGE_CACHE_DIR": str(scratch / "cold")}
        run_carstage("validate", address, environment={**through, **cache})
        found["requests_to_validate"] = kinds.total()
    with environment_set(environment):
        files = remote_files(address)
        objects = files.below("episodes")
        found["objects_of_an_episode"] = len(objects)
        found["bytes_of_the_median_object"] = statistics.median(one.bytes for one in objects)
        keys = [one.key for one in objects]
        for readers in (1, _READERS):
            begun_s = time.monotonic()
            with ThreadPoolExecutor(readers) as threads:
                size = sum(map(len, threads.map(files.read, keys)))
            spent_s = time.monotonic() - begun_s
            assert size == sum(one.bytes for one in objects)
            found[f"ms_to_read_an_object_{readers}_at_a_time"] = spent_s / len(keys) * 1e3
        begun_s = time.monotonic()
        files.below("episodes")
        found["ms_to_list_them"] = (time.monotonic() - begun_s) * 1e3
    return found


@contextmanager
def environment_set(environment: Mapping[str, str]) -> Iterator[None]:
    """A stretch in which this process has some variables, and reaches stores by them."""
    before = dict(os.environ)
    os.environ.update(environment)
    remote_files.cache_clear()
    try:
        yield
    finally:
        os.environ.clear()
        os.environ.update(before)
        remote_files.cache_clear()
