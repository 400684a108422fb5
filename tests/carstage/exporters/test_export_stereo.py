"""KITTI's stereo pairs: disparity beside depth, and beside the right picture's own geometry."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import analytic_scene
from analytic_dataset import SIZE, attempt_of, make_dataset
from carstage.dataset import Dataset
from carstage.errors import BadInputError
from carstage.exporters import ExportOptions, export_dataset
from carstage.geometry.stereo import disparity_steps, seen_by_both
from carstage.testing.exporter import ExporterTests

WIDTH, HEIGHT = SIZE
BASELINE_M = 0.54

pytestmark = pytest.mark.xdist_group("export")


def with_pair(spec: dict[str, Any]) -> dict[str, Any]:
    """A spec with a second camera to the right of the first one, and its depth."""
    sensors = {sensor["id"]: sensor for sensor in spec["sensors"]}
    front = sensors["CAM_FRONT"]["pose"]
    pose = {**front, "y_m": front["y_m"] + BASELINE_M}
    twins = {"depth": "DEPTH_RIGHT", "instance": "INST_RIGHT"}
    right = {**sensors["CAM_FRONT"], "id": "CAM_RIGHT", "pose": pose, **twins}
    depth = {**sensors["DEPTH_FRONT"], "id": "DEPTH_RIGHT", "pose": pose}
    instance = {**sensors["INST_FRONT"], "id": "INST_RIGHT", "pose": pose}
    return {**spec, "sensors": [*spec["sensors"], right, depth, instance]}


@pytest.fixture(scope="module")
def stereo(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The drive with a second camera to the right of the first one, and its depth."""
    plain = analytic_scene.spec
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(analytic_scene, "spec", lambda **options: with_pair(plain(**options)))
        folder = tmp_path_factory.mktemp("stereo")
        return make_dataset(folder / "out", folder, size=SIZE, steps=2)


@pytest.fixture(scope="module")
def exported(stereo: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("export") / "out"
    export_dataset("kitti-stereo", stereo, out, workers=0)
    return out / "training"


class TestKittiStereo(ExporterTests):
    name = "kitti-stereo"

    @pytest.fixture
    def dataset(self, stereo: Path) -> Path:
        return stereo


def stored(path: Path) -> np.ndarray:
    image = np.asarray(Image.open(path))
    assert image.shape == (HEIGHT, WIDTH)
    return image.astype(np.float64) / 256.0


def test_disparity_times_depth_is_focal_length_times_baseline(exported: Path, stereo: Path) -> None:
    (episode,) = Dataset(stereo).episodes
    camera = episode.sensor("CAM_FRONT").calibration
    depth_m = episode.sensor("DEPTH_FRONT").read(1)
    found = stored(exported / "disp_occ_0/000001_10.png")
    valid = found > 0
    assert valid[depth_m < 200.0].all()
    assert not valid[depth_m > 999.0].any()
    expected = camera.k[0, 0] * BASELINE_M / depth_m[valid]
    assert np.abs(found[valid] - expected).max() <= 0.5 / 256 + 1e-6


def test_what_both_cameras_see_is_as_far_in_the_right_picture(exported: Path, stereo: Path) -> None:
    (episode,) = Dataset(stereo).episodes
    depth_m, right_m = (episode.sensor(f"DEPTH_{side}").read(0) for side in ("FRONT", "RIGHT"))
    whole, both = (stored(exported / f"disp_{kind}_0/000000_10.png") for kind in ("occ", "noc"))
    assert np.array_equal(both[both > 0], whole[both > 0])
    hidden = (whole > 0) & (both == 0)
    assert 0 < hidden.sum() < 0.3 * (whole > 0).sum()
    rows, columns = np.nonzero(both)
    there = np.floor(columns + 0.5 - both[rows, columns]).astype(int)
    near = [right_m[rows, np.clip(there + k, 0, WIDTH - 1)] for k in (-1, 0, 1)]
    apart = np.min([np.abs(one - depth_m[rows, columns]) for one in near], axis=0)
    assert np.mean(apart < 0.05 * depth_m[rows, columns] + 0.05) > 0.97


def test_calibration_and_pictures_are_the_pair_s(exported: Path, stereo: Path) -> None:
    (episode,) = Dataset(stereo).episodes
    k = episode.sensor("CAM_FRONT").calibration.k
    lines = (exported / "calib_cam_to_cam/000000.txt").read_text().splitlines()
    found = {name: np.array(rest.split(), float) for name, rest in (x.split(":") for x in lines)}
    assert found["S_rect_02"].tolist() == [WIDTH, HEIGHT]
    left, right = (found[f"P_rect_{number}"].reshape(3, 4) for number in ("02", "03"))
    from_centre = k - [[0, 0, 0.5], [0, 0, 0.5], [0, 0, 0]]
    np.testing.assert_allclose(left, np.hstack([from_centre, np.zeros((3, 1))]))
    assert right[0, 3] == pytest.approx(-k[0, 0] * BASELINE_M)
    for folder, camera in (("image_2", "CAM_FRONT"), ("image_3", "CAM_RIGHT")):
        picture = np.asarray(Image.open(exported / folder / "000001_10.png"))
        assert np.array_equal(picture, episode.sensor(camera).read(1))


@pytest.mark.parametrize(
    ("cameras", "message"),
    [
        (("CAM_FRONT", "CAM_LEFT"), "no rectified stereo pair"),
        (("CAM_RIGHT", "CAM_FRONT"), "no rectified stereo pair"),
    ],
)
def test_cameras_that_are_no_pair_are_refused(
    stereo: Path, tmp_path: Path, cameras: tuple[str, ...], message: str
) -> None:
    options = ExportOptions(cameras=cameras)
    with pytest.raises(BadInputError, match=message):
        export_dataset("kitti-stereo", stereo, tmp_path / "out", options, workers=0)


def test_a_disparity_that_does_not_fit_is_none() -> None:
    depth = np.array([[0.1, 1.0, 100.0, 1000.0]], np.float32)
    assert disparity_steps(depth, 500.0, 0.5).tolist() == [[0, 64000, 640, 0]]


def test_what_stands_before_hides_from_the_right_camera() -> None:
    left = np.full((1, 8), 10.0, np.float32)
    right = np.full((1, 8), 10.0, np.float32)
    right[0, :4] = 2.0
    steps = disparity_steps(left, 20.0, 0.5)  # one pixel
    assert seen_by_both(steps, left, right).tolist() == [
        [False, False, False, False, True, True, True, True]
    ]


def test_a_pair_whose_disparity_is_lost_is_left_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plain = analytic_scene.spec

    def with_disparity(**options: Any) -> dict[str, Any]:
        found = with_pair(plain(**options))
        return {**found, "labels": {**found["labels"], "disparity": True}}

    monkeypatch.setattr(analytic_scene, "spec", with_disparity)
    dataset = make_dataset(tmp_path / "dataset", tmp_path, size=SIZE, steps=2)
    (attempt_of(dataset) / "disparity/CAM_RIGHT/000000.png").unlink()
    with pytest.raises(BadInputError, match=r"disparity/CAM_RIGHT/000000\.png is missing"):
        export_dataset("kitti-stereo", dataset, tmp_path / "out", workers=0)
    made = export_dataset(
        "kitti-stereo", dataset, tmp_path / "out", allow_incomplete=True, workers=0
    )
    assert (made.frames, made.frames_left_out) == (1, 1)
    names = [path.name for path in (tmp_path / "out/training/disp_occ_0").iterdir()]
    assert names == ["000001_10.png"]
