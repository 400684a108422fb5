"""Points, maps and further cars of nuScenes exports, in the devkit and against the dataset."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from carstage.dataset import Dataset
from carstage.exporters import export_dataset
from devkits import NUSCENES_VERSION, check_point_counts, nuscenes_marks

AUDI = 50
CATEGORY_OF_TAG = {1: 24, 3: 28, 7: 28, 12: 2, 14: 17, 15: 23}
"""nuScenes-lidarseg's index by CARLA's tag: road, building, light, walker, car, truck."""
NOISE, EGO = 0, 31

pytestmark = pytest.mark.xdist_group("export")


@pytest.fixture(scope="module")
def out(segmented: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("export") / "out"
    export_dataset("nuscenes", segmented, folder, workers=0)
    return folder


@pytest.fixture(scope="module")
def nusc(out: Path, devkit) -> Any:
    return devkit.NuScenes(NUSCENES_VERSION, str(out), verbose=False)


@pytest.fixture
def splits(out: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, list[str]]:
    """The devkit's segmentation knows nuScenes's own splits alone: it gets ours."""
    from nuscenes.eval.lidarseg import utils
    from nuscenes.eval.panoptic import evaluate

    found = json.loads((out / NUSCENES_VERSION / "splits.json").read_text())
    for module in (utils, evaluate):
        monkeypatch.setattr(module, "create_splits_scenes", lambda verbose: found)
    return found


def frame_of(nusc: Any, sample: dict[str, Any]) -> int:
    first = nusc.get("scene", sample["scene_token"])["first_sample_token"]
    return round((sample["timestamp"] - nusc.get("sample", first)["timestamp"]) / 1e5)


def labels_of(nusc: Any, table: str, sample: dict[str, Any]) -> np.ndarray:
    path = Path(nusc.dataroot) / nusc.get(table, sample["data"]["LIDAR_TOP"])["filename"]
    return np.fromfile(path, np.uint8) if table == "lidarseg" else np.load(path)["data"]


def test_categories_are_nuscenes_s_own_in_its_order(nusc) -> None:
    from nuscenes.utils.color_map import get_colormap

    names = [row["name"] for row in sorted(nusc.category, key=lambda row: row["index"])]
    assert [row["index"] for row in nusc.category] == list(range(32))
    assert names == list(get_colormap())


def test_each_point_has_the_category_of_what_the_semantic_lidar_hit(nusc, segmented) -> None:
    episode = Dataset(segmented).episodes[0]
    for scene, sensor, own in (
        (nusc.scene[0], "SEMANTIC_TOP", 41),
        (nusc.scene[1], "SEMANTIC_AUDI", AUDI),
    ):
        samples = [s for s in nusc.sample if s["scene_token"] == scene["token"]]
        assert len(samples) == 3
        for sample in samples:
            hits = episode.sensor(sensor).read(frame_of(nusc, sample))
            expected = np.array([CATEGORY_OF_TAG[tag] for tag in hits["object_tag"].tolist()])
            expected[hits["object_idx"] == own] = EGO
            np.testing.assert_array_equal(labels_of(nusc, "lidarseg", sample), expected)
    assert (expected == EGO).any()  # the other car's LiDAR sees its roof


def test_the_devkit_s_segmentation_finds_no_error(nusc, splits, tmp_path: Path) -> None:
    from nuscenes.eval.lidarseg.evaluate import LidarSegEval
    from nuscenes.eval.lidarseg.utils import LidarsegClassMapper

    mapper = LidarsegClassMapper(nusc)
    folder = tmp_path / "lidarseg" / "carstage_train"
    folder.mkdir(parents=True)
    for sample in nusc.sample:
        found = mapper.convert_label(labels_of(nusc, "lidarseg", sample)).astype(np.uint8)
        found[found == 0] = 1  # where there is nothing to find, anything may be said
        found.tofile(folder / f"{sample['data']['LIDAR_TOP']}_lidarseg.bin")
    marks = LidarSegEval(nusc, str(tmp_path), "carstage_train").evaluate()
    assert marks["miou"] == pytest.approx(1.0)
    evaluated = {name for name, iou in marks["iou_per_class"].items() if not np.isnan(iou)}
    assert evaluated == {"driveable_surface", "manmade", "pedestrian", "car", "truck"}


def test_the_devkit_s_panoptic_segmentation_finds_no_error(nusc, splits, tmp_path: Path) -> None:
    from nuscenes.eval.panoptic.evaluate import NuScenesPanopticEval

    folder = tmp_path / "panoptic" / "carstage_train"
    folder.mkdir(parents=True)
    evaluation = NuScenesPanopticEval(
        nusc, str(tmp_path), "carstage_train", "tracking", 5, str(tmp_path)
    )
    for sample in nusc.sample:
        labels = labels_of(nusc, "panoptic", sample)
        assert labels.dtype == np.uint16
        found = evaluation.mapper.convert_label(labels // 1000).astype(np.uint16) * 1000
        path = folder / f"{sample['data']['LIDAR_TOP']}_panoptic.npz"
        np.savez_compressed(path, data=found + labels % 1000)
    evaluation.evaluate()
    marks = json.loads((tmp_path / "tracking-result.json").read_text())
    for name in ("driveable_surface", "manmade", "pedestrian", "car", "truck"):
        assert marks["segmentation"][name]["PQ"] == pytest.approx(1.0)
        assert marks["tracking"][name]["PTQ"] == pytest.approx(1.0)


def test_instances_are_the_objects_in_whose_boxes_the_points_lie(devkit, nusc) -> None:
    compared = 0
    for sample in nusc.sample:
        path, boxes, _ = nusc.get_sample_data(sample["data"]["LIDAR_TOP"])
        points = devkit.LidarPointCloud.from_file(path).points[:3].astype(float)
        labels = labels_of(nusc, "panoptic", sample)
        things = (labels >= 2000) & (labels < 24000)
        instances = set()
        for box in boxes:
            inside = devkit.points_in_box(box, points, wlh_factor=1.001) & things
            (label,) = np.unique(labels[inside]).tolist()
            assert label % 1000 > 0
            category = nusc.get("sample_annotation", box.token)["category_name"]
            assert nusc.lidarseg_idx2name_mapping[label // 1000] == category
            np.testing.assert_array_equal(labels == label, inside)
            instances.add(label)
            compared += 1
        assert len(instances) == len(boxes)
        assert instances == set(np.unique(labels[things]).tolist())
    assert compared >= 18


def test_an_instance_keeps_its_number_through_a_scene(nusc) -> None:
    numbers: dict[str, set[int]] = {}
    for sample in nusc.sample:
        scene = sample["scene_token"]
        labels = labels_of(nusc, "panoptic", sample)
        numbers.setdefault(scene, set()).update(
            np.unique(labels[(labels >= 2000) & (labels < 24000)]).tolist()
        )
    # The Audi and a parked car, a fire engine, a pedestrian; nobody sees itself as a thing.
    first, second = (numbers[scene["token"]] for scene in nusc.scene)
    assert len(first) == 4
    assert second == {label for label in first if label != min(x for x in first if x >= 17000)}


def test_every_car_with_sensors_has_a_scene(devkit, nusc, segmented, tmp_path: Path) -> None:
    assert [scene["name"] for scene in nusc.scene] == ["scene-2001", "scene-2002"]
    assert [log["vehicle"] for log in nusc.log] == ["vehicle.tesla.model3", "vehicle.audi.a2"]
    sample = nusc.get("sample", nusc.scene[1]["first_sample_token"])
    assert set(sample["data"]) == {"CAM_AUDI", "LIDAR_TOP"}
    pose = nusc.get(
        "ego_pose", nusc.get("sample_data", sample["data"]["LIDAR_TOP"])["ego_pose_token"]
    )
    row = next(
        r for r in Dataset(segmented).episodes[0].objects().to_pylist()
        if (r["k"], r["track_id"]) == (0, AUDI)
    )  # fmt: skip
    (shift,) = (m["global_from_enu_m"] for m in nusc.map)
    x, y, z = row["actor_location"]
    np.testing.assert_allclose(pose["translation"], [x + shift[0], -y + shift[1], z], atol=1e-6)
    metrics, evaluated = nuscenes_marks(devkit, nusc, tmp_path)
    assert evaluated["car"] == 3 * 3  # the ego cannot be hit in this world: it has no points
    for name in evaluated:
        assert metrics["mean_dist_aps"][name] == pytest.approx(1.0)


def test_points_on_objects_are_counted_for_the_car_s_own_lidar(devkit, nusc) -> None:
    scene = nusc.scene[0]["token"]
    ordinary = SimpleNamespace(
        sample=[sample for sample in nusc.sample if sample["scene_token"] == scene],
        get=nusc.get,
        get_sample_data=nusc.get_sample_data,
    )
    assert check_point_counts(devkit, ordinary)[0] == 3 * 4
    for row in nusc.sample_annotation:
        sample = nusc.get("sample", row["sample_token"])
        if sample["scene_token"] != scene:
            labels = labels_of(nusc, "panoptic", sample)
            assert row["num_lidar_pts"] in np.unique(labels, return_counts=True)[1]


def test_cameras_of_another_car_see_the_boxes_where_the_labels_say(devkit, nusc, segmented) -> None:
    rows = Dataset(segmented).episodes[0].camera_objects().to_pylist()
    compared = 0
    for sample in nusc.sample:
        if "CAM_AUDI" not in sample["data"]:
            continue
        _, boxes, intrinsic = nusc.get_sample_data(sample["data"]["CAM_AUDI"])
        for box in boxes:
            (seen,) = [
                r for r in rows
                if (r["k"], r["sensor_id"]) == (frame_of(nusc, sample), "CAM_AUDI")
                and abs(r["depth_center"] - float(box.center[2])) < 1e-3
            ]  # fmt: skip
            uv = devkit.view_points(box.corners(), intrinsic, normalize=True)[:2]
            found = [*uv.min(axis=1) + 0.5, *uv.max(axis=1) + 0.5]  # from pixels' centres
            np.testing.assert_allclose(found, seen["bbox_amodal_unclipped"], atol=0.05)
            compared += 1
    assert compared >= 3


def test_the_map_shows_roads_where_they_were_seen(nusc) -> None:
    (row,) = nusc.map
    east, north = row["global_from_enu_m"]
    for pose in nusc.ego_pose:
        assert row["mask"].is_on_mask(*pose["translation"][:2]).all()
    # The road is everywhere but under the building, whose middle is 40 m east and 12 m north.
    assert not row["mask"].is_on_mask(40.0 + east, 12.0 + north).any()
    assert not row["mask"].is_on_mask(east, north + 120.0).any()
    assert 0.001 < (row["mask"].mask() == 255).mean() < 0.2


def test_a_rig_without_tags_has_no_labels_of_points(exported) -> None:
    out = exported("nuscenes")
    assert not (out / "lidarseg").exists()
    assert not (out / NUSCENES_VERSION / "lidarseg.json").exists()


def test_naming_sensors_chooses_their_cars(segmented, tmp_path: Path) -> None:
    from carstage.exporters import ExportOptions

    chosen = ExportOptions(cameras=("CAM_AUDI",))
    export_dataset("nuscenes", segmented, tmp_path / "out", chosen, workers=0)
    logs = json.loads((tmp_path / "out" / NUSCENES_VERSION / "log.json").read_text())
    assert [log["vehicle"] for log in logs] == ["vehicle.audi.a2"]


def test_sensors_without_a_place_are_counted(every_kind: Path, tmp_path: Path) -> None:
    from carstage.exporters import ExportOptions

    options = ExportOptions(lidar="SEMLIDAR_TOP")
    summary = export_dataset("nuscenes", every_kind, tmp_path / "out", options, workers=0)
    assert summary.sensors_left_out == {"LIDAR_TOP": 6}


def test_a_camera_on_the_map_has_no_scene(every_kind: Path) -> None:
    from carstage.exporters import ExportOptions
    from carstage.exporters.formats.nuscenes_scenes import scenes_of, sensors_without_scene

    (episode,) = Dataset(every_kind).episodes
    left, others = episode.sensor("CAM_LEFT"), episode.sensors
    beside_the_road = SimpleNamespace(id="CAM_POST", calibration=left.calibration)
    with_post = SimpleNamespace(sensors=(*others, beside_the_road))
    scenes = scenes_of(episode, ExportOptions())
    assert sensors_without_scene(with_post, scenes, ExportOptions()) == ("CAM_POST",)
    chosen = ExportOptions(cameras=("CAM_LEFT",))
    assert sensors_without_scene(with_post, scenes_of(episode, chosen), chosen) == ()


def test_a_class_map_gives_boxes_and_points_other_categories(
    devkit, segmented, tmp_path: Path
) -> None:
    from carstage.exporters import ClassMap, ExportOptions

    types = ClassMap.of({"car": "vehicle.trailer", "walker_adult": "movable_object.debris"})
    chosen = ExportOptions(class_map=types)
    export_dataset("nuscenes", segmented, tmp_path / "out", chosen, workers=0)
    nusc = devkit.NuScenes(NUSCENES_VERSION, str(tmp_path / "out"), verbose=False)
    attributes = {row["token"]: row["name"] for row in nusc.attribute}
    seen = {
        (row["category_name"], tuple(attributes[token] for token in row["attribute_tokens"]))
        for row in nusc.sample_annotation
    }
    assert {category for category, _ in seen} == set(types.names)
    assert ("movable_object.debris", ()) in seen
    for sample in nusc.sample:
        labels = labels_of(nusc, "panoptic", sample)
        instances = {nusc.lidarseg_idx2name_mapping[x // 1000] for x in labels if x % 1000}
        assert instances <= set(types.names)
        assert instances


def test_processes_write_what_one_process_writes(segmented, out: Path, tmp_path: Path) -> None:
    export_dataset("nuscenes", segmented, tmp_path / "two", workers=2)
    files = [p.relative_to(out) for p in sorted(out.rglob("*")) if p.is_file()]
    assert len(files) > 60
    for path in files:
        assert (out / path).read_bytes() == (tmp_path / "two" / path).read_bytes(), path
