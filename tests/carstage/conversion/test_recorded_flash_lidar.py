"""Flash LiDARs recorded from the embedded simulator, and what readers, labels and checks say."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import carstage
from analytic_dataset import attempt_of, recommit
from carstage.dataset import Dataset, Episode
from carstage.exporters import ExportOptions, export_dataset
from carstage.geometry.flash_beams import beam_directions
from carstage.validation import validate_dataset
from mcap_reading import foxglove_messages

pytestmark = [pytest.mark.end_to_end]

PLACE = {"x": 1.5, "z": 1.6}
LINES = {"columns": 96, "rows": 24, "samples": 1, "range_m": 80.0}
WIDE = {
    "columns": 96, "rows": 24, "returns": "all", "noise_stddev_m": 0.02, "dropoff_rate": 0.05,
    "range_reflectivity": 0.05, "ambient_noise": 0.1, "false_return_rate": 0.01,
}  # fmt: skip
AROUND = {"columns": 180, "rows": 12, "horizontal_fov_deg": 360.0, "samples": 1}


def sensor(name: str, kind: str = "flash_lidar", **attributes: Any) -> dict[str, Any]:
    return {"id": name, "kind": kind, "pose": PLACE, "attributes": attributes}


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("flash") / "out"
    asked = {
        "seed": 7, "duration_s": 0.4, "fps": 5, "map": "Stage01", "server": {"self_test": "off"},
        "vehicles": {"count": 20}, "pedestrians": {"count": 6},
        "rig": {"sensors": [
            sensor("RGB", "rgb", image_size=[320, 180]),
            sensor("LINES", **LINES), sensor("WIDE", **WIDE), sensor("AROUND", **AROUND),
            sensor("RAYS", "ray_flash_lidar", **LINES),
            sensor("WIDE_RAYS", "ray_flash_lidar", **WIDE),
            sensor("TAGS", "semantic_flash_lidar", **LINES),
            sensor("RAY_TAGS", "semantic_ray_flash_lidar", **LINES),
            sensor("WIDE_TAGS", "semantic_flash_lidar", **WIDE),
            sensor("SEMANTIC", "semantic", image_size=[1200, 400], fov_deg=70.0),
            sensor("DEPTH", "depth", image_size=[1200, 400], fov_deg=70.0),
        ]},
        "labels": {"birds_eye": {}},
    }  # fmt: skip
    assert carstage.run(asked, folder).state == "done"
    return folder


@pytest.fixture(scope="module")
def episode(dataset: Path) -> Episode:
    return Dataset(dataset).episodes[0]


def test_points_are_where_a_finer_depth_picture_has_them(episode: Episode) -> None:
    camera = episode.sensor("DEPTH").calibration
    inverse = 1.0 / episode.sensor("DEPTH").read(0).astype(np.float64)
    points = episode.sensor("LINES").read(0).astype(np.float64)
    assert len(points) > 1000
    x, y, z = points[:, :3].T
    u, v = camera.k[0, 0] * y / x + camera.k[0, 2], -camera.k[1, 1] * z / x + camera.k[1, 2]
    i, j = np.floor(u - 0.5).astype(int), np.floor(v - 0.5).astype(int)
    a, b = u - 0.5 - i, v - 0.5 - j
    around = np.stack([inverse[j + dv, i + du] for dv in range(-1, 3) for du in range(-1, 3)])
    at = np.array([(du, dv, 1.0) for dv in range(-1, 3) for du in range(-1, 3)])
    planes = np.linalg.lstsq(at, around, rcond=None)[0]
    flat = np.abs(around - at @ planes).max(axis=0) * x * x < 0.005
    upper = (1 - a) * inverse[j, i] + a * inverse[j, i + 1]
    lower = (1 - a) * inverse[j + 1, i] + a * inverse[j + 1, i + 1]
    error = np.abs(1.0 / ((1 - b) * upper + b * lower) - x)[flat]
    assert len(error) > 1000
    assert np.quantile(error, 0.99) <= 0.01


def test_what_the_dataset_promises_of_it_holds(dataset: Path) -> None:
    report = validate_dataset(dataset)
    assert [p.message for p in report.problems if p.severity == "error"] == []


def test_its_points_are_counted_in_boxes_and_it_is_calibrated(episode: Episode) -> None:
    counted = [row["num_lidar_points"] for row in episode.objects().to_pylist()]
    names = {name for counts in counted for name, _ in counts or ()}
    assert names == {
        "LINES", "WIDE", "AROUND", "RAYS", "WIDE_RAYS", "TAGS", "RAY_TAGS", "WIDE_TAGS",
    }  # fmt: skip
    assert any(count > 5 for counts in counted for name, count in counts or () if name == "LINES")
    flash = episode.sensor("LINES").calibration.flash
    assert flash is not None
    assert (flash.beams, flash.most_points) == (96 * 24, 96 * 24)
    entry = episode.sensor("AROUND").calibration
    assert not entry.is_camera
    assert entry.blueprint == "sensor.camera.depth"


def by_beam(episode: Episode, name: str, column: int | None = None) -> NDArray[np.float64]:
    """Of each beam the range, or a column, of its first point; NaN without one."""
    sensor = episode.sensor(name)
    flash = sensor.calibration.flash
    assert flash is not None
    points = sensor.read(0).astype(np.float64)
    ranges = np.linalg.norm(points[:, :3], axis=1)
    cosines = (points[:, :3] / ranges[:, None]) @ beam_directions(flash).T
    beams, first = np.unique(cosines.argmax(axis=1), return_index=True)
    values = np.full(flash.beams, np.nan)
    values[beams] = (ranges if column is None else points[:, column])[first]
    return values


def test_rays_and_depth_pictures_measure_the_same_beams(episode: Episode) -> None:
    """Leaves and edges differ: there a pixel and a line may meet different things."""
    pictures, rays = (by_beam(episode, name) for name in ("LINES", "RAYS"))
    both = ~np.isnan(pictures) & ~np.isnan(rays)
    assert both.sum() > 1000
    assert (np.abs(pictures - rays)[both] <= 0.01).mean() > 0.8
    assert np.median(np.abs(pictures - rays)[both]) < 0.002
    intensities = [by_beam(episode, name, 3)[both] for name in ("LINES", "RAYS")]
    assert np.median(np.abs(intensities[0] - intensities[1])) < 0.01
    wide = [len(episode.sensor(name).read(0)) for name in ("WIDE", "WIDE_RAYS")]
    assert wide[1] == pytest.approx(wide[0], rel=0.1)


def test_tags_are_those_of_rays_and_of_a_finer_picture(episode: Episode) -> None:
    """Where ranges agree, beams end on one surface; at borders of paint tags may yet differ."""
    assert episode.sensor("TAGS").read(0).shape[1] == 6
    pictures, rays = (by_beam(episode, name) for name in ("TAGS", "RAY_TAGS"))
    same = np.abs(pictures - rays) <= 0.01
    assert same.sum() > 1000
    tags, ray_tags = (by_beam(episode, name, 5)[same] for name in ("TAGS", "RAY_TAGS"))
    assert len(np.unique(tags)) > 4
    assert (tags == ray_tags).mean() > 0.99
    objects, ray_objects = (by_beam(episode, name, 4)[same] for name in ("TAGS", "RAY_TAGS"))
    known = np.isin(objects, [row["track_id"] for row in episode.objects().to_pylist()])
    assert known.sum() > 10
    assert (objects == ray_objects)[known].mean() > 0.99
    camera = episode.sensor("SEMANTIC").calibration
    points = episode.sensor("TAGS").read(0).astype(np.float64)
    x, y, z = points[:, :3].T
    u, v = camera.k[0, 0] * y / x + camera.k[0, 2], -camera.k[1, 1] * z / x + camera.k[1, 2]
    picture = episode.sensor("SEMANTIC").read(0)
    around = np.stack([
        picture[v.astype(int) + dv, u.astype(int) + du] for dv in (-3, 0, 3) for du in (-3, 0, 3)
    ])  # fmt: skip
    inner = (around == around[0]).all(axis=0)
    assert inner.sum() > 1000
    assert (points[inner, 5] == around[0, inner]).mean() > 0.999


def test_labels_of_semantic_kitti_are_the_points_own(
    dataset: Path, episode: Episode, tmp_path: Path
) -> None:
    export_dataset(
        "semantickitti", str(dataset), str(tmp_path / "out"), ExportOptions(lidar="TAGS"),
        workers=1,
    )  # fmt: skip
    paths = sorted((tmp_path / "out").glob("**/labels/*.label"))
    assert len(paths) == episode.frames
    labels = np.fromfile(paths[0], "<u4") & 0xFFFF
    points = episode.sensor("TAGS").read(0)
    assert len(labels) == len(points)
    assert (labels[points[:, 5] == 1] == 40).all()  # roads
    assert (labels[points[:, 5] == 1]).size > 100


def test_all_around_has_points_on_every_side(episode: Episode) -> None:
    points = episode.sensor("AROUND").read(0)
    azimuth = np.degrees(np.arctan2(points[:, 1], points[:, 0]))
    seen = np.histogram(azimuth, bins=12, range=(-180, 180))[0]
    assert (seen > 30).all()


@pytest.mark.parametrize(
    ("name", "clouds"),
    [("kitti-object", "training/velodyne/*.bin"), ("nuscenes", "samples/LIDAR_TOP/*.bin")],
)
def test_exports_take_it_where_they_take_a_lidar(
    dataset: Path, episode: Episode, tmp_path: Path, name: str, clouds: str
) -> None:
    options = ExportOptions(lidar="LINES", cameras=("RGB",))
    export_dataset(name, str(dataset), str(tmp_path / "out"), options, workers=1)
    columns = 4 if name == "kitti-object" else 5
    exported = [
        np.fromfile(path, "<f4").reshape(-1, columns)
        for path in sorted((tmp_path / "out").glob(clouds))
    ]
    assert len(exported) == episode.frames
    for k, points in enumerate(exported):
        own = np.linalg.norm(episode.sensor("LINES").read(k)[:, :3], axis=1)
        np.testing.assert_allclose(np.linalg.norm(points[:, :3], axis=1), own, rtol=1e-4)


def test_mcap_has_a_channel_of_its_points(dataset: Path, episode: Episode, tmp_path: Path) -> None:
    export_dataset("mcap", str(dataset), str(tmp_path / "out"), ExportOptions(), workers=1)
    (path,) = (tmp_path / "out").glob("*.mcap")
    _, cloud = foxglove_messages(path)["/WIDE/points"][0]
    assert len(cloud.data) == 16 * len(episode.sensor("WIDE").read(0))
    _, tagged = foxglove_messages(path)["/TAGS/points"][0]
    assert [field.name for field in tagged.fields][-2:] == ["object_idx", "object_tag"]
    assert len(tagged.data) == 24 * len(episode.sensor("TAGS").read(0))


def moved_off_their_beams(points: NDArray[np.float32]) -> None:
    points[:50, 1] += 0.3


def farther(points: NDArray[np.float32]) -> None:
    points[:50, :3] *= 60.0


def test_tags_that_no_class_has_are_found(dataset: Path, tmp_path: Path) -> None:
    copy = tmp_path / "copy"
    shutil.copytree(dataset, copy)
    (path,) = (attempt_of(copy) / "sensors" / "TAGS").glob("000000.bin")
    points = np.fromfile(path, "<f4").reshape(-1, 6)
    points[:3, 5] = (99.0, 1.5, -1.0)
    points.tofile(path)
    recommit(copy)
    found = [p for p in validate_dataset(copy).problems if p.check == "flash_tags"]
    assert [problem.message.split(" of ")[0] for problem in found] == ["3"]


@pytest.mark.parametrize("damage", [moved_off_their_beams, farther])
def test_points_that_no_beam_has_are_found(dataset: Path, tmp_path: Path, damage: Any) -> None:
    copy = tmp_path / "copy"
    shutil.copytree(dataset, copy)
    (path,) = (attempt_of(copy) / "sensors" / "WIDE").glob("000000.bin")
    points = np.fromfile(path, "<f4").reshape(-1, 4)
    damage(points)
    points.tofile(path)
    recommit(copy)
    assert "flash_beams" in {problem.check for problem in validate_dataset(copy).problems}
