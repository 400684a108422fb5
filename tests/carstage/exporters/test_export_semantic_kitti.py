"""SemanticKITTI exports, read as the devkit reads them, against the semantic LiDAR itself."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
import yaml
from numpy.typing import NDArray

from carstage.dataset import Dataset, Frame, Occupancy
from carstage.errors import BadInputError
from carstage.exporters import ExportOptions, export_dataset
from carstage.exporters.clouds import LabelledCloud, nearest_rays
from carstage.exporters.formats.semantic_kitti import NAMES, point_labels, voxel_labels
from carstage.tags import TAGS_0_9_14
from carstage.testing.exporter import ExporterTests
from driving import carstage

pytestmark = [pytest.mark.end_to_end, pytest.mark.xdist_group("runs")]

FRAMES = 8
CONFIG = """
name: clouds
seed: 5
duration_s: 0.8
fps: 10
map: {choice: Stage01}
vehicles: {count: 25}
pedestrians: {count: 30}
timing: {warmup_ticks: 25}
conversion: {workers: 1}
server: {kind: embedded, self_test: off}
labels: {lidars: [TOP]}
rig:
  sensors:
    - {id: TOP, kind: lidar, pose: {z: 1.9}, attributes: {channels: 32, points_per_second: 200000}}
    - {id: ALONE, kind: semantic_lidar, pose: {x: 1.0, z: 2.2}, attributes: {channels: 16}}
