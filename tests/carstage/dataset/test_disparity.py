"""Disparity of stereo pairs: beside the scene's own geometry, damaged, and refused."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from PIL import Image

import analytic_scene
from analytic_dataset import SIZE, attempt_of, make_dataset, recommit
from carstage.config import check_config
from carstage.dataset import Dataset
from carstage.errors import BadInputError, ConfigError, DatasetError
from carstage.exporters import ExportOptions, export_dataset
from carstage.exporters.formats.kitti_stereo import stereo_pair
from carstage.geometry.stereo import (
    STEPS_PER_PX,
    CameraPair,
    StereoCamera,
    disparity_steps,
    stereo_pairs,
)
from carstage.plan import ServerFacts, plan_episodes
from carstage.report.disparity import disparity_section, draw_disparity
from carstage.validation import validate_dataset
from carstage.validation.checks.disparity import DisparityChecks, contradicting_share
from carstage.validation.checks.files import VerifiedFiles
from carstage.validation.checks.findings import Findings

WIDTH, HEIGHT = SIZE
BASELINE_M = 0.54
FOCAL_PX = WIDTH / 2.0  # of 90 degrees


def with_pair(sensors: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """The rig with a second labelled camera right of the first one; hidden depth of both."""
    by_id = {sensor["id"]: sensor for sensor in sensors}
    front = by_id["CAM_FRONT"]
    pose = {**front["pose"], "y_m": front["pose"]["y_m"] + BASELINE_M}
    right = {**front, "id": "CAM_RIGHT", "pose": pose, "depth": "R.depth", "instance": "R.inst"}
    depth = {**by_id["DEPTH_FRONT"], "id": "R.depth", "pose": pose, "hidden": True}
    instance = {**by_id["INST_FRONT"], "id": "R.inst", "pose": pose, "hidden": True}
    return [*sensors, right, depth, instance]


@pytest.fixture
def stereo(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    plain = analytic_scene.spec

    def spec(**options: Any) -> dict[str, Any]:
        found = plain(**options)
        labels = {**found["labels"], "disparity": True}
        return {**found, "sensors": with_pair(found["sensors"]), "labels": labels}

    monkeypatch.setattr(analytic_scene, "spec", spec)
    return make_dataset(tmp_path / "out", tmp_path, steps=2)


def cast_depth_m(y_m: float, tick: int) -> np.ndarray:
    """Depth of the front camera moved by ``y_m`` to the right, from the scene's own geometry."""
    u, v = np.meshgrid(np.arange(WIDTH) + 0.5, np.arange(HEIGHT) + 0.5)
    rays = np.stack([np.ones_like(u), (u - WIDTH / 2) / FOCAL_PX, (HEIGHT / 2 - v) / FOCAL_PX], -1)
    pose = {"x_m": 1.5, "y_m": y_m, "z_m": 1.6, "roll_deg": 0.0, "pitch_deg": 0.0, "yaw_deg": 0.0}
    rotation, origin = analytic_scene.world_from_sensor(pose, 0.1 * tick)
    return analytic_scene.cast(origin, rays @ rotation.T, 0.1 * tick)[0]


def found_errors(dataset: Path) -> set[str]:
    return {one.check for one in validate_dataset(dataset).problems if one.severity == "error"}


@pytest.mark.parametrize(("camera", "y_m"), [("CAM_FRONT", 0.0), ("CAM_RIGHT", BASELINE_M)])
def test_disparity_follows_from_the_scene(stereo: Path, camera: str, y_m: float) -> None:
    (episode,) = Dataset(stereo).episodes
    for k in range(episode.frames):
        found, depth_m = episode.disparity(camera, k), cast_depth_m(y_m, k)
        assert found is not None
        near = depth_m < 900.0
        assert np.array_equal(np.isfinite(found), near)
        wanted = FOCAL_PX * BASELINE_M / depth_m[near]
        # Half a step of 1/256 px, and what half a step of the depth code makes of it.
        slack_px = 0.5 / 256 + wanted * 3.1e-5 / depth_m[near]
        assert (np.abs(found[near] - wanted) <= slack_px + 1e-6).all()


