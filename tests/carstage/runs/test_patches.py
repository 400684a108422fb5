"""One drive with and without patches: equal outside of them, and labelled where they are."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import patches_dataset
import recorded_dataset
from carstage.dataset import Dataset, EpisodeVariants
from carstage.dataset.tables import read_table, write_table
from carstage.validation import validate_dataset
from carstage.validation.checks.patch_pairs import patch_pixels
from recorded_dataset import linked_copy

pytestmark = [pytest.mark.end_to_end, pytest.mark.xdist_group("patches")]

FRAMES = patches_dataset.FRAMES
CAMERAS = ("CAM_FRONT", "CAM_BACK")


@pytest.fixture(scope="module")
def patches(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return recorded_dataset.record(tmp_path_factory.mktemp("patches"), patches_dataset.CONFIG)


@pytest.fixture(scope="module")
def pair(patches: Path) -> EpisodeVariants:
    (only,) = Dataset(patches).variants()
    return only


def test_pictures_with_and_without_patches_are_equal_outside_of_them(
    pair: EpisodeVariants,
) -> None:
    table = pair["patched"].patches()
    assert table is not None
    rows = table.to_pylist()
    changed = 0
    for k, frames in enumerate(pair.iter_frames()):
        for camera in CAMERAS:
            one, other = (frames[name].read(camera) for name in ("patched", "plain"))
            differs = (one != other).any(axis=2)
            seen = [row for row in rows if row["k"] == k and row["sensor_id"] == camera]
            outside = ~patch_pixels(seen, *one.shape[:2])
            assert not (differs & outside).any()
            changed += int(differs.sum())
        for sensor in ("DEPTH_FRONT", "LIDAR"):
            one, other = (frames[name].read(sensor) for name in ("patched", "plain"))
            assert np.array_equal(one, other)
    assert changed > 200


def test_pixels_of_a_patch_that_nothing_stands_before_show_it(pair: EpisodeVariants) -> None:
    table = pair["patched"].patches()
    assert table is not None
    shown = 0
    for row in table.to_pylist():
        if row["visible_share"] < 1.0 or row["pixels"] < 100 or row["facing"] < 0.4:
            continue
        frames = pair.frame(row["k"])
        one, other = (frames[name].read(row["sensor_id"]) for name in ("patched", "plain"))
        inside = patch_pixels([row], *one.shape[:2])
        differs = (one != other).any(axis=2)
        assert (differs & inside).sum() > 0.8 * row["pixels"]
        shown += 1
    assert shown


def test_patches_are_labelled_alike_in_both_variants(pair: EpisodeVariants) -> None:
    tables = [pair[name].patches() for name in ("patched", "plain")]
    assert tables[0] is not None
    assert tables[1] is not None
    rows = [[{**row, "shown": None} for row in table.to_pylist()] for table in tables if table]
    assert rows[0] == rows[1]
    assert {row["shown"] for row in tables[0].to_pylist()} == {True}
    assert {row["shown"] for row in tables[1].to_pylist()} == {False}
    carried = [row for row in rows[0] if row["target"] in ("vehicle_rear", "person")]
    assert all(row["target_id"] > 0 for row in carried)


def test_a_dataset_of_patches_is_valid_and_says_what_was_compared(patches: Path) -> None:
    report = validate_dataset(patches)
    assert [problem for problem in report.problems if problem.severity == "error"] == []
    found = report.figures["patch_pairs"]
    assert found["images"] == FRAMES * (len(CAMERAS) + 1)
    assert found["pixels"] > 0
    assert found["differing"] == 0


def test_a_pixel_that_differs_and_an_outline_that_is_elsewhere_are_found(
    patches: Path, tmp_path: Path
) -> None:
    copy = linked_copy(patches, tmp_path / "copy")
    episode = Dataset(copy).as_variant("patched").episodes[0]
    path = Path(str(episode.folder)) / "patches.parquet"
    table = read_table(path)
    rows = table.to_pylist()
    rows[0]["u"] = [u + 3.0 for u in rows[0]["u"]]
    path.unlink()
    write_table(table.from_pylist(rows, schema=table.schema), path)
    picture = Path(str(episode.folder)) / "sensors" / "CAM_BACK" / "000002.png"
    other = picture.with_name("000001.png").read_bytes()
    picture.unlink()
    picture.write_bytes(other)
    found = {problem.check for problem in validate_dataset(copy).problems}
    assert {"patches", "patch_pairs"} <= found
