"""The formats' own devkits, and what they say of our labels when these are the predictions."""

from __future__ import annotations

import json
import sys
from collections import Counter
from collections.abc import Callable
from operator import itemgetter
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

NUSCENES_VERSION = "v1.0-carstage"


def nuscenes_devkit() -> SimpleNamespace:
    """What the tests use of nuscenes-devkit; imported late, as that takes seconds."""
    pytest.importorskip("nuscenes", reason="nuscenes-devkit is not installed")
    import matplotlib as mpl

    mpl.use("Agg")
    from nuscenes.eval.common import config as common
    from nuscenes.eval.detection import config, evaluate, utils
    from nuscenes.eval.tracking import evaluate as tracking
    from nuscenes.eval.tracking import utils as tracking_utils
    from nuscenes.nuscenes import NuScenes
    from nuscenes.utils import data_classes, geometry_utils

    return SimpleNamespace(
        NuScenes=NuScenes,
        DetectionEval=evaluate.DetectionEval,
        TrackingEval=tracking.TrackingEval,
        category_to_tracking_name=tracking_utils.category_to_tracking_name,
        config_factory=config.config_factory,
        tracking_config=common.config_factory("tracking_nips_2019"),
        category_to_detection_name=utils.category_to_detection_name,
        LidarPointCloud=data_classes.LidarPointCloud,
        RadarPointCloud=data_classes.RadarPointCloud,
        points_in_box=geometry_utils.points_in_box,
        view_points=geometry_utils.view_points,
    )


def nuscenes_map_api() -> Any:
    """nuscenes-devkit's module of maps.

    It draws by descartes, which reads the arrays of Shapely 1 alone. Shapely 2 has a function of
    the same arguments, which stands in for it.
    """
    nuscenes_devkit()
    from shapely.plotting import patch_from_polygon

    sys.modules["descartes"] = SimpleNamespace(PolygonPatch=patch_from_polygon)  # type: ignore[assignment]
    from nuscenes.map_expansion import map_api

    return map_api


def nuscenes_marks(
    devkit: SimpleNamespace, nusc: Any, folder: Path
) -> tuple[dict[str, Any], Counter[str]]:
    """The detection benchmark's figures of the annotations as predictions.

    Returns:
        The figures, and by class how many annotations are near enough to be evaluated.
    """
    names = {row["token"]: row["name"] for row in nusc.attribute}

    def detection(row: dict[str, Any], kind: str) -> dict[str, Any]:
        attribute = names[row["attribute_tokens"][0]]
        return {"detection_name": kind, "detection_score": 1.0, "attribute_name": attribute}

    # Police cars and ambulances are not in the benchmark.
    evaluation = devkit.DetectionEval(
        nusc,
        devkit.config_factory("detection_cvpr_2019"),
        _results(nusc, devkit.category_to_detection_name, detection, folder),
        "carstage_train",
        str(folder / "out"),
        verbose=False,
    )
    marks: dict[str, Any] = evaluation.evaluate()[0].serialize()
    return marks, Counter(box.detection_name for box in evaluation.gt_boxes.all)


def nuscenes_tracks(
    devkit: SimpleNamespace,
    nusc: Any,
    folder: Path,
    track_of: Callable[[dict[str, Any]], str] = itemgetter("instance_token"),
) -> dict[str, Any]:
    """The tracking benchmark's figures of the annotations as predictions.

    Args:
        devkit: see ``nuscenes_devkit``.
        nusc: the export.
        folder: for its files.
        track_of: the track that an annotation is given.
    """

    def track(row: dict[str, Any], kind: str) -> dict[str, Any]:
        return {
            "tracking_id": track_of(row),
            "tracking_name": kind,
            "tracking_score": 1.0,
        }

    evaluation = devkit.TrackingEval(
        devkit.tracking_config,
        _results(nusc, devkit.category_to_tracking_name, track, folder),
        "carstage_train",
        str(folder / "out"),
        NUSCENES_VERSION,
        nusc.dataroot,
        verbose=False,
    )
    marks: dict[str, Any] = evaluation.evaluate()[0].serialize()
    return marks


def _results(
    nusc: Any,
    kind_of: Callable[[str], str | None],
    prediction: Callable[[dict[str, Any], str], dict[str, Any]],
    folder: Path,
) -> str:
    """Write the annotations of a benchmark's classes as predictions; the file."""
    results: dict[str, list[dict[str, Any]]] = {}
    for sample in nusc.sample:
        results[sample["token"]] = rows = []
        for token in sample["anns"]:
            row = nusc.get("sample_annotation", token)
            kind = kind_of(row["category_name"])
            if kind is not None:
                rows.append(
                    {
                        "sample_token": sample["token"],
                        **{key: row[key] for key in ("translation", "size", "rotation")},
                        "velocity": nusc.box_velocity(token)[:2].tolist(),
                        **prediction(row, kind),
                    }
                )
    meta = {f"use_{kind}": False for kind in ("camera", "lidar", "radar", "map", "external")}
    path = folder / "results.json"
    path.write_text(json.dumps({"meta": meta, "results": results}))
    return str(path)


def check_point_counts(devkit: SimpleNamespace, nusc: Any) -> tuple[int, int]:
    """Compare ``num_lidar_pts`` with the points that the devkit finds in each box.

    A point counts as inside up to 1 um beyond a face, and points on a face are frequent: the road
    under a vehicle lies in the bottom of its box. The devkit rounds such points to either side. So
    the count must lie between the devkit's for the box smaller and larger by 1e-5; where no point
    is that near to a face, the three are one number.

    Returns:
        Boxes compared, and those for which it had to be one number.
    """
    boxes_compared = exact = 0
    for sample in nusc.sample:
        path, boxes, _ = nusc.get_sample_data(sample["data"]["LIDAR_TOP"])
        points = devkit.LidarPointCloud.from_file(path).points[:3].astype(float)
        assert len(boxes) == len(sample["anns"])
        for box in boxes:
            counted = nusc.get("sample_annotation", box.token)["num_lidar_pts"]
            fewest, most = (
                int(devkit.points_in_box(box, points, wlh_factor=factor).sum())
                for factor in (1.0 - 1e-5, 1.0 + 1e-5)
            )
            assert fewest <= counted <= most
            boxes_compared += 1
            exact += fewest == most
    return boxes_compared, exact


def coco_marks(coco: Any, kind: str) -> tuple[float, int]:
    """Average precision of the annotations as detections by ``bbox`` or ``segm``; how many."""
    from pycocotools.cocoeval import COCOeval

    keys = ("image_id", "category_id", "bbox", "segmentation")
    found = [
        {**{key: row[key] for key in keys}, "score": 1.0} for row in coco.dataset["annotations"]
    ]
    evaluation = COCOeval(coco, coco.loadRes(found), kind)
    evaluation.evaluate()
    evaluation.accumulate()
    evaluation.summarize()
    return float(evaluation.stats[0]), len(found)
