"""COCO exports in pycocotools; panoptic segments against the instance image."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from PIL import Image

import analytic_scene
from analytic_dataset import SIZE, make_dataset
from carstage.annotation.rle import encode_mask
from carstage.dataset import Dataset, Episode, Frame, decode_mask
from carstage.exporters import ExportOptions, export_dataset
from carstage.exporters.labels import camera_labels
from carstage.tags import TAGS_0_9_14
from devkits import coco_marks

pytestmark = [
    pytest.mark.xdist_group("export"),
    # pycocotools 2.0.11 speaks numpy 1's protocol of arrays.
    pytest.mark.filterwarnings("ignore:__array__ implementation:DeprecationWarning"),
]


@pytest.fixture(scope="module")
def coco(exported) -> Any:
    """The export as pycocotools sees it; imported late, as that takes seconds."""
    pycocotools = pytest.importorskip("pycocotools.coco", reason="pycocotools is not installed")
    return pycocotools.COCO(str(exported("coco") / "annotations/instances_train.json"))


@pytest.mark.parametrize("kind", ["bbox", "segm"])
def test_our_labels_as_detections_get_full_marks(coco: Any, kind: str) -> None:
    precision, found = coco_marks(coco, kind)
    assert precision == pytest.approx(1.0)
    assert found >= 12


def test_masks_fill_their_boxes_and_have_their_area(coco: Any) -> None:
    for row in coco.dataset["annotations"]:
        mask = coco.annToMask(row)
        x, y = np.flatnonzero(mask.any(axis=0)), np.flatnonzero(mask.any(axis=1))
        assert row["bbox"] == [x[0], y[0], x[-1] + 1 - x[0], y[-1] + 1 - y[0]]
        assert row["area"] == mask.sum()


def test_pictures_lie_where_the_tables_say(coco: Any, exported) -> None:
    assert len(coco.dataset["images"]) == 12
    for row in coco.dataset["images"]:
        with Image.open(exported("coco") / "train" / row["file_name"]) as picture:
            assert picture.size == (row["width"], row["height"])


def test_amodal_boxes_are_written_on_demand(exported, dataset) -> None:
    document = json.loads(
        (exported("coco", boxes="amodal") / "annotations/instances_train.json").read_text()
    )
    rows = Dataset(dataset).episodes[0].camera_objects().to_pylist()
    amodal = {tuple(row["bbox_amodal"]) for row in rows}
    for row in document["annotations"]:
        x, y, width, height = row["bbox"]
        assert min(
            np.abs(np.subtract(box, (x, y, x + width, y + height))).max() for box in amodal
        ) == pytest.approx(0.0, abs=1e-9)


def test_rows_without_counted_pixels_have_boxes_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plain = analytic_scene.spec

    def stage_vo_alone(**options: Any) -> dict[str, Any]:
        found = plain(**options)
        cameras = [one | {"instance": None} for one in found["sensors"]]
        sensors = [one for one in cameras if one["kind"] != "instance"]
        labels = {**found["labels"], "method": "stage_vo"}
        return {**found, "labels": labels, "sensors": sensors}

    monkeypatch.setattr(analytic_scene, "spec", stage_vo_alone)
    dataset = make_dataset(tmp_path / "dataset", tmp_path, size=SIZE)
    options = ExportOptions(boxes="amodal")
    export_dataset("coco", dataset, tmp_path / "out", options, workers=0)
    annotations = tmp_path / "out/annotations"
    assert [path.name for path in annotations.iterdir()] == ["instances_train.json"]
    rows = json.loads((annotations / "instances_train.json").read_text())["annotations"]
    assert len(rows) > 30
    assert not any("segmentation" in row for row in rows)
    assert all(row["area"] == row["bbox"][2] * row["bbox"][3] for row in rows)


def test_panoptic_segments_cover_the_picture_by_tag_and_actor(exported, dataset) -> None:
    folder = exported("coco") / "annotations"
    document = json.loads((folder / "panoptic_train.json").read_text())
    names = {category["id"]: category["name"] for category in document["categories"]}
    episode = Dataset(dataset).episodes[0]
    assert len(document["annotations"]) == 6  # CAM_LEFT has no instance camera in the dataset
    ks = {row["id"]: row["k"] for row in document["images"]}
    for annotation in document["annotations"]:
        with Image.open(folder / "panoptic_train" / annotation["file_name"]) as picture:
            r, g, b = np.moveaxis(np.asarray(picture).astype(np.uint32), -1, 0)
        segments = r + 256 * g + 65536 * b
        instance = episode.sensor("INST_FRONT").read(ks[annotation["image_id"]])
        covered = 0
        for row in annotation["segments_info"]:
            mask = segments == row["id"]
            assert mask.sum() == row["area"] > 0
            tags = np.unique(instance[mask][:, 1])
            assert [TAGS_0_9_14[int(tag)].name for tag in tags] == [names[row["category_id"]]]
            if names[row["category_id"]] in ("Car", "Truck", "Pedestrian"):
                assert len(np.unique(instance[mask][:, 0])) == 1
            covered += row["area"]
        assert covered == segments.size


def test_cameras_beside_the_ego_show_it_as_one_of_the_cars(watched, tmp_path: Path) -> None:
    export_dataset("coco", watched, tmp_path / "out", workers=0)
    document = json.loads((tmp_path / "out/annotations/instances_train.json").read_text())
    cameras = {image["id"]: image["camera"] for image in document["images"]}
    ego = Dataset(watched).episodes[0].document["ego_id"]
    shown = [a for a in document["annotations"] if a["track_id"] == ego]
    assert [cameras[annotation["image_id"]] for annotation in shown] == ["CAM_FRONT"] * 2
    assert all(annotation["area"] > 0 for annotation in shown)


def test_amodal_boxes_leave_the_mask_of_a_two_wheeler_without_its_rider() -> None:
    def seen(track_id: int, height: int) -> dict[str, Any]:
        mask = encode_mask(np.ones((height, 10), np.bool_), 10, 5, 40, 30)
        box = [10.0, 5.0, 20.0, 5.0 + height]
        return {
            "track_id": track_id, "visible": True, "distance": 5.0, "mask_modal": mask,
            "bbox_modal": box, "bbox_amodal": box, "visible_px": 10 * height,
        }  # fmt: skip

    objects = {
        7: {"class": "motorcycle", "num_lidar_points": []},
        8: {"class": "rider", "num_lidar_points": [], "parent_track_id": 7},
    }
    camera = SimpleNamespace(calibration=SimpleNamespace(width=40, height=30))
    frame = Frame(
        episode=cast(Episode, SimpleNamespace(sensor=lambda camera_id: camera)),
        k=0,
        timestamp_s=0.0,
        objects=objects,
        camera_objects={"CAM": [seen(7, 20), seen(8, 12)]},
        ego=None,
        sensor_poses={},
        available=frozenset(),
    )
    options = ExportOptions(classes=("motorcycle", "rider"), boxes="amodal")
    vehicle, rider = camera_labels(frame, "CAM", options)
    assert vehicle.box == (10.0, 5.0, 20.0, 25.0)
    masks = [decode_mask(label.seen["mask_modal"], 30, 40) for label in (vehicle, rider)]
    assert [mask.sum() for mask in masks] == [80, 120]
    assert not (masks[0] & masks[1]).any()
