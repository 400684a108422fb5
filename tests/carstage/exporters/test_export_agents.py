"""What agents beside the ego recorded, exported as if they were the ego."""

from __future__ import annotations

from pathlib import Path

import pytest

from carstage.exporters import ExportOptions, export_dataset
from fleet_dataset import FRAMES

pytestmark = [pytest.mark.end_to_end, pytest.mark.xdist_group("fleet")]


@pytest.mark.parametrize(
    "name", ["123d", "coco", "kitti-tracking", "nuscenes", "semantickitti", "webdataset"]
)
def test_a_roadside_unit_is_exported_as_a_car_is(fleet: Path, tmp_path: Path, name: str) -> None:
    options = ExportOptions(agent="mast")
    assert export_dataset(name, fleet, tmp_path / "out", options, workers=0).frames == FRAMES


def test_py123d_calls_a_roadside_unit_by_its_name(fleet: Path, tmp_path: Path) -> None:
    pytest.importorskip("py123d", reason="py123d is not installed")
    from py123d.api import SceneFilter
    from py123d.api.scene.arrow.arrow_scene_builder import ArrowSceneBuilder
    from py123d.common.execution import SequentialExecutor

    export_dataset("123d", fleet, tmp_path / "out", ExportOptions(agent="mast"), workers=0)
    builder = ArrowSceneBuilder(tmp_path / "out/logs", tmp_path / "out/maps")
    (scene,) = builder.get_scenes(SceneFilter(), SequentialExecutor())
    assert scene.get_ego_state_se3_metadata().vehicle_name == "mast"
    assert scene.get_ego_state_se3_at_iteration(0).imu_se3.z == pytest.approx(6.0)