def test_points_lie_at_their_disparity_in_the_other_picture(stereo: Path) -> None:
    (episode,) = Dataset(stereo).episodes
    (pair,) = episode.stereo_pairs()
    assert (pair.left.id, pair.right.id) == ("CAM_FRONT", "CAM_RIGHT")
    assert pair.baseline_m == pytest.approx(BASELINE_M)
    left, right = (episode.disparity(one.id, 0) for one in (pair.left, pair.right))
    assert left is not None
    assert right is not None
    rows, columns = np.nonzero(left > 0)
    there = np.floor(columns + 0.5 - left[rows, columns]).astype(int)
    rows, columns, there = (a[there >= 0] for a in (rows, columns, there))
    same = np.abs(right[rows, there] - left[rows, columns]) < 0.5
    assert same.mean() > 0.9  # the rest is hidden from one of them
    assert contradicting_share(np.nan_to_num(left), np.nan_to_num(right)) < 0.01


def test_dataset_is_valid_and_a_camera_alone_has_none(stereo: Path) -> None:
    assert found_errors(stereo) == set()
    (episode,) = Dataset(stereo).episodes
    assert episode.disparity("CAM_LEFT", 0) is None
    stored = np.asarray(Image.open(attempt_of(stereo) / "disparity/CAM_FRONT/000001.png"))
    assert stored.shape == (HEIGHT, WIDTH)
    assert "uint16" in str(stored.astype(np.uint16).dtype)


def plus_one(steps: np.ndarray) -> np.ndarray:
    return np.where(steps > 0, steps + 1, 0)


def twice(steps: np.ndarray) -> np.ndarray:
    return np.minimum(2 * steps.astype(np.int64), 65535)


@pytest.mark.parametrize(
    ("camera", "change"), [("CAM_FRONT", plus_one), ("CAM_FRONT", twice), ("CAM_RIGHT", twice)]
)
def test_wrong_disparity_is_found(
    stereo: Path, camera: str, change: Callable[[np.ndarray], np.ndarray]
) -> None:
    # The left camera's depth is in the dataset; the right one's is not: there the two are compared.
    path = attempt_of(stereo) / f"disparity/{camera}/000000.png"
    steps = np.asarray(Image.open(path))
    shown = change(steps) if camera == "CAM_FRONT" else steps // 2
    Image.fromarray(shown.astype(np.uint16)).save(path)
    recommit(stereo)
    assert found_errors(stereo) == {"disparity"}


def test_what_rounds_to_the_least_and_the_most_value_is_right() -> None:
    focal_px, baseline_m = 100.0, 0.02
    at = np.array([0.4, 0.6, 0.99, 1.4, 65534.7, 65535.3, 65535.7])
    depth_m = (STEPS_PER_PX * focal_px * baseline_m / at).astype(np.float32)[None]
    k = np.diag([focal_px, focal_px, 1.0])
    left, right = (StereoCamera(name, "ego", at.size, 1, k, np.eye(4)) for name in "AB")
    pair = CameraPair(left, right, baseline_m)
    steps = disparity_steps(depth_m, focal_px, baseline_m)
    assert steps.tolist() == [[0, 1, 1, 1, 65535, 65535, 0]]
    labels = SimpleNamespace(disparity=False)
    episode: Any = SimpleNamespace(spec=SimpleNamespace(labels=labels), sensors=())
    findings, files = Findings("episode"), cast(VerifiedFiles, None)
    checks = DisparityChecks(episode, files, findings)
    checks._compare(left, pair, 0, steps, depth_m)
    assert not findings.problems()


def test_damaged_and_missing_files_are_named(stereo: Path) -> None:
    path = attempt_of(stereo) / "disparity/CAM_RIGHT/000001.png"
    path.write_bytes(b"no picture")
    recommit(stereo)
    assert found_errors(stereo) == {"disparity"}
    (episode,) = Dataset(stereo).episodes
    with pytest.raises(DatasetError, match=r"000001\.png cannot be read"):
        episode.disparity("CAM_RIGHT", 1)
    path.unlink()
    recommit(stereo)
    assert "file_unlisted" in found_errors(stereo)


