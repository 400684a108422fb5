"""What each encoder costs on the same frames, and how large its files are.

A camera of each kind and a LiDAR of the embedded simulator are recorded once, colours with the
noise of a camera. Then every codec of a dataset encodes the same records in memory, one after the
other in each round, and so do Pillow and OpenCV with their defaults. CPU time of one thread.
"""

from __future__ import annotations

import io
import statistics
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from carstage.bench.episodes import (
    Progress,
    camera,
    looping_server,
    planned_episode,
    record_episode,
    roof_sensor,
)
from carstage.bench.verdict import Figure, Verdict
from carstage.codecs import codec_for, codec_names
from carstage.codecs.codec import image_bgra
from carstage.errors import BadInputError
from carstage.rawlog.format import KIND_DATA
from carstage.rawlog.reader import EpisodeLog

KINDS = ("rgb", "depth", "semantic", "instance", "lidar")
_FRAMES = 3
_NOISE = 4.0
_PICTURES = ("rgb", "instance")

Record = tuple[Mapping[str, Any], memoryview]
Encode = Callable[[Mapping[str, Any], memoryview], Sequence[bytes | memoryview]]


def measure_codecs(
    *,
    rounds: int = 7,
    size: tuple[int, int] = (1280, 720),
    progress: Progress = lambda done, total: None,
) -> Verdict:
    """Record, then let every encoder take turns.

    Args:
        rounds: how often each encodes all records; medians count.
        size: of the pictures.
        progress: called with the encoders done and their total number.
    """
    with tempfile.TemporaryDirectory(prefix="carstage-bench-") as name:
        records = _record(Path(name), size)
    figures: list[Figure] = []
    notes = [f"Milliseconds of CPU per frame of one thread, {size[0]}x{size[1]}, median of rounds."]
    encoders = {kind: _encoders(kind, notes) for kind in KINDS}
    total = sum(len(one) for one in encoders.values())
    done = 0
    for kind, candidates in encoders.items():
        raw_mb = statistics.mean(payload.nbytes for _, payload in records[kind]) / 1e6
        figures.append(Figure(f"{kind}: raw, MB", raw_mb))
        times: dict[str, list[float]] = {name: [] for name in candidates}
        sizes: dict[str, int] = {}
        for number in range(rounds + 1):
            for name, encode in candidates.items():
                began = time.process_time()
                sizes[name] = sum(_length(encode(*record)) for record in records[kind])
                if number:  # buffers are made in the first round
                    times[name].append(1e3 * (time.process_time() - began) / _FRAMES)
        for name in candidates:
            figures.append(Figure(f"{kind}: {name}, ms", statistics.median(times[name])))
            figures.append(Figure(f"{kind}: {name}, MB", sizes[name] / _FRAMES / 1e6))
            done += 1
            progress(done, total)
    return Verdict("codecs", tuple(figures), notes, "carstage bench codecs --json")


def _length(contents: Sequence[bytes | memoryview]) -> int:
    return sum(len(content) for content in contents)


def _encoders(kind: str, notes: list[str]) -> dict[str, Encode]:
    """Every codec of a kind, and for pictures what others use."""
    found: dict[str, Encode] = {}
    for name in codec_names(kind):
        try:
            found[name] = codec_for(kind, name)[1].encode
        except BadInputError as error:
            notes.append(f"{kind}: {name} was left out: {error}")
    if kind in _PICTURES:
        found["Pillow PNG"] = _pillow
        try:
            found["OpenCV PNG"] = _opencv()
        except ImportError:
            notes.append(f"{kind}: OpenCV was left out; install the extra `bench`.")
    return found


def _pillow(meta: Mapping[str, Any], payload: memoryview) -> Sequence[bytes]:
    buffer = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(image_bgra(meta, payload)[..., 2::-1])).save(buffer, "PNG")
    return (buffer.getvalue(),)


def _opencv() -> Encode:
    import cv2

    def encode(meta: Mapping[str, Any], payload: memoryview) -> Sequence[bytes]:
        pixels = np.ascontiguousarray(image_bgra(meta, payload)[..., :3])
        return (cv2.imencode(".png", pixels)[1].tobytes(),)

    return encode


def _record(folder: Path, size: tuple[int, int]) -> dict[str, list[Record]]:
    lidar = {"points_per_second": 100_000 * _FRAMES, "channels": 64, "upper_fov_deg": -2.0}
    sensors = [camera(kind, kind) for kind in KINDS if kind != "lidar"]
    spec = planned_episode(
        {
            "fps": _FRAMES,  # one segment: a simulated second
            "duration_s": 1.0,
            "image_size": list(size),
            "vehicles": {"count": 10},
            "pedestrians": {"count": 0},
            "rig": {"sensors": [*sensors, roof_sensor("lidar", "lidar", **lidar)]},
        }
    )
    arguments = ("--loop-noise", str(_NOISE))
    with looping_server(_FRAMES, arguments) as endpoint:
        record_episode(spec, endpoint, folder)
    log = EpisodeLog(folder / "raw")
    return {
        kind: [
            (record.meta, memoryview(bytes(record.payload)))
            for record in log.read_segment(kind, 0)
            if record.kind == KIND_DATA
        ]
        for kind in KINDS
    }
