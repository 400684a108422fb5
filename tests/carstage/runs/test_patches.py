"""One drive with and without patches: equal outside of them, and labelled where they are."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageDraw

import patches_dataset
import recorded_dataset
from carstage.dataset import Dataset, EpisodeVariants
from carstage.dataset.tables import read_table, write_table
from carstage.spec.patches import TARGETS
from carstage.validation import validate_dataset
from carstage.validation.checks.patch_pairs import patch_pixels
from recorded_dataset import linked_copy

pytestmark = [pytest.mark.end_to_end, pytest.mark.xdist_group("patches")]

FRAMES = patches_dataset.FRAMES
VARIANTS = ("patched", "plain")
CAMERAS = ("CAM_FRONT", "CAM_RIGHT")
LEAST_WIDTH_PX = {"billboard": 20, "shop_front": 40, "vehicle_rear": 30, "person": 20}


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


@pytest.mark.parametrize("target", TARGETS)
def test_a_patch_of_each_kind_is_seen_near_the_ego(pair: EpisodeVariants, target: str) -> None:
    """Tens of pixels wide, free, and its pixels show it where its outline says."""
    table = pair["patched"].patches()
    assert table is not None
    rows = [row for row in table.to_pylist() if row["target"] == target and row["face"] == "front"]
    best = max(rows, key=lambda row: row["pixels"] * row["visible_share"], default=None)
    assert best is not None
    assert best["visible_share"] == 1.0
    assert max(best["u"]) - min(best["u"]) >= LEAST_WIDTH_PX[target]
    one, other = (pair.frame(best["k"])[name].read(best["sensor_id"]) for name in VARIANTS)
    differs = (one.astype(int) != other).any(axis=2)
    mask = Image.new("1", (one.shape[1], one.shape[0]))
    outline = list(zip(best["u"], best["v"], strict=True))
    ImageDraw.Draw(mask).polygon(outline, fill=1)
    inside = np.asarray(mask)
    perimeter_px = 2 * sum(max(best[axis]) - min(best[axis]) for axis in "uv")
    assert abs(int(inside.sum()) - best["pixels"]) <= perimeter_px
    assert differs[inside].mean() > 0.9


def test_who_carries_a_patch_is_where_it_is_wanted(pair: EpisodeVariants) -> None:
    """A lorry's rear is ahead on the lane, a person comes towards the ego."""
    episode = pair["patched"]
    table = episode.patches()
    assert table is not None
    specs = {patch.name: patch for patch in episode.spec.patches}
    front = [row for row in table.to_pylist() if row["k"] == 0 and row["sensor_id"] == "CAM_FRONT"]
    (rear,) = (row for row in front if row["target"] == "vehicle_rear")
    camera_m = 1.5
    assert abs(rear["distance"] + camera_m - specs[rear["patch"]].distance_m) < 5.0
    assert rear["facing"] > 0.98
    (person,) = (row for row in front if row["target"] == "person")
    last = [row for row in table.to_pylist() if row["patch"] == person["patch"]][-1]
    assert person["facing"] > 0.6
    assert last["distance"] < person["distance"]
    speeds = [row["velocity"] for row in episode.objects().to_pylist()
              if row["track_id"] == rear["target_id"]]  # fmt: skip
    assert max(float(np.hypot(x, y)) for x, y, _ in speeds) < 4.0  # its board does not push it
    lorry = {row["track_id"]: row for row in episode.objects().to_pylist()}[rear["target_id"]]
    assert 2.0 * lorry["box_extent"][1] >= 2.0
    assert 2.0 * lorry["box_extent"][2] >= 2.0


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
    for name in ("objects", "camera_objects"):
        one, other = (getattr(pair[variant], name)() for variant in VARIANTS)
        own = [column for column in one.column_names if column.startswith(("episode", "instance_"))]
        assert one.drop_columns(own).equals(other.drop_columns(own))


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
    rows.append(rows[1])
    path.unlink()
    write_table(table.from_pylist(rows, schema=table.schema), path)
    picture = Path(str(episode.folder)) / "sensors" / "CAM_RIGHT" / "000002.png"
    other = picture.with_name("000001.png").read_bytes()
    picture.unlink()
    picture.write_bytes(other)
    problems = validate_dataset(copy).problems
    assert {"patches", "patch_pairs"} <= {problem.check for problem in problems}
    assert any(problem.message.endswith("it is there twice") for problem in problems)
