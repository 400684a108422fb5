"""Grids of a recording: what they show, and that every edit of them is found."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import analytic_scene
import small_maps
from analytic_dataset import attempt_of, recommit
from carstage.birds_eye import BirdsEye, GridPose, layer_bit, pack_birds_eye, unpack_birds_eye
from carstage.birds_eye.visibility import CAMERA, LIDAR
from carstage.dataset import Dataset
from carstage.errors import DatasetError
from carstage.rawlog.writing import write_episode_file, write_map_file
from carstage.runs.attempt_commit import AttemptCommit
from carstage.runs.jobs import Job
from carstage.storage import LocalStore
from carstage.validation import validate_dataset

ASKED = {"length_m": 60.0, "width_m": 40.0, "resolution_m": 0.2}
FRAME = 2


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("grids")
    raw = folder / "raw"
    header = analytic_scene.write_raw_log(raw, steps=3, size=(192, 128), segmentation=True)
    header["map_crc32"] = write_map_file(str(raw), small_maps.parking_street())
    header["spec"]["labels"]["birds_eye"] = ASKED
    write_episode_file(str(raw), header)
    store = LocalStore(folder / "out")
    store.initialise("grids")
    job: Any = Job(
        SimpleNamespace(saved_frames=3, agents=(), written_sensors=()), header["episode_id"]
    )
    with ThreadPoolExecutor(1) as pool:
        attempt = AttemptCommit(job, "a1", raw, store, pool, {}, deferred=True)
        attempt.convert_all(pool)
        attempt.commit()
    return folder / "out"


@pytest.fixture
def dataset(whole: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(whole, tmp_path / "out"))


def found(dataset: Path) -> list[str]:
    checks = ("birds_eye", "file_missing", "file_unlisted", "file_unexpected", "unreadable")
    problems = validate_dataset(dataset).problems
    return [f"{one.check}: {one.message}" for one in problems if one.check in checks]


def test_grids_show_street_ego_cars_and_what_sensors_see(whole: Path) -> None:
    (episode,) = Dataset(whole).episodes
    content = episode.birds_eye(FRAME)
    assert content is not None
    assert content.grid.shape == (300, 200)
    row = episode.ego().to_pylist()[FRAME]
    assert [content.pose.x_m, content.pose.y_m, content.pose.z_m] == row["location"]
    assert content.pose.yaw_deg == row["rotation_deg"][1]
    assert content.layer("ego")[149:151, 99:101].all()
    objects = {one["track_id"]: one for one in episode.objects().to_pylist() if one["k"] == FRAME}
    centres = content.cell_centres()
    for track, velocity in zip(content.drawn.track_id, content.drawn.velocity_m_s, strict=True):
        one = objects[int(track)]
        middle = centres[content.tracks == track].mean(axis=0)
        assert middle == pytest.approx(one["box_center_ego"][:2], abs=0.15)
        assert velocity == pytest.approx(one["velocity_ego"][:2], abs=1e-4)
    assert {objects[int(one)]["class"] for one in content.drawn.track_id} == {
        "car", "truck", "walker_adult",
    }  # fmt: skip
    assert content.layer("parking").any()
    assert (content.visible_by_camera & content.layer("drivable_area")).sum() > 1000
    assert (content.visible_by_lidar & content.layer("truck")).any()
    assert not (content.visible_by_camera & content.layer("ego")).any()


def test_an_undamaged_dataset_has_the_grids_that_follow(whole: Path) -> None:
    assert found(whole) == []


def changed_bit(content: BirdsEye) -> None:
    content.drawn.semantic[10, 20] ^= np.uint32(layer_bit("sidewalk"))


def changed_instance(content: BirdsEye) -> None:
    content.drawn.instance[content.layer("car") & (content.drawn.instance > 0)] = 0


def changed_height(content: BirdsEye) -> None:
    content.drawn.height_cm[150, 100] += 1


def changed_velocity(content: BirdsEye) -> None:
    content.drawn.velocity_m_s[0, 1] += 0.01


def changed_track(content: BirdsEye) -> None:
    content.drawn.track_id[-1] += 1


def seen_behind(content: BirdsEye) -> None:
    content.drawn.visible[-1, 100] |= CAMERA


def hit_where_nothing_is(content: BirdsEye) -> None:
    content.drawn.visible[tuple(np.argwhere(~content.visible_by_lidar)[0])] |= LIDAR


def hit_that_is_lost(content: BirdsEye) -> None:
    content.drawn.visible[tuple(np.argwhere(content.visible_by_lidar)[0])] ^= LIDAR


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (changed_bit, "layer sidewalk is wrong in 1 cells, first in row 10, column 20"),
        (changed_instance, "the instance is wrong in"),
        (changed_height, "the height is wrong in 1 cells, first in row 150, column 100"),
        (changed_velocity, "a velocity is not that of its object"),
        (changed_track, "the tracks are not those of the objects in the grid"),
        (seen_behind, "visibility by camera is wrong in 1 cells"),
        (hit_where_nothing_is, "visibility by LiDAR is wrong in 1 cells"),
        (hit_that_is_lost, "visibility by LiDAR is wrong in 1 cells"),
    ],
)
def test_every_edit_is_found(dataset: Path, edit: Callable[[BirdsEye], None], message: str) -> None:
    path = attempt_of(dataset) / f"birds_eye/{FRAME:06d}.npz"
    content = unpack_birds_eye(path.read_bytes())
    edit(content)
    path.write_bytes(pack_birds_eye(content))
    recommit(dataset)
    assert any(message in one for one in found(dataset)), found(dataset)


def test_a_grid_that_is_elsewhere_or_missing_is_found(dataset: Path) -> None:
    folder = attempt_of(dataset) / "birds_eye"
    content = unpack_birds_eye((folder / "000000.npz").read_bytes())
    pose = content.pose
    moved = GridPose(pose.x_m + 0.01, pose.y_m, pose.z_m, pose.yaw_deg)
    (folder / "000000.npz").write_bytes(pack_birds_eye(replace(content, pose=moved)))
    (folder / "000001.npz").write_bytes(b"no grid")
    (folder / "000002.npz").unlink()
    recommit(dataset)
    messages = found(dataset)
    assert "birds_eye: birds_eye/000000.npz: the grid is not where the ego is" in messages
    assert any("000001.npz: the file does not decode" in one for one in messages)
    assert any(one.startswith("file_unlisted: birds_eye/000002.npz") for one in messages)
    (episode,) = Dataset(dataset).episodes
    with pytest.raises(DatasetError, match=r"000001\.npz cannot be read"):
        episode.birds_eye(1)
