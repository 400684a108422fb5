"""What a picture costs from the raw log to a hashed file, against its encoder alone.

A camera of the embedded simulator is recorded once. Then its segment is converted as in a run
(read, encoded, written, hashed), and the same records are encoded in memory by the same codec, in
turns. Both are CPU time of one thread of this process, so the ratio needs no scaling.
"""

from __future__ import annotations

import shutil
import statistics
import tempfile
import time
from collections.abc import Callable, Iterable
from pathlib import Path

from carstage.bench.episodes import (
    Progress,
    camera,
    looping_server,
    planned_episode,
    record_episode,
)
from carstage.bench.verdict import Figure, Verdict
from carstage.codecs import codec_for
from carstage.conversion.segment import encode_segment
from carstage.conversion.sensors import RecordedSensor
from carstage.files.hashing import hash_of
from carstage.rawlog.format import KIND_DATA
from carstage.rawlog.reader import EpisodeLog
from carstage.storage import FolderFiles

TARGET_RATIO = 1.25
_CAMERA = "CAM"
_LOOP = 4


def measure_conversion(
    *,
    frames: int = 24,
    rounds: int = 5,
    size: tuple[int, int] = (1280, 720),
    scratch: Path | None = None,
    progress: Progress = lambda done, total: None,
) -> Verdict:
    """Record, then convert and encode in turns.

    Args:
        frames: pictures per round.
        rounds: how often both are measured; medians count.
        size: of the pictures.
        scratch: where raw log and files go, on the disk that shall be measured.
        progress: called with the rounds done and their total number.
    """
    with tempfile.TemporaryDirectory(prefix="carstage-bench-", dir=scratch) as name:
        folder = Path(name)
        _record(folder, frames, size)
        return compare(folder / "raw", _CAMERA, folder / "files", rounds, progress)


def compare(raw: Path, camera_id: str, files: Path, rounds: int, progress: Progress) -> Verdict:
    """Convert and encode segment 0 of a colour camera, in turns.

    Args:
        raw: folder of the raw log.
        camera_id: the camera.
        files: folder that the files are written to, and removed from, in each round.
        rounds: how often.
        progress: called with the rounds done and their total number.
    """
    name, codec = codec_for("rgb")
    sensor = RecordedSensor(camera_id, "rgb", name)
    records = [
        (record.meta, memoryview(bytes(record.payload)))
        for record in EpisodeLog(raw).read_segment(camera_id, 0)
        if record.kind == KIND_DATA
    ]

    def encode() -> None:
        for meta, payload in records:
            codec.encode(meta, payload)

    def convert() -> None:
        encode_segment(raw, FolderFiles(files), sensor, 0)

    def contents() -> list[bytes]:
        return [path.read_bytes() for path in sorted(files.rglob("*.png"))]

    encode()  # buffers are made once
    encoding, whole, hashes = [], [], []
    written = 0
    for number in range(rounds):
        encoding.append(_cpu_ms(encode) / len(records))
        whole.append(_cpu_ms(convert) / len(records))
        made = contents()
        written = sum(len(content) for content in made)
        hashes.append(_cpu_ms(_hash, made) / len(made))
        shutil.rmtree(files)
        progress(number + 1, rounds)
    encoder_ms, conversion_ms = statistics.median(encoding), statistics.median(whole)
    return Verdict(
        "conversion",
        (
            Figure("frames", len(records)),
            Figure("rounds", rounds),
            Figure("kb_per_file", written / len(records) / 1e3),
            Figure("encoder_cpu_ms", encoder_ms),
            Figure("conversion_cpu_ms", conversion_ms),
            Figure("hash_cpu_ms", statistics.median(hashes)),
            Figure("conversion_of_encoder", conversion_ms / encoder_ms, "<=", TARGET_RATIO),
        ),
        (f"Codec {name}; conversion reads the log, encodes, writes the file and hashes it.",),
    )


def _hash(contents: Iterable[bytes]) -> None:
    for content in contents:
        hash_of(content)


def _cpu_ms(work: Callable[..., object], *arguments: object) -> float:
    began = time.process_time()
    work(*arguments)
    return 1e3 * (time.process_time() - began)


def _record(folder: Path, frames: int, size: tuple[int, int]) -> None:
    spec = planned_episode(
        {
            "fps": frames,  # one segment: a simulated second
            "duration_s": 1.0,
            "image_size": list(size),
            "vehicles": {"count": 10},
            "pedestrians": {"count": 0},
            "rig": {"sensors": [camera(_CAMERA)]},
        }
    )
    with looping_server(_LOOP) as endpoint:
        record_episode(spec, endpoint, folder)