def test_export_takes_the_labels_where_depth_is_hidden(stereo: Path, tmp_path: Path) -> None:
    out = tmp_path / "kitti"
    export_dataset("kitti-stereo", stereo, out, workers=0)
    (episode,) = Dataset(stereo).episodes
    found = episode.disparity("CAM_FRONT", 1)
    assert found is not None
    whole, both = (
        np.asarray(Image.open(out / f"training/disp_{kind}_0/000001_10.png")) / 256.0
        for kind in ("occ", "noc")
    )
    assert np.array_equal(whole, np.nan_to_num(found))
    hidden = (whole > 0) & (both == 0)
    assert np.array_equal(both[both > 0], whole[both > 0])
    assert 0 < hidden.sum() < 0.3 * (whole > 0).sum()


@pytest.mark.parametrize("camera", ["CAM_FRONT", "CAM_RIGHT"])
def test_export_leaves_out_a_frame_whose_depth_was_missing(
    stereo: Path, tmp_path: Path, camera: str
) -> None:
    path = attempt_of(stereo) / f"disparity/{camera}/000000.png"
    Image.fromarray(np.zeros((HEIGHT, WIDTH), np.uint16)).save(path)
    recommit(stereo)
    out = tmp_path / "kitti"
    export_dataset("kitti-stereo", stereo, out, workers=0)
    assert [one.name for one in (out / "training/image_2").iterdir()] == ["000001_10.png"]


def test_export_takes_the_pair_that_has_disparity(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plain = analytic_scene.spec

    def spec(**options: Any) -> dict[str, Any]:
        found = plain(**options)
        labels = {**found["labels"], "disparity": True}
        sensors = with_pair(found["sensors"])
        right = next(sensor for sensor in sensors if sensor["id"] == "CAM_RIGHT")
        pose = {**right["pose"], "y_m": right["pose"]["y_m"] + BASELINE_M}
        bare = {"labelled": False, "depth": None, "instance": None}
        far = {**right, "id": "CAM_FAR", "pose": pose, **bare}
        return {**found, "sensors": [far, *sensors], "labels": labels}

    monkeypatch.setattr(analytic_scene, "spec", spec)
    dataset = make_dataset(tmp_path / "out", tmp_path, steps=1)
    (episode,) = Dataset(dataset).episodes
    pair = stereo_pair(episode, ExportOptions())
    assert (pair.left.id, pair.right.id, pair.labelled) == ("CAM_FRONT", "CAM_RIGHT", True)
    named = ExportOptions(cameras=("CAM_FRONT", "CAM_FAR"))
    with pytest.raises(BadInputError, match="CAM_FAR has no depth camera"):
        stereo_pair(episode, named)


def test_report_shows_it(stereo: Path) -> None:
    (episode,) = Dataset(stereo).episodes
    section = disparity_section(episode, [0])
    assert "CAM_FRONT and CAM_RIGHT, frame 0" in section
    near, far = np.asarray(draw_disparity(np.array([[64.0, 1.0]], np.float32)))[0]
    assert near[0] > near[2]
    assert far[2] > far[0]


def test_rig_without_a_pair_is_refused() -> None:
    camera = {"id": "A", "kind": "rgb", "pose": {"y": 0.0}}
    facts = ServerFacts(maps={"Stage01": 99})
    document = {
        "map": "Stage01", "labels": {"disparity": True}, "rig": {"sensors": [camera]},
    }  # fmt: skip
    with pytest.raises(ConfigError, match=r"labels\.disparity: the rig has no rectified"):
        plan_episodes(check_config(document), facts)
    document["rig"] = {"sensors": [camera, {**camera, "id": "B", "pose": {"y": 0.3}}]}
    assert plan_episodes(check_config(document), facts)[0].labels.disparity


def test_each_camera_is_in_one_pair() -> None:
    k, place = np.diag([100.0, 100.0, 1.0]), np.eye(4)

    def camera(name: str, y_m: float, carrier: str = "ego") -> StereoCamera:
        pose = place.copy()
        pose[1, 3] = y_m
        return StereoCamera(name, carrier, 8, 4, k, pose)

    rig = [camera("A", 0.0), camera("B", 0.5), camera("C", 0.7), camera("D", 0.9, "world")]
    assert [(p.left.id, p.right.id) for p in stereo_pairs(rig)] == [("B", "C")]
