"""An attempt on its way into the dataset: when its recording is converted."""

from __future__ import annotations

import json
from concurrent.futures import BrokenExecutor, Executor, Future, ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

import analytic_scene
import small_maps
from carstage.dataset import Dataset, Episode
from carstage.errors import ConverterDiedError
from carstage.files.hashing import hash_of
from carstage.rawlog.reader import EpisodeLog
from carstage.rawlog.writing import write_episode_file, write_map_file
from carstage.runs.attempt_commit import AttemptCommit, Job
from carstage.storage.local import LocalStore


class Submitted(Executor):
    """A pool that notes what it is given and never does it."""

    def __init__(self) -> None:
        self.count = 0

    def submit(self, *_: Any, **__: Any) -> Future[Any]:
        self.count += 1
        return Future()


@pytest.mark.parametrize("deferred", [False, True])
def test_sealed_segments_are_converted_at_once_unless_that_is_deferred(
    tmp_path: Path, deferred: bool
) -> None:
    raw = tmp_path / "raw"
    analytic_scene.write_raw_log(raw)
    store, pool = LocalStore(tmp_path / "out"), Submitted()
    store.initialise("test")
    job: Any = Job(
        SimpleNamespace(saved_frames=6, agents=(), written_sensors=()), "0123456789abcdef"
    )
    attempt_commit = AttemptCommit(job, "a1", raw, store, pool, {}, deferred=deferred)
    log = EpisodeLog(raw)
    for stream in log.streams:
        for segment in log.sealed_segments(stream):
            attempt_commit.segment_sealed(stream, segment)
    while_recording = pool.count
    attempt_commit.convert_all(pool)
    assert (while_recording == 0) == deferred
    assert pool.count > 0
    assert pool.count == while_recording or deferred


class Broken(Executor):
    """A pool whose processes have died."""

    def submit(self, *_: Any, **__: Any) -> Future[Any]:
        raise BrokenExecutor


def test_recording_kept_for_the_end_is_converted_by_the_pool_of_then(tmp_path: Path) -> None:
    raw = tmp_path / "raw"
    analytic_scene.write_raw_log(raw)
    store = LocalStore(tmp_path / "out")
    store.initialise("test")
    job: Any = Job(
        SimpleNamespace(saved_frames=6, agents=(), written_sensors=()), "0123456789abcdef"
    )
    attempt_commit = AttemptCommit(job, "a1", raw, store, Broken(), {}, deferred=True)
    with pytest.raises(ConverterDiedError):
        attempt_commit.convert_all(Broken())
    pool = Submitted()
    attempt_commit.convert_all(pool)
    assert pool.count > 0


def test_commit_counts_the_frames_that_were_saved(tmp_path: Path) -> None:
    raw = tmp_path / "raw"
    analytic_scene.write_raw_log(raw)
    header = json.loads((raw / "episode.json").read_bytes())
    store = LocalStore(tmp_path / "out")
    store.initialise("test")
    job: Any = Job(
        SimpleNamespace(saved_frames=60, agents=(), written_sensors=()), header["episode_id"]
    )
    with ThreadPoolExecutor(1) as pool:
        attempt_commit = AttemptCommit(job, "a1", raw, store, pool, {}, deferred=True)
        attempt_commit.convert_all(pool)
        assert attempt_commit.commit() == 6
    assert store.committed()[header["episode_id"]].frames == 6


def _commit(raw: Path, store: LocalStore, episode_id: str) -> None:
    """Convert a raw log and commit it."""
    job: Any = Job(SimpleNamespace(saved_frames=6, agents=(), written_sensors=()), episode_id)
    with ThreadPoolExecutor(1) as pool:
        attempt_commit = AttemptCommit(job, "a1", raw, store, pool, {}, deferred=True)
        attempt_commit.convert_all(pool)
        attempt_commit.commit()


def test_the_town_s_text_is_kept_once_for_all_episodes(tmp_path: Path) -> None:
    store = LocalStore(tmp_path / "out")
    store.initialise("test")
    for attempt, episode_id in enumerate(["0123456789abcdef", "fedcba9876543210"]):
        raw = tmp_path / f"raw{attempt}"
        analytic_scene.write_raw_log(raw)
        _commit(raw, store, episode_id)
    (kept,) = (tmp_path / "out" / "maps").iterdir()
    assert kept.read_text() == analytic_scene.OPENDRIVE
    for episode in Dataset(tmp_path / "out").episodes:
        assert episode.opendrive() == analytic_scene.OPENDRIVE
        assert episode.map_file == kept
    assert f"blake3:{kept.stem}" == hash_of(analytic_scene.OPENDRIVE.encode())


def test_recording_without_the_town_s_text_makes_a_dataset_without_it(tmp_path: Path) -> None:
    """As all recordings of version 0.1 are."""
    raw = tmp_path / "raw"
    header = analytic_scene.write_raw_log(raw)
    (raw / "map.xodr").unlink()
    del header["map_crc32"]
    write_episode_file(str(raw), header)
    store = LocalStore(tmp_path / "out")
    store.initialise("test")
    _commit(raw, store, header["episode_id"])
    assert not (tmp_path / "out" / "maps").exists()
    assert Dataset(tmp_path / "out").episodes[0].opendrive() is None


def _committed(tmp_path: Path, opendrive: str, **labels: Any) -> Episode:
    """An episode of the analytic scene in a town of some text."""
    raw = tmp_path / "raw"
    header = analytic_scene.write_raw_log(raw)
    header["map_crc32"] = write_map_file(str(raw), opendrive)
    header["spec"]["labels"] = {**header["spec"].get("labels", {}), **labels}
    write_episode_file(str(raw), header)
    store = LocalStore(tmp_path / "out")
    store.initialise("test")
    _commit(raw, store, header["episode_id"])
    (episode,) = Dataset(tmp_path / "out").episodes
    return episode


def test_the_town_s_vector_map_is_kept_beside_its_text(tmp_path: Path) -> None:
    episode = _committed(tmp_path, small_maps.parking_street())
    town = episode.vector_map()
    assert town is not None
    assert {lane.type for lane in town.lanes} == {"driving", "parking", "sidewalk"}
    assert "vector_map_problem" not in episode.document
    assert {path.suffix for path in (tmp_path / "out" / "maps").iterdir()} == {".xodr", ".parquet"}


def test_a_vector_map_that_is_not_asked_for_is_not_made(tmp_path: Path) -> None:
    episode = _committed(tmp_path, small_maps.hill_road(), vector_map=False)
    assert episode.document["vector_map"] is None
    assert episode.vector_map() is None
    assert episode.opendrive() == small_maps.hill_road()


def test_a_text_that_is_no_map_costs_the_map_and_not_the_recording(tmp_path: Path) -> None:
    text = small_maps.one_road().replace("<line/>", "<bezier/>")
    episode = _committed(tmp_path, text)
    assert episode.vector_map() is None
    assert "road 1: a <geometry> has none of line" in episode.document["vector_map_problem"]
    assert episode.opendrive() == text