"""


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("clouds")
    (folder / "clouds.yaml").write_text(CONFIG)
    ended = carstage(["run", str(folder / "clouds.yaml"), "--out", str(folder / "data")], folder)
    assert ended.code == 0, ended.stderr
    return folder / "data"


class TestContract(ExporterTests):
    name = "semantickitti"

    @pytest.fixture
    def dataset(self, drive: Path) -> Path:
        """It needs a semantic LiDAR."""
        return drive


@pytest.fixture(scope="module")
def exported(drive: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("export") / "kitti"
    export_dataset("semantickitti", drive, out, workers=0)
    return out


def scan(folder: Path, k: int) -> tuple[NDArray[np.float32], NDArray[np.uint32]]:
    """As ``LaserScan.open_scan`` and ``open_label`` of semantic-kitti-api."""
    points = np.fromfile(folder / "velodyne" / f"{k:06d}.bin", np.float32).reshape(-1, 4)
    labels = np.fromfile(folder / "labels" / f"{k:06d}.label", np.uint32)
    assert len(points) == len(labels)
    return points, labels


def mean_iou(truth: NDArray[np.int64], found: NDArray[np.int64]) -> float:
    """As ``iouEval`` of semantic-kitti-api: the mean over classes, unlabeled left out."""
    size = 300
    confusion = np.bincount(truth * size + found, minlength=size * size).reshape(size, size)
    confusion[:, 0] = confusion[0, :] = 0
    hits = np.diag(confusion)
    union = confusion.sum(axis=0) + confusion.sum(axis=1) - hits
    return float((hits[union > 0] / union[union > 0]).mean())


def test_points_of_a_lidar_have_the_labels_of_its_twin(exported: Path, drive: Path) -> None:
    (episode,) = Dataset(drive).episodes
    sequence = exported / "sequences" / "00"
    names = {v: n for n, v in yaml.safe_load(
        (exported / "semantic-kitti.yaml").read_text())["labels"].items()}  # fmt: skip
    expected = {"Roads": "road", "SideWalks": "sidewalk", "Building": "building", "Car": "car",
                "Vegetation": "vegetation", "Pole": "pole", "Terrain": "terrain"}  # fmt: skip
    tags = {number: tag.name for number, tag in TAGS_0_9_14.items()}
    truth_all, found_all = [], []
    for k in range(FRAMES):
        points, labels = scan(sequence, k)
        np.testing.assert_array_equal(points * [1, -1, 1, 1], episode.sensor("TOP").read(k))
        tagged = episode.sensor("TOP.semantic").read(k)
        ends = np.column_stack([tagged[name] for name in "xyz"])
        # The nearest end of a ray, in space: another way than by direction.
        some = np.linspace(0, len(points) - 1, 400).astype(int)
        apart = np.linalg.norm((points[some, :3] * [1, -1, 1])[:, None] - ends, axis=-1)
        nearest = apart.argmin(axis=1)
        for i, j in zip(some, nearest, strict=True):
            name = tags[int(tagged["object_tag"][j])]
            if apart[nearest.tolist().index(j), j] < 0.05 and name in expected:
                label = int(labels[i] & 0xFFFF)
                moving = {"car": "moving-car"}.get(expected[name], expected[name])
                truth_all.append(names[expected[name]])
                found_all.append(names[expected[name]] if label == names[moving] else label)
    truth, found = np.array(truth_all), np.array(found_all)
    assert len(truth) > 1000
    assert mean_iou(truth, truth) == 1.0
    assert mean_iou(truth, found) > 0.98


def test_few_points_are_noise_and_instances_are_actors(exported: Path, drive: Path) -> None:
    (episode,) = Dataset(drive).episodes
    actors = {int(track) & 0xFFFF for track in episode.document["actors"]}
    seen: set[int] = set()
    for k in range(FRAMES):
        _, labels = scan(exported / "sequences" / "00", k)
        assert ((labels & 0xFFFF) == 0).mean() < 0.02
        things = np.isin(labels & 0xFFFF, [10, 252, 30, 254])
        assert (labels[~things] >> 16 == 0).mean() > 0.95
        seen |= set((labels[things] >> 16).tolist()) - {0}
    assert len(seen) > 3
    assert seen <= actors | {0}


def test_what_moves_has_a_moving_class(exported: Path, drive: Path) -> None:
    (episode,) = Dataset(drive).episodes
    rows = [row for row in episode.objects().to_pylist() if row["k"] == 4]
    actors = [row for row in rows if str(row["track_id"]) in episode.document["actors"]]
    speed = {row["track_id"] & 0xFFFF: float(np.linalg.norm(row["velocity"])) for row in actors}
    _, labels = scan(exported / "sequences" / "00", 4)
    for label in np.unique(labels[np.isin(labels & 0xFFFF, [252, 254])]).tolist():
        assert speed[label >> 16] > 0.2
    parked = {label >> 16 for label in np.unique(labels[(labels & 0xFFFF) == 10]).tolist()}
    assert all(speed.get(actor, 0.0) <= 0.2 for actor in parked)


@pytest.mark.parametrize(
    ("speed_m_s", "expected"), [(3.0, [253, 253, 255, 255]), (0.0, [11, 31, 15, 32])]
)
def test_what_is_ridden_moves_in_one_class_with_its_rider(
    speed_m_s: float, expected: list[int]
) -> None:
    number = {tag.name: value for value, tag in TAGS_0_9_14.items()}
    tags = [number[name] for name in ("Bicycle", "Rider", "Motorcycle", "Rider")]
    cloud = LabelledCloud(
        np.zeros((4, 4), np.float32), np.array(tags, np.uint8), np.array([7, 7, 8, 8], np.uint32)
    )
    objects = {
        track: {"class": name, "velocity": [speed_m_s, 0.0, 0.0]}
        for track, name in ((7, "bicycle"), (8, "motorcycle"))
    }
    frame = cast("Frame", SimpleNamespace(objects=objects, ego=None))
    assert (point_labels(cloud, frame) & 0xFFFF).tolist() == expected


def test_voxels_of_a_parked_car_do_not_move_with_an_actor_whose_id_is_like_its_own() -> None:
    parked, actor = 2**52 + 30, 30
    car = {tag.name: value for value, tag in TAGS_0_9_14.items()}["Car"]
    content = SimpleNamespace(
        occupied=np.array([True, False, True]),
        semantic=np.array([car, 0, car], np.uint8),
        tracks=np.array([parked, 0, actor]),
    )
    objects = {
        parked: {"class": "car", "velocity": [0.0, 0.0, 0.0]},
        actor: {"class": "car", "velocity": [8.0, 0.0, 0.0]},
    }
    frame = cast("Frame", SimpleNamespace(objects=objects, ego=None))
    found = voxel_labels(cast("Occupancy", content), frame) & 0xFFFF
    assert [NAMES[label] for label in found.tolist()] == ["car", "moving-car"]


def test_poses_lead_from_sweep_to_sweep(exported: Path, drive: Path) -> None:
    (episode,) = Dataset(drive).episodes
    sequence = exported / "sequences" / "00"
    lines = [line.split() for line in (sequence / "calib.txt").read_text().splitlines()]
    matrices = {key.rstrip(":"): np.array(v, float).reshape(3, 4) for key, *v in lines}
    turn = np.vstack([matrices["Tr"], [0, 0, 0, 1]])
    poses = np.loadtxt(sequence / "poses.txt").reshape(-1, 3, 4)
    assert len(poses) == len(np.loadtxt(sequence / "times.txt")) == FRAMES
    # As the devkit has it: inv(Tr) pose Tr moves points of a sweep into the first one.
    last = np.linalg.inv(turn) @ np.vstack([poses[-1], [0, 0, 0, 1]]) @ turn
    own = episode.world_from_sensor()["TOP"]
    expected = np.linalg.inv(own[0]) @ own[FRAMES - 1]
    np.testing.assert_allclose(last[:3, 3], expected[:3, 3] * [1, -1, 1], atol=1e-6)
    assert abs(last[0, 3]) > 0.5, "a drive that stands shows nothing"


def test_a_semantic_lidar_labels_itself(drive: Path, tmp_path: Path) -> None:
    export_dataset(
        "semantickitti", drive, tmp_path / "out", ExportOptions(lidar="ALONE"), workers=0
    )
    (episode,) = Dataset(drive).episodes
    points, labels = scan(tmp_path / "out" / "sequences" / "00", 3)
    tagged = episode.sensor("ALONE").read(3)
    assert len(points) == len(tagged)
    assert not points[:, 3].any()
    assert ((labels & 0xFFFF) == 40).sum() == (tagged["object_tag"] == 1).sum() > 100


def test_a_rig_without_labels_is_refused(dataset: Path, tmp_path: Path) -> None:
    with pytest.raises(BadInputError, match=r"No LiDAR of episode .* has labels") as caught:
        export_dataset("semantickitti", dataset, tmp_path / "out", workers=0)
    assert "semantic_lidar" in caught.value.hint


def test_rays_are_matched_by_direction_and_distance() -> None:
    rays = np.array([[10.0, 0.0, 0.0], [0.0, 10.0, 0.0], [-10.0, -1e-9, 0.0]])
    points = np.array(
        [
            [10.1, 0.0, 0.0],  # noise along the ray
            [12.0, 0.0, 0.0],  # another surface
            [0.0, 10.0, 1.0],  # six degrees off
            [-10.0, 1e-9, 0.0],  # across the seam of the azimuth
        ]
    )
    assert nearest_rays(points, rays).tolist() == [0, -1, -1, 2]
    assert nearest_rays(points, np.empty((0, 3))).tolist() == [-1] * 4


def test_rays_are_matched_as_far_along_the_ray_as_the_lidar_is_noisy() -> None:
    rays, points = np.array([[10.0, 0.0, 0.0]]), np.array([[11.5, 0.0, 0.0]])
    assert nearest_rays(points, rays).tolist() == [-1]
    assert nearest_rays(points, rays, noise_m=0.4).tolist() == [0]


def test_rays_are_matched_across_many_cells_of_azimuth_near_the_zenith() -> None:
    elevation, azimuth = np.radians(80.0), np.radians([0.1, 1.0])
    level = np.cos(elevation)
    ray, point = np.stack(
        [level * np.cos(azimuth), level * np.sin(azimuth), np.full(2, np.sin(elevation))], axis=1
    )
    assert nearest_rays(10.0 * point[None], 10.0 * ray[None]).tolist() == [0]
