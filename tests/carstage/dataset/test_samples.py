"""Frames one after the other and by index, in this process and in others."""

from __future__ import annotations

import multiprocessing
import pickle
import shutil
from pathlib import Path

import numpy as np
import pytest

import analytic_dataset
from analytic_dataset import attempt_of, edit_rows
from carstage.dataset import Dataset, Frame, FrameSamples, samples
from carstage.errors import BadInputError


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("samples")
    return analytic_dataset.make_dataset(folder / "out", folder)


def tell(frame: Frame) -> tuple[str, int, int, float]:
    """What a worker can send back: who, when, how many objects, how bright."""
    mean = float(frame.read("CAM_FRONT").mean())
    return frame.episode.id, frame.k, len(frame.objects), mean


def test_frames_follow_each_other_with_rows_and_data(folder: Path) -> None:
    dataset = Dataset(folder)
    (episode,) = dataset.episodes
    frames = list(dataset.iter_frames())
    assert [frame.k for frame in frames] == list(range(6))
    assert [frame.timestamp_s for frame in frames] == pytest.approx([k / 10 for k in range(6)])
    frame = frames[4]
    assert {50, 51, 60} < set(frame.objects)
    assert frame.has("CAM_LEFT")
    np.testing.assert_array_equal(frame.read("CAM_LEFT"), episode.sensor("CAM_LEFT").read(4))
    assert frame.ego is not None
    np.testing.assert_allclose(frame.world_from_ego[:3, 3], frame.ego["location"])


def test_tables_are_read_but_no_sensor_until_it_is_asked_for(folder: Path, tmp_path: Path) -> None:
    copy = Path(shutil.copytree(folder, tmp_path / "out"))
    shutil.rmtree(attempt_of(copy) / "sensors")
    assert sum(len(frame.objects) for frame in Dataset(copy).iter_frames()) == 30


def test_an_episode_is_found_by_its_id_and_an_unknown_one_refused(folder: Path) -> None:
    dataset = Dataset(folder)
    assert dataset.episode("0123456789abcdef") is dataset.episodes[0]
    with pytest.raises(BadInputError, match="0123456789abcdef"):
        dataset.episode("x")
    with pytest.raises(BadInputError, match="no episode x"):
        FrameSamples(folder, tell, episodes=["x"])
    with pytest.raises(BadInputError, match="no sensor 'CAM_BACK'"):
        FrameSamples(folder, tell, sensors=["CAM_BACK"])


def test_samples_have_a_length_and_are_read_by_index(folder: Path) -> None:
    found = FrameSamples(folder, tell)
    assert len(found) == 6
    assert found[2][:3] == ("0123456789abcdef", 2, 5)
    assert found[-1][1] == 5
    assert [sample[1] for sample in found] == list(range(6))  # type: ignore[attr-defined]
    with pytest.raises(IndexError):
        found[6]


def test_a_dataset_may_be_given_as_it_was_opened(folder: Path) -> None:
    found = FrameSamples(Dataset(folder), tell)
    assert [found[i] for i in range(len(found))] == [
        FrameSamples(folder, tell)[i] for i in range(6)
    ]
    assert pickle.loads(pickle.dumps(found))[2] == found[2]


def test_frames_that_a_wanted_sensor_lacks_are_left_out(folder: Path, tmp_path: Path) -> None:
    copy = Path(shutil.copytree(folder, tmp_path / "out"))

    def lose(rows: list[dict[str, object]]) -> list[dict[str, object]]:
        rows[2]["CAM_LEFT.state"] = "missing"
        return rows

    edit_rows(copy, "frames.parquet", lose)
    assert len(FrameSamples(copy, tell, sensors=["CAM_FRONT"])) == 6
    lacking = FrameSamples(copy, tell, sensors=["CAM_FRONT", "CAM_LEFT"])
    assert [lacking.frame(i).k for i in range(len(lacking))] == [0, 1, 3, 4, 5]


def test_only_the_index_travels_to_other_processes(folder: Path) -> None:
    found = FrameSamples(folder, tell)
    before = len(pickle.dumps(found))
    here = [found[i] for i in range(len(found))]
    assert len(pickle.dumps(found)) == before
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        assert pool.map(found.__getitem__, range(len(found))) == here


def test_tables_of_few_episodes_are_kept_open(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(samples, "_OPEN_EPISODES", 0)
    found = FrameSamples(folder, tell)
    assert found[0] == found[0]
    assert len(found._open) == 0
