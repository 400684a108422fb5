"""Radars with cross sections, recorded from the embedded simulator."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from numpy.typing import NDArray

import carstage
from analytic_dataset import attempt_of, recommit
from carstage.dataset import Dataset, Episode
from carstage.dataset.tables import row_sensor, write_table
from carstage.exporters import ExportOptions, export_dataset
from carstage.sensor_kinds.columns import Detection, RcsDetection
from carstage.tags import TAGS_0_9_14
from carstage.validation import validate_dataset
from mcap_reading import foxglove_messages

pytestmark = [pytest.mark.end_to_end]

CONE = {"horizontal_fov_deg": 90, "vertical_fov_deg": 30, "points_per_second": 20_000}
NUMBERS = {tag.name: number for number, tag in TAGS_0_9_14.items()}


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("radar") / "out"
    asked = {
        "seed": 7, "duration_s": 0.3, "fps": 10, "map": "Stage01", "server": {"self_test": "off"},
        "vehicles": {"count": 30}, "pedestrians": {"count": 30},
        "rig": {"sensors": [
            {"id": "RGB", "kind": "rgb", "pose": {"x": 1.5, "z": 1.6},
             "attributes": {"image_size": [320, 180]}},
            {"id": "LIDAR_TOP", "kind": "lidar", "pose": {"z": 2.4}},
            {"id": "RADAR", "kind": "rcs_radar", "pose": {"x": 2.3, "z": 0.7},
             "attributes": {**CONE, "fluctuation": False}},
            {"id": "PLAIN", "kind": "radar", "pose": {"x": 2.3, "z": 0.7}, "attributes": CONE},
        ]},
    }  # fmt: skip
    assert carstage.run(asked, folder).state == "done"
    return folder


@pytest.fixture(scope="module")
def episode(dataset: Path) -> Episode:
    (found,) = Dataset(str(dataset)).episodes
    return found


def test_a_detection_has_a_cross_section_and_a_tag(episode: Episode) -> None:
    for k in range(episode.frames):
        found = episode.sensor("RADAR").read(k)
        assert found.shape[1] == len(Detection) + len(RcsDetection)
        tags = found[:, RcsDetection.TAG].astype(int)
        assert set(np.unique(tags)) <= set(TAGS_0_9_14)
        rcs = found[:, RcsDetection.RCS]
        of_cars = rcs[tags == NUMBERS["Car"]]
        of_road = rcs[tags == NUMBERS["Roads"]]
        assert of_cars.size == 0 or of_cars.min() > 5.0
        assert of_road.size > 0
        assert of_road.max() < of_cars.max(initial=5.0)


def test_what_the_dataset_promises_of_it_holds(dataset: Path, episode: Episode) -> None:
    report = validate_dataset(dataset)
    assert [p.message for p in report.problems if p.severity == "error"] == []
    counted = [dict(row["num_radar_points"]) for row in episode.objects().to_pylist()]
    assert any(counts.get("RADAR", 0) > 5 for counts in counted)


def test_nuscenes_gets_the_cross_sections_and_0_of_a_plain_radar(
    dataset: Path, episode: Episode, tmp_path: Path
) -> None:
    from nuscenes.utils.data_classes import RadarPointCloud

    options = ExportOptions(lidar="LIDAR_TOP", cameras=("RGB",))
    export_dataset("nuscenes", str(dataset), str(tmp_path / "out"), options, workers=1)
    RadarPointCloud.disable_filters()
    for name in ("RADAR", "PLAIN"):
        first = sorted((tmp_path / "out/samples").glob(f"*{name}/*.pcd"))[0]
        points = RadarPointCloud.from_file(str(first)).points
        own = episode.sensor(name).read(0)
        assert points.shape[1] == len(own)
        expected = own[:, RcsDetection.RCS] if name == "RADAR" else np.zeros(len(own))
        np.testing.assert_allclose(points[5], expected, rtol=1e-6)


def test_mcap_has_places_and_both_columns(dataset: Path, episode: Episode, tmp_path: Path) -> None:
    export_dataset("mcap", str(dataset), str(tmp_path / "out"), ExportOptions(), workers=1)
    (path,) = (tmp_path / "out").glob("*.mcap")
    _, cloud = foxglove_messages(path)["/RADAR/points"][0]
    names = [field.name for field in cloud.fields]
    assert names[:3] == ["x", "y", "z"]
    assert names[-2:] == ["rcs_dbsm", "object_tag"]
    own = episode.sensor("RADAR").read(0)
    written = np.frombuffer(cloud.data, "<f4").reshape(len(own), len(names))
    np.testing.assert_array_equal(written[:, -2:], own[:, RcsDetection.RCS :])
    np.testing.assert_allclose(
        np.linalg.norm(written[:, :3], axis=1), own[:, Detection.DEPTH], rtol=1e-5
    )


def people_like_lorries(rows: NDArray[np.float32]) -> None:
    people = rows[:, RcsDetection.TAG] == NUMBERS["Pedestrian"]
    assert people.any()
    rows[people, RcsDetection.RCS] = 20.0


def loud_roads(rows: NDArray[np.float32]) -> None:
    rows[rows[:, RcsDetection.TAG] == NUMBERS["Roads"], RcsDetection.RCS] = 60.0


def strange_tags(rows: NDArray[np.float32]) -> None:
    rows[::9, RcsDetection.TAG] = 99.5


@pytest.mark.parametrize("damage", [people_like_lorries, loud_roads, strange_tags])
def test_wrong_cross_sections_and_tags_are_found(
    dataset: Path, tmp_path: Path, damage: Callable[[Any], None]
) -> None:
    copy = tmp_path / "copy"
    shutil.copytree(dataset, copy)
    path = attempt_of(copy) / "sensors" / "RADAR.parquet"
    kind = row_sensor("rcs_radar")
    assert kind is not None
    rows = pq.read_table(path).to_pylist()
    for row in rows:
        found = kind.array(row)
        damage(found)
        row |= {name: found[:, i].tolist() for i, (name, _) in enumerate(kind.columns)}
    write_table(pa.Table.from_pylist(rows, schema=kind.schema), path)
    recommit(copy)
    assert "radar_rcs" in {problem.check for problem in validate_dataset(copy).problems}
