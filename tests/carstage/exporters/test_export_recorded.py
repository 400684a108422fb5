"""Exports of two recorded drives in the formats' own devkits: every label gets full marks."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import shapely

from carstage.dataset import Dataset
from carstage.exporters import ExportOptions, export_dataset
from devkits import NUSCENES_VERSION, check_point_counts, coco_marks, nuscenes_marks
from kitti_geometry import calibration, corners, pixels
from recorded_dataset import FRAMES

WIDTH, HEIGHT = 160, 90

pytestmark = [
    pytest.mark.end_to_end,
    pytest.mark.xdist_group("recorded"),
    # pycocotools 2.0.11 speaks numpy 1's protocol of arrays.
    pytest.mark.filterwarnings("ignore:__array__ implementation:DeprecationWarning"),
]


@pytest.fixture(scope="module")
def export(recorded: Path, tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    def run(name: str, **choices: Any) -> Path:
        out = tmp_path_factory.mktemp("export") / name
        export_dataset(name, recorded, out, ExportOptions(**choices), workers=0)
        return out

    return run


@pytest.fixture(scope="module")
def nusc(export: Callable[..., Path], devkit: SimpleNamespace) -> Any:
    return devkit.NuScenes(NUSCENES_VERSION, str(export("nuscenes")), verbose=False)


def test_nuscenes_evaluation_finds_no_error(devkit, nusc, tmp_path: Path) -> None:
    assert len(nusc.scene) == 2
    assert len(nusc.sample) == 2 * FRAMES
    marks, evaluated = nuscenes_marks(devkit, nusc, tmp_path)
    assert min(evaluated["car"], evaluated["pedestrian"]) > 20
    for name in evaluated:
        assert marks["mean_dist_aps"][name] == pytest.approx(1.0), name
        for error, value in marks["label_tp_errors"][name].items():
            assert value == pytest.approx(0.0, abs=1e-6), (name, error)


def test_nuscenes_boxes_hold_the_points_that_were_counted(devkit, nusc) -> None:
    compared, exact = check_point_counts(devkit, nusc)
    assert compared > 200
    assert exact > 0.8 * compared


@pytest.mark.parametrize("categories", ["own", "coco80"])
@pytest.mark.parametrize("kind", ["bbox", "segm"])
def test_coco_evaluation_gives_full_marks(export, kind: str, categories: str) -> None:
    pycocotools = pytest.importorskip("pycocotools.coco", reason="pycocotools is not installed")
    coco = pycocotools.COCO(
        str(export("coco", categories=categories) / "annotations/instances_train.json")
    )
    assert len(coco.dataset["images"]) == 2 * 2 * FRAMES
    precision, found = coco_marks(coco, kind)
    assert precision == pytest.approx(1.0)
    assert found > 50


def test_kitti_labels_project_back_within_a_pixel(export, recorded: Path) -> None:
    training = export("kitti-object", boxes="amodal") / "training"
    rows = [
        {**row, "n": n * FRAMES + row["k"]}
        for n, episode in enumerate(Dataset(recorded).episodes)
        for row in episode.camera_objects().to_pylist()
        if row["sensor_id"] == "CAM_FRONT" and row["location"] is not None
    ]
    picture, episodes = shapely.box(0, 0, WIDTH, HEIGHT), set()
    for n in range(2 * FRAMES):
        projection = calibration(training / f"calib/{n:06d}.txt")["P2"]
        for line in (training / f"label_2/{n:06d}.txt").read_text().splitlines():
            if line.startswith("DontCare"):
                continue
            values = [float(number) for number in line.split()[1:]]
            left, top, right, bottom, *box = values[3:]
            (seen,) = [
                row
                for row in rows
                if row["n"] == n and np.abs(np.subtract(row["location"], box[3:6])).max() < 1e-3
            ]
            if seen["n_behind"]:
                continue
            uv = pixels(corners(box), projection)
            found = [*uv.min(axis=0), *uv.max(axis=0)]
            np.testing.assert_allclose(found, seen["bbox_amodal_unclipped"], atol=1.0)
            # What is left in the picture may be lower than the whole: not the clipped bounds.
            inside = shapely.MultiPoint(uv).convex_hull.intersection(picture).bounds
            np.testing.assert_allclose([left, top, right + 1, bottom + 1], inside, atol=1.0)
            episodes.add(n // FRAMES)
    assert episodes == {0, 1}
