"""One drive in four variants, from configuration to exports: the world is the same in all."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest

from carstage.catalog import Catalog, PageFilter, catalog_address, list_episodes, rebuild
from carstage.dataset import Dataset, Episode, EpisodeVariants, SplitRule, split_dataset
from carstage.dataset.tables import read_table, write_table
from carstage.errors import BadInputError
from carstage.exporters import ExportOptions, export_dataset
from carstage.validation import validate_dataset
from carstage.validation.checks.findings import Findings
from carstage.validation.checks.variants import VariantFigures, check_variants
from recorded_dataset import linked_copy
from variants_dataset import FRAMES, NAMES

Row = dict[str, Any]

pytestmark = [pytest.mark.end_to_end, pytest.mark.xdist_group("variants")]


@pytest.fixture(scope="module")
def drive(variants: Path) -> EpisodeVariants:
    (only,) = Dataset(variants).variants()
    return only


def test_a_dataset_of_variants_is_valid_and_says_how_alike_they_are(variants: Path) -> None:
    report = validate_dataset(variants)
    assert [problem for problem in report.problems if problem.severity == "error"] == []
    found = report.figures["variants"]
    assert found["groups"] == 1
    assert found["poses"] > 3 * FRAMES * 10
    assert found["largest_m"] == found["largest_deg"] == 0.0
    assert [problem for problem in report.problems if problem.check == "repeated_episode"] == []


def test_readers_give_the_frames_of_all_variants_side_by_side(drive: EpisodeVariants) -> None:
    assert drive.names == NAMES
    assert drive.frames == FRAMES
    for k, frames in enumerate(drive.iter_frames()):
        assert list(frames) == list(NAMES)
        assert {frame.k for frame in frames.values()} == {k}
        assert len({frame.timestamp_s for frame in frames.values()}) == 1
        egos = [frame.ego for frame in frames.values() if frame.ego is not None]
        assert all(ego["location"] == egos[0]["location"] for ego in egos)
    with pytest.raises(BadInputError, match="Variants: as_configured, night, rain, wide"):
        drive["fog"]


def test_variants_look_different_though_their_world_is_the_same(drive: EpisodeVariants) -> None:
    frames = drive.frame(FRAMES - 1)
    pictures = {name: frame.read("CAM_FRONT").astype(float) for name, frame in frames.items()}
    plain = pictures.pop("as_configured")
    assert all(np.abs(picture - plain).mean() > 5.0 for picture in pictures.values())
    assert frames["wide"].has("LIDAR")
    assert not frames["night"].episode.spec.sensors_of("points")


def test_an_actor_that_is_elsewhere_in_one_variant_is_named(variants: Path, tmp_path: Path) -> None:
    def damage(rows: list[Row]) -> None:
        row = next(row for row in rows if row["k"] == 4 and row["track_id"] == track)
        row["actor_location"] = [x + 0.03 for x in row["actor_location"]]

    copy = linked_copy(variants, tmp_path / "copy")
    track = ego_of(Dataset(copy).as_variant("night").episodes[0])
    edit_objects(copy, "night", damage)
    (found,) = [p for p in validate_dataset(copy).problems if p.check == "variants"]
    assert (found.frame, found.severity) == (4, "error")
    assert f"variant night beside as_configured: actor {track} is 0.052 m" in found.message


def test_an_actor_that_one_variant_lacks_is_named(variants: Path, tmp_path: Path) -> None:
    def damage(rows: list[Row]) -> None:
        rows.remove(next(row for row in rows if row["k"] == 6 and row["track_id"] == track))

    copy = linked_copy(variants, tmp_path / "copy")
    track = ego_of(Dataset(copy).as_variant("rain").episodes[0])
    edit_objects(copy, "rain", damage)
    (found,) = [p for p in validate_dataset(copy).problems if p.check == "variants"]
    assert found.frame == 6
    assert f"actor {track} is not in both" in found.message


def test_actors_are_the_same_by_their_order_whatever_ids_a_rig_leaves_them(
    variants: Path, tmp_path: Path
) -> None:
    def damage(rows: list[Row]) -> None:
        last = max(row["track_id"] for row in rows if not row["is_static"])
        for row in rows:
            row["track_id"] += 7 * (row["track_id"] == last)

    def problems_of_variants() -> list[str]:
        (group,) = Dataset(copy).variants()
        findings = Findings(None)
        check_variants(group, findings, VariantFigures())
        return [problem.check for problem in findings.problems()]

    copy = linked_copy(variants, tmp_path / "copy")
    edit_objects(copy, "wide", damage)
    assert problems_of_variants() == []
    edit_objects(copy, "wide", lambda rows: rows.remove(next(r for r in rows if r["is_ego"])))
    assert problems_of_variants() == ["variants"]


def ego_of(episode: Episode) -> int:
    """Its track id."""
    return int(episode.document["ego_id"])


def edit_objects(dataset: Path, variant: str, change: Callable[[list[Row]], object]) -> None:
    """Change the table of one variant."""
    path = Dataset(dataset).as_variant(variant).episodes[0].folder / "objects.parquet"
    table = read_table(path)
    rows = table.to_pylist()
    change(rows)
    write_table(pa.Table.from_pylist(rows, schema=table.schema), Path(str(path)))


def test_variants_are_in_one_split_also_when_they_are_recorded_later(
    variants: Path, tmp_path: Path
) -> None:
    copy = linked_copy(variants, tmp_path / "copy")
    with pytest.raises(BadInputError, match="1 episode cannot fill 2 splits"):
        split_dataset(copy, SplitRule(val=0.5))
    stored = split_dataset(copy, SplitRule())
    dataset = Dataset(copy)
    (group,) = dataset.variants()
    assert stored.variants == {group.base_id: "train"}
    assert set(dataset.splits().values()) == {"train"}
    assert stored.of("0123456789abcdef", group.base_id) == "train"


def test_one_variant_or_all_with_their_names_are_exported(variants: Path, tmp_path: Path) -> None:
    export_dataset("coco", variants, tmp_path / "all", workers=0)
    document = json.loads((tmp_path / "all" / "export.json").read_text())
    assert sorted(document["variants"].values()) == list(NAMES)
    images = json.loads((tmp_path / "all/annotations/instances_train.json").read_text())["images"]
    assert {image["variant"] for image in images} == set(NAMES)
    assert {image["base_id"] for image in images} == {Dataset(variants).variants()[0].base_id}
    summary = export_dataset(
        "coco", variants, tmp_path / "night", ExportOptions(variant="night"), workers=0
    )
    assert (summary.episodes, summary.frames) == (1, FRAMES)
    with pytest.raises(BadInputError, match="Variants: as_configured, night, rain, wide"):
        export_dataset("coco", variants, tmp_path / "fog", ExportOptions(variant="fog"))


def test_the_catalog_finds_the_episodes_of_a_variant(variants: Path, tmp_path: Path) -> None:
    copy = linked_copy(variants, tmp_path / "copy")
    dataset = Dataset(copy)
    with Catalog(catalog_address(str(tmp_path / "catalog.sqlite"))) as catalog:
        rebuild(catalog, dataset)
        found = list_episodes(catalog, None, PageFilter(variant="night")).episodes
    (night,) = dataset.as_variant("night").episodes
    assert [(row["episode_id"], row["base_id"]) for row in found] == [(night.id, night.base_id)]
