"""Exports appear whole or not at all; what a dataset lacks is said."""

from __future__ import annotations

import json
import os
import shutil
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import psutil
import pytest
from typer.testing import CliRunner

import analytic_scene
import small_maps
from analytic_dataset import (
    SIZE,
    add_vector_map,
    attempt_of,
    edit_rows,
    make_dataset,
    recommit,
)
from carstage.cli.app import app
from carstage.dataset import Dataset
from carstage.errors import BadInputError
from carstage.exporters import ExportOptions, examine, export_dataset, exporters
from carstage.exporters.exporting import load_format
from carstage.processes import process_pool

pytestmark = pytest.mark.xdist_group("export")


@pytest.fixture
def copy(dataset: Path, tmp_path: Path) -> Path:
    """A dataset that a test may damage."""
    return Path(shutil.copytree(dataset, tmp_path / "dataset"))


def carstage_export(arguments: Sequence[object]) -> Any:
    return CliRunner().invoke(app, ["export", *map(str, arguments), "--workers", "0"])


def files_of(folder: Path) -> dict[str, bytes]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file()
    }


def test_an_existing_folder_is_refused_unless_overwriting_an_export(
    dataset: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    export_dataset("yolo", dataset, out, workers=0)
    (out / "mine.txt").write_text("stays until it is replaced")
    with pytest.raises(BadInputError, match="exists already"):
        export_dataset("yolo", dataset, out, workers=0)
    assert (out / "mine.txt").exists()
    export_dataset("yolo", dataset, out, overwrite=True, workers=0)
    assert not (out / "mine.txt").exists()
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_overwriting_never_removes_a_folder_that_is_no_export(
    dataset: Path, tmp_path: Path
) -> None:
    (tmp_path / "thesis.tex").write_text("years of work")
    with pytest.raises(BadInputError, match="was not written by"):
        export_dataset("yolo", dataset, tmp_path, overwrite=True, workers=0)
    assert (tmp_path / "thesis.tex").exists()


def test_a_failed_overwrite_keeps_the_old_export(
    dataset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out"
    export_dataset("yolo", dataset, out, workers=0)
    before = files_of(out)
    monkeypatch.setattr(
        "carstage.exporters.formats.yolo.yolo_rectangle", lambda *_: pytest.fail("no power")
    )
    with pytest.raises(pytest.fail.Exception, match="no power"):
        export_dataset("yolo", dataset, out, overwrite=True, workers=0)
    assert files_of(out) == before
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


@pytest.mark.parametrize("place", [".", "exports", ".."])
def test_an_export_never_lies_in_the_dataset_nor_around_it(copy: Path, place: str) -> None:
    with pytest.raises(BadInputError, match="in one another"):
        export_dataset("yolo", copy, copy / place, overwrite=True, workers=0)


def test_processes_write_what_one_process_writes(dataset: Path, tmp_path: Path) -> None:
    export_dataset("kitti-tracking", dataset, tmp_path / "one", workers=0)
    seen: list[tuple[str, int, int]] = []
    export_dataset(
        "kitti-tracking",
        dataset,
        tmp_path / "two",
        workers=2,
        progress=lambda *shown: seen.append(shown),
    )
    assert files_of(tmp_path / "one") == files_of(tmp_path / "two")
    stages = [[shown for shown in seen if shown[0] == name] for name in ("Checking", "Exporting")]
    assert seen == [*stages[0], *stages[1]]
    assert stages[0][-1] == ("Checking", 6, 6)
    assert stages[1] == [("Exporting", done, 6) for done in range(1, 7)]


def test_a_missing_file_is_named_and_nothing_is_written(copy: Path, tmp_path: Path) -> None:
    (attempt_of(copy) / "sensors/CAM_FRONT/000003.png").unlink()
    ended = carstage_export(["kitti-object", copy, tmp_path / "out"])
    assert ended.exit_code == 2
    assert "sensors/CAM_FRONT/000003.png is missing" in ended.stderr
    assert not (tmp_path / "out").exists()


def test_a_flipped_byte_is_found(copy: Path, tmp_path: Path) -> None:
    path = attempt_of(copy) / "sensors/LIDAR_TOP/000002.bin"
    content = bytearray(path.read_bytes())
    content[100] ^= 1
    path.write_bytes(content)
    with pytest.raises(BadInputError, match=r"LIDAR_TOP/000002\.bin is not the file"):
        export_dataset("kitti-object", copy, tmp_path / "out", workers=0)


def test_what_is_damaged_is_left_out_and_counted_when_that_is_allowed(
    copy: Path, tmp_path: Path
) -> None:
    (attempt_of(copy) / "sensors/CAM_FRONT/000003.png").unlink()
    (attempt_of(copy) / "sensors/LIDAR_TOP/000004.bin").write_bytes(b"")
    out = tmp_path / "out"
    ended = carstage_export(["kitti-object", copy, out, "--allow-incomplete", "--json"])
    assert ended.exit_code == 0
    summary = json.loads(ended.stdout.splitlines()[-1])
    assert (summary["frames"], summary["frames_left_out"]) == (5, 1)
    assert (out / "ImageSets/train.txt").read_text().split() == [
        "000000", "000001", "000002", "000004", "000005"
    ]  # fmt: skip
    assert not (out / "training/image_2/000003.png").exists()
    assert not (out / "training/velodyne/000004.bin").exists()
    assert (out / "training/image_2/000004.png").exists()


@pytest.mark.parametrize(
    ("name", "around", "voxels", "left"),
    [
        ("nuscenes", "ego", "gts/*/*/labels.npz", 1),
        ("semantickitti", "LIDAR_TOP", "sequences/00/voxels/*.label", 5),
    ],
)
def test_voxels_that_are_lost_are_left_out_when_that_is_allowed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, around: str, voxels: str, left: int
) -> None:
    plain = analytic_scene.spec
    reach = dict.fromkeys(("ahead_m", "behind_m", "left_m", "right_m"), 8.0)
    grid = {"frame": around, **reach, "up_m": 2.0, "down_m": 1.2, "resolution_m": 0.4}

    def with_voxels(**options: Any) -> dict[str, Any]:
        found = plain(**options)
        return {**found, "labels": {**found["labels"], "occupancy": grid}}

    monkeypatch.setattr(analytic_scene, "spec", with_voxels)
    dataset = make_dataset(tmp_path / "dataset", tmp_path, size=SIZE, segmentation=True)
    (attempt_of(dataset) / "occupancy/000000.npz").unlink()
    out = tmp_path / "out"
    with pytest.raises(BadInputError, match=r"occupancy/000000\.npz is missing"):
        export_dataset(name, dataset, out, workers=0)
    options = ExportOptions(lidar="LIDAR_TOP")
    made = export_dataset(name, dataset, out, options, allow_incomplete=True, workers=0)
    assert made.frames == 6
    assert len([*out.glob(voxels)]) == left


@pytest.mark.parametrize("found", [None, b"PAR1 and what else was there"])
@pytest.mark.parametrize(("name", "place"), [("123d", "maps"), ("nuscenes", "maps/expansion")])
def test_a_map_that_is_lost_is_left_out_when_that_is_allowed(
    copy: Path, tmp_path: Path, name: str, place: str, found: bytes | None
) -> None:
    add_vector_map(copy, small_maps.document(small_maps.road(1, 0.0, 0.0, 0.0, 100.0)))
    out = tmp_path / "out"
    export_dataset(name, copy, out, workers=0)
    assert (out / place).is_dir()
    (lost,) = (copy / "maps").glob("*.parquet")
    lost.unlink()
    if found is not None:
        lost.write_bytes(found)
    with pytest.raises(BadInputError, match=lost.name):
        export_dataset(name, copy, out, overwrite=True, workers=0)
    made = export_dataset(name, copy, out, overwrite=True, allow_incomplete=True, workers=0)
    assert made.frames == 6
    assert [problem.check for problem in made.problems] == ["vector_map"]
    assert any("map of Analytic01 is lost" in one for one in made.warnings)
    assert not (out / place).exists()
    assert export_dataset("coco", copy, tmp_path / "coco", workers=0).problems == ()


def test_an_episode_with_a_damaged_table_cannot_be_exported(copy: Path, tmp_path: Path) -> None:
    (attempt_of(copy) / "objects.parquet").write_bytes(b"PAR1")
    found = examine(Dataset(copy))
    assert not found.complete
    assert not found.whole
    with pytest.raises(BadInputError, match="no whole episode"):
        export_dataset("coco", copy, tmp_path / "out", allow_incomplete=True, workers=0)


def test_frames_that_the_ledger_lacks_make_a_dataset_incomplete(copy: Path, tmp_path: Path) -> None:
    def lose_one(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
        rows[2] |= {"CAM_FRONT.state": "missing", "CAM_FRONT.reason": "nothing arrived"}
        return rows

    edit_rows(copy, "frames.parquet", lose_one)
    (attempt_of(copy) / "sensors/CAM_FRONT/000002.png").unlink()
    recommit(copy)
    with pytest.raises(BadInputError, match="tick 2 is missing: nothing arrived"):
        export_dataset("yolo", copy, tmp_path / "out", workers=0)


def test_an_empty_dataset_is_incomplete(copy: Path, tmp_path: Path) -> None:
    next((copy / "commits").iterdir()).unlink()
    with pytest.raises(BadInputError, match="no committed episode"):
        export_dataset("yolo", copy, tmp_path / "out", workers=0)


def test_unknown_classes_are_listed_and_left_out(copy: Path, tmp_path: Path) -> None:
    def rename(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
        return [row | ({"class": "hovercraft"} if row["class"] == "car" else {}) for row in rows]

    edit_rows(copy, "objects.parquet", rename)
    ended = carstage_export(["kitti-object", copy, tmp_path / "out"])
    assert ended.exit_code == 0
    assert "12 labels of class 'hovercraft'" in ended.stderr  # the ego's are no labels
    labels = "".join(p.read_text() for p in (tmp_path / "out/training/label_2").iterdir())
    names = {line.split()[0] for line in labels.splitlines()}
    assert "Truck" in names
    assert "Car" not in names


@pytest.mark.parametrize(
    ("choices", "message"),
    [
        ({"boxes": "round"}, "boxes: 'round'"),
        ({"occlusion": "none"}, "occlusion: 'none'"),
        ({"val_share": 1.0}, "val-share: 1.0 is no share"),
        ({"test_share": -0.1}, "test-share: -0.1 is no share"),
        ({"val_share": 0.5, "test_share": 0.5}, "nothing for training"),
        ({"min_lidar_points": -1}, "min-lidar-points"),
        ({"max_distance_m": 0.0}, "max-distance-m"),
    ],
)
def test_impossible_options_are_refused(choices: dict[str, Any], message: str) -> None:
    with pytest.raises(BadInputError, match=message):
        ExportOptions(**choices)


@pytest.mark.parametrize(
    ("choices", "message"),
    [
        ({"cameras": ("DEPTH_FRONT",)}, "no labelled colour camera 'DEPTH_FRONT'"),
        ({"cameras": ("all", "CAM_FRONT")}, "no labelled colour camera 'all'"),
        ({"lidar": "IMU"}, "no LiDAR 'IMU'"),
    ],
)
def test_sensors_that_do_not_fit_are_refused(
    dataset: Path, tmp_path: Path, choices: dict[str, Any], message: str
) -> None:
    with pytest.raises(BadInputError, match=message):
        export_dataset(
            "kitti-object", dataset, tmp_path / "out", ExportOptions(**choices), workers=0
        )


def test_unknown_formats_are_refused_with_the_list(dataset: Path, tmp_path: Path) -> None:
    ended = carstage_export(["voc", dataset, tmp_path / "out"])
    assert ended.exit_code == 2
    assert "kitti-object" in ended.stderr


def test_a_format_is_loaded_once_by_a_process_without_threads() -> None:
    formats = {exporter.__module__ for exporter in exporters().values()}
    assert len(formats) > 8
    for module in sorted(formats):
        with process_pool(2, preload=(load_format, (module,))) as pool:
            sleeping = [pool.submit(time.sleep, 0.1) for _ in range(2)]
            assert all(task.result(60.0) is None for task in sleeping)
            (parent,) = {pool.submit(os.getppid).result(60.0) for _ in range(4)}
            assert psutil.Process(parent).num_threads() == 1, module
            assert pool.submit(_has, module).result(60.0), module


def test_what_somebody_else_wrote_is_not_loaded_before_processes_are_forked() -> None:
    load_format("of_somebody_else.that_is_not_there")


def _has(module: str) -> bool:
    return module in sys.modules


@pytest.mark.parametrize("format_name", ["coco", "yolo", "kitti-object", "kitti-tracking"])
def test_a_picture_without_labels_is_not_exported_as_one_without_objects(
    copy: Path, tmp_path: Path, format_name: str
) -> None:
    def lose(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
        rows[1]["CAM_FRONT.labels"] = "missing"
        return rows

    def pictures(out: Path) -> int:
        export_dataset(format_name, copy, out, workers=0, allow_incomplete=True)
        files = (path.relative_to(out) for path in out.rglob("*.png"))
        return sum(path.parts[0] != "annotations" for path in files)

    whole = pictures(tmp_path / "whole")
    edit_rows(copy, "frames.parquet", lose)
    (problem,) = examine(Dataset(copy)).problems
    assert (problem.check, problem.frame, problem.sensor) == ("ledger_state", 1, "CAM_FRONT")
    assert pictures(tmp_path / "out") == whole - 1
