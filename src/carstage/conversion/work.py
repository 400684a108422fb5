"""The work of the pool's processes, by functions that load what it needs when they are called.

Who hands the work out names it by them, and has to load none of that: half a second of a process.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from carstage.conversion.encoded import EncodedSegment
from carstage.conversion.sensors import RecordedSensor
from carstage.conversion.town import Town
from carstage.lazy import keep_pandas_lazy
from carstage.storage.attempt_files import AttemptFiles


def encode_segment(
    raw_folder: Path,
    attempt_files: AttemptFiles,
    sensor: RecordedSensor,
    segment: int,
    agent: str | None,
) -> EncodedSegment:
    """See ``carstage.conversion.segment.encode_segment``."""
    from carstage.conversion import segment as loaded

    keep_pandas_lazy()
    return loaded.encode_segment(raw_folder, attempt_files, sensor, segment, agent)


def label_segment(
    raw_folder: Path, attempt_files: AttemptFiles, segment: int, agent: str | None
) -> EncodedSegment:
    """See ``carstage.conversion.segment.label_segment``."""
    from carstage.conversion import segment as loaded

    keep_pandas_lazy()
    return loaded.label_segment(raw_folder, attempt_files, segment, agent)


def place_voxels(
    raw_folder: Path, attempt_files: AttemptFiles, segment: int, segments: int, agent: str | None
) -> EncodedSegment:
    """See ``carstage.conversion.segment.place_voxels``."""
    from carstage.conversion import segment as loaded

    keep_pandas_lazy()
    return loaded.place_voxels(raw_folder, attempt_files, segment, segments, agent)


def write_episode(
    raw_folder: Path,
    attempt_files: AttemptFiles,
    codecs: Mapping[str, str],
    rows: Mapping[str, Sequence[dict[str, Any]]],
    opendrive: str | None,
    town: Town | None,
    agent: str | None,
) -> Town:
    """See ``carstage.conversion.whole_episode.write_episode``."""
    from carstage.conversion import whole_episode

    keep_pandas_lazy()
    return whole_episode.write_episode(
        raw_folder, attempt_files, codecs, rows, opendrive, town, agent
    )
