"""What hashing costs by BLAKE3, against the SHA-256 that it replaced.

The replaced code (SHA-256 of several files side by side, compiled by LLVM) is taken from the
history of this repository, so both are measured in one process, in turns, with ``hashlib`` as a
third. Then a recorded camera and LiDAR are converted by both versions of the package, in turns.
Where the history is not there, the figures against ``hashlib`` remain.
"""

from __future__ import annotations

import io
import json
import os
import statistics
import subprocess
import sys
import tarfile
import tempfile
from pathlib import Path

from carstage.bench.episodes import camera, looping_server, planned_episode, record_episode
from carstage.bench.verdict import Figure, Verdict

BEFORE = "2c945e6"
"""The last commit of version 0.1 that has the replaced code."""
_ROOT = Path(__file__).resolve().parents[2]
_CONTENTS = {
    "labels_4_kb": (4_000, 512),
    "png_100_kb": (100_000, 64),
    "png_1_mb": (1_000_000, 16),
    "lidar_1600_kb": (1_600_000, 16),
}
"""Sizes of files as recordings have them, and how many are hashed in a round."""
_JUDGED_FROM_BYTES = 100_000
"""Of smaller files a hash takes some microseconds either way."""

_HASH = """
import hashlib, json, os, statistics, sys, time
from blake3 import blake3

contents, rounds = json.loads(sys.argv[1]), int(sys.argv[2])


def plain(of):
    return lambda files: [of(file).hexdigest() for file in files]


ways = {"blake3": plain(blake3), "hashlib": plain(hashlib.sha256)}
try:
    from carstage.files.digests import hashed_at_once, load_digests, sha256_of_each
except ImportError:
    pass
else:
    load_digests()
    step = hashed_at_once()
    ways["before"] = lambda files: [
        digest
        for first in range(0, len(files), step)
        for digest in sha256_of_each(files[first : first + step])
    ]
found = {}
for name, (size, number) in contents.items():
    files = [os.urandom(size) for _ in range(number)]
    spent = {way: [] for way in ways}
    for _ in range(rounds):
        for way, hashes in ways.items():
            began = time.process_time()
            hashes(files)
            spent[way].append(1e6 * (time.process_time() - began) / number)
    found[name] = {way: statistics.median(times) for way, times in spent.items()}
print(json.dumps(found))
"""

_CONVERT = """
import json, shutil, sys, time
from pathlib import Path
from carstage.conversion.segment import encode_segment
from carstage.conversion.sensors import RecordedSensor

raw, files, repeats = Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3])
try:
    from carstage.storage import FolderFiles as into
except ImportError:  # of a version before
    into = Path
try:
    from carstage.conversion.libraries import import_libraries
except ImportError:  # of a version before
    from carstage.conversion.pool import import_libraries
import_libraries(pictures=True)
sensors = [RecordedSensor("CAM", "rgb", "png"), RecordedSensor("LIDAR", "lidar", "bin")]
for repeat in range(1 + repeats):  # the first one warms up
    if repeat == 1:
        began = time.process_time()
    for sensor in sensors:
        encode_segment(raw, into(files), sensor, 0)
spent = time.process_time() - began
print(json.dumps(1e3 * spent / repeats / len(list(files.rglob("*.*")))))
shutil.rmtree(files)
"""


def measure_hashing(rounds: int = 7, frames: int = 20, repeats: int = 3) -> Verdict:
    """Hash contents of several sizes, and convert a recording, by the old and the new code.

    Args:
        rounds: how often each is measured; medians count.
        frames: of the recording.
        repeats: conversions of the recording per process and round.
    """
    figures: list[Figure] = []
    notes = ["CPU time; random contents. hashlib is OpenSSL's SHA-256."]
    with tempfile.TemporaryDirectory(prefix="carstage-bench-") as name:
        folder = Path(name)
        before = _source_of(BEFORE, folder / "before")
        found = json.loads(_python(_HASH, before, json.dumps(_CONTENTS), str(7 * rounds)))
        for contents, spent in found.items():
            best_us = spent.get("before", spent["hashlib"])
            figures += [Figure(f"{contents}_{way}_cpu_us", value) for way, value in spent.items()]
            ratio = spent["blake3"] / best_us
            target = 1 if _CONTENTS[contents][0] >= _JUDGED_FROM_BYTES else None
            figures.append(Figure(f"{contents}_blake3_of_before", ratio, "<=", target))
        if before is None:
            notes.append(f"Commit {BEFORE} is not in this clone: hashlib stands for the old code.")
        else:
            notes.append(f"'before' is the code of commit {BEFORE}.")
            figures += _conversions(folder, before, rounds, frames, repeats)
    return Verdict("hashing", tuple(figures), tuple(notes))


def _conversions(
    folder: Path, before: Path, rounds: int, frames: int, repeats: int
) -> list[Figure]:
    """CPU time of a converted file by both versions, in turns."""
    _record(folder, frames)
    spent: dict[str, list[float]] = {"before": [], "after": []}
    arguments = (str(folder / "raw"), str(folder / "files"), str(repeats))
    for number in range(rounds):
        ways = [("before", before), ("after", _ROOT / "src")]
        for way, source in ways if number % 2 else reversed(ways):
            spent[way].append(json.loads(_python(_CONVERT, source, *arguments)))
    ratios = [new / old for old, new in zip(spent["before"], spent["after"], strict=True)]
    return [
        *(Figure(f"conversion_{way}_cpu_ms", statistics.median(spent[way])) for way in spent),
        Figure("conversion_after_of_before", statistics.median(ratios), "<=", 1),
    ]


def _source_of(commit: str, folder: Path) -> Path | None:
    """The package's source at a commit; None where the history does not have it."""
    command = ["git", "-C", str(_ROOT), "archive", commit, "src"]
    ended = subprocess.run(command, capture_output=True, check=False)
    if ended.returncode:
        return None
    with tarfile.open(fileobj=io.BytesIO(ended.stdout)) as archive:
        archive.extractall(folder, filter="data")
    return folder / "src"


def _python(program: str, source: Path | None, *arguments: str) -> str:
    """What a program prints that imports the package from a folder."""
    environment = {**os.environ, "NUMBA_NUM_THREADS": "1"}
    if source is not None:
        environment["PYTHONPATH"] = str(source)
    ended = subprocess.run(
        [sys.executable, "-c", program, *arguments],
        env=environment,
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    )
    return ended.stdout


def _record(folder: Path, frames: int) -> None:
    spec = planned_episode(
        {
            "fps": frames,  # one segment: a simulated second
            "duration_s": 1.0,
            "image_size": [1280, 720],
            "vehicles": {"count": 10},
            "pedestrians": {"count": 0},
            "rig": {
                "sensors": [
                    camera("CAM"),
                    {
                        "id": "LIDAR",
                        "kind": "lidar",
                        "pose": {"z": 2.4},
                        "attributes": {"points_per_second": 100_000 * frames},
                    },
                ]
            },
        }
    )
    with looping_server(4) as endpoint:
        record_episode(spec, endpoint, folder)
