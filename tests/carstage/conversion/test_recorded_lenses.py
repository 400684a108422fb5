"""Cameras with other models, recorded from the embedded simulator and labelled."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import carstage
from carstage.dataset import Dataset, Episode
from carstage.dataset.masks import mask_pixels
from carstage.exporters.lenses import ROS_MODELS, named_distortion
from carstage.geometry import project
from carstage.sensor_kinds.columns import Instance
from carstage.validation import validate_dataset

pytestmark = [pytest.mark.end_to_end]

PLACE = {"x": 1.5, "z": 1.6}
BROWN = {
    "model": "brown_conrady", "fx": 130.0, "fy": 134.0, "cx": 122.0, "cy": 73.0,
    "k1": -0.25, "k2": 0.08, "p1": 0.001,
}  # fmt: skip
FISHEYE = {
    "model": "kannala_brandt", "fx": 58.0, "fy": 58.5, "cx": 101.0, "k1": 0.03, "k2": -0.01,
    "max_angle_deg": 95.0,
}  # fmt: skip
SPHERE = {"model": "equirectangular"}
CAMERAS = {
    "BROWN": ("rgb", BROWN, [240, 150]), "BROWN_ID": ("instance", BROWN, [240, 150]),
    "BROWN_DEPTH": ("depth", BROWN, [240, 150]),
    "FISH": ("rgb", FISHEYE, [200, 200]), "FISH_ID": ("instance", FISHEYE, [200, 200]),
    "FISH_DEPTH": ("depth", FISHEYE, [200, 200]), "FISH_TAG": ("semantic", FISHEYE, [200, 200]),
    "AROUND": ("instance", SPHERE, [240, 120]),
    "PIN": ("rgb", None, [240, 150]), "PIN_ID": ("instance", None, [240, 150]),
    "PLAIN": ("depth", None, [480, 480]),
}  # fmt: skip


def sensor(name: str, kind: str, lens: dict[str, Any] | None, size: list[int]) -> dict[str, Any]:
    given = {"id": name, "kind": kind, "pose": PLACE, "attributes": {"image_size": size}}
    return given if lens is None else {**given, "lens": lens}


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("lenses") / "out"
    asked = {
        "seed": 7, "duration_s": 0.4, "fps": 5, "map": "Stage01", "server": {"self_test": "off"},
        "vehicles": {"count": 20}, "pedestrians": {"count": 6},
        "rig": {"sensors": [sensor(name, *camera) for name, camera in CAMERAS.items()]},
        "labels": {"cameras": ["BROWN", "FISH", "AROUND", "PIN"]},
    }  # fmt: skip
    assert carstage.run(asked, folder).state == "done"
    return folder


@pytest.fixture(scope="module")
def episode(dataset: Path) -> Episode:
    return Dataset(dataset).episodes[0]


def test_what_labels_promise_holds_for_every_camera_model(dataset: Path) -> None:
    report = validate_dataset(dataset)
    assert [p.message for p in report.problems if p.severity == "error"] == []


@pytest.mark.parametrize("camera_id", ["PIN", "BROWN", "FISH", "AROUND"])
def test_boxes_and_masks_are_those_of_the_instance_picture(
    episode: Episode, camera_id: str
) -> None:
    """Of actors: what the level has carries no id, so its masks are by depth and tag."""
    camera = episode.sensor(camera_id).calibration
    assert camera.instance is not None
    rows = [
        row
        for row in episode.camera_objects().to_pylist()
        if row["sensor_id"] == camera_id
        and row["visibility_method"] == "instance"
        and not row["instance_ambiguous"]
        and row["mask_modal"]
    ]
    assert len(rows) >= 4
    inside = 0
    for row in rows:
        v, u = mask_pixels(row["mask_modal"], camera.height, camera.width)
        assert row["bbox_modal"] == [u.min(), v.min(), u.max() + 1, v.max() + 1]
        picture = episode.sensor(camera.instance).read(row["k"])
        own = picture[..., Instance.ID] == row["track_id"] & 0xFFFF
        mask = np.zeros_like(own)
        mask[v, u] = True
        assert np.array_equal(own, mask)  # an intersection over union of 1
        x0, y0, x1, y1 = row["bbox_amodal"]
        inside += bool(x0 - 1 <= u.min() and y0 - 1 <= v.min() and u.max() <= x1 and v.max() <= y1)
    assert inside == len(rows)


@pytest.mark.parametrize("camera_id", ["BROWN_DEPTH", "FISH_DEPTH"])
def test_depth_is_that_of_a_plain_pinhole_of_the_same_place(
    episode: Episode, camera_id: str
) -> None:
    plain, bent = episode.sensor("PLAIN"), episode.sensor(camera_id)
    depth: NDArray[np.float64] = bent.read(0).astype(np.float64)
    points = bent.calibration.pixel_rays() * depth[..., None]
    uv = project(points, plain.calibration.k)
    seen = (uv >= 1.0).all(axis=-1) & (uv < 479.0).all(axis=-1) & (depth < 60.0)
    u, v = np.floor(uv[seen]).astype(int).T
    z = points[seen][:, 2]
    wanted = plain.read(0)[v, u]
    assert seen.sum() > 5000
    assert np.quantile(np.abs(z - wanted) / wanted, 0.9) < 0.02
    assert bent.calibration.shares_view(episode.sensor(camera_id.split("_")[0]).calibration)


def test_outside_the_image_circle_is_class_zero_and_black(episode: Episode) -> None:
    outside = ~episode.sensor("FISH").calibration.mask()
    assert outside.any()
    assert not episode.sensor("FISH_TAG").read(0)[outside].any()
    assert not episode.sensor("FISH").read(0)[outside].any()
    assert (episode.sensor("FISH_DEPTH").read(0)[outside] > 999.0).all()
    assert episode.sensor("FISH_TAG").read(0)[~outside].any()


def test_the_calibration_names_the_model(episode: Episode) -> None:
    brown, fish = (episode.sensor(name).calibration for name in ("BROWN", "FISH"))
    assert (brown.width, brown.height, brown.k[0, 0], brown.k[1, 2]) == (240, 150, 130.0, 73.0)
    assert named_distortion(brown, ROS_MODELS) == ("plumb_bob", [-0.25, 0.08, 0.001, 0.0, 0.0])
    assert named_distortion(fish, ROS_MODELS) == ("equidistant", [0.03, -0.01, 0.0, 0.0])
    assert fish.fov_deg == pytest.approx(190.0, abs=0.01)
    plain = episode.sensor("PLAIN").calibration
    assert named_distortion(plain, ROS_MODELS) == ("", [])
