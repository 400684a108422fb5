"""Patches of a configuration: pairs of variants, pictures, draws, and what is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from carstage.config import Config, check_config
from carstage.config.patches import check_patch_files
from carstage.errors import ConfigError
from carstage.plan import ServerFacts, plan_episodes
from carstage.spec import EpisodeSpec, SpecError
from carstage.spec.patches import PICTURE_PX, PatchSpec, patch_place

FACTS = ServerFacts(maps={"Stage01": 50})
RIG = {"sensors": [{"id": "CAM", "kind": "rgb"}]}


def config(*patches: dict[str, Any], **more: Any) -> Config:
    return check_config({"map": "Stage01", "rig": RIG, "patches": list(patches), **more})


def planned(*patches: dict[str, Any], **more: Any) -> list[EpisodeSpec]:
    episodes = plan_episodes(config(*patches, **more), FACTS)
    return [episodes[number] for number in range(len(episodes))]


def test_every_episode_is_planned_with_and_without_patches() -> None:
    specs = planned({"target": "billboard", "pattern": "noise"}, episodes=2)
    names = [None if spec.variant is None else spec.variant.name for spec in specs]
    assert names == ["patched", "plain"] * 2
    assert [spec.patches[0].is_shown for spec in specs] == [True, False] * 2
    assert len({spec.episode_id for spec in specs}) == 4
    first, second = specs[:2]
    assert first.variant is not None
    assert second.variant is not None
    assert first.variant.base_id == second.variant.base_id
    for name in ("picture", "size", "position", "distance_m"):
        assert getattr(first.patches[0], name) == getattr(second.patches[0], name)
        assert getattr(first.patches[0], name) != getattr(specs[2].patches[0], name)


def test_variants_of_ones_own_may_hide_patches() -> None:
    specs = planned(
        {"target": "billboard", "pattern": "checker"},
        variants={"with": {}, "rain": {"weather": "HardRainNoon", "show_patches": False}},
    )
    assert [spec.patches[0].is_shown for spec in specs] == [True, False]


def test_without_patches_nothing_changes() -> None:
    (spec,) = planned()
    assert "patches" not in spec.to_json()
    assert spec.variant is None


def test_a_specification_with_patches_comes_back_from_json() -> None:
    patches = [
        {"target": target, "pattern": pattern}
        for target, pattern in (
            ("billboard", "noise"),
            ("person", "blobs"),
            ("shop_front", "checker"),
        )
    ]
    for spec in planned(*patches):
        assert EpisodeSpec.from_json(spec.to_json()) == spec


def test_sizes_and_places_lie_in_their_ranges_and_differ_by_seed() -> None:
    asked = {"target": "billboard", "pattern": "noise", "size": [0.3, 0.5], "distance_m": [10, 20]}
    found = [spec.patches[0] for spec in planned(asked, episodes=30)[::2]]
    assert all(0.3 <= patch.size <= 0.5 and 10 <= patch.distance_m <= 20 for patch in found)
    assert len({patch.size for patch in found}) > 20
    assert planned(asked, seed=1)[0].patches != planned(asked, seed=2)[0].patches
    assert planned(asked, seed=1)[0].patches == planned(asked, seed=1)[0].patches


def test_a_picture_of_the_users_is_reduced_and_becomes_part_of_the_episode(tmp_path: Path) -> None:
    pixels = np.zeros((300, 600, 3), np.uint8)
    pixels[:, 300:] = 250
    Image.fromarray(pixels).save(tmp_path / "own.png")
    patch = planned({"target": "billboard", "file": str(tmp_path / "own.png")})[0].patches[0]
    assert (patch.picture.width, patch.picture.height) == (120, 60)
    assert patch.picture.width <= PICTURE_PX
    stored = np.frombuffer(patch.picture.pixels(), np.uint8).reshape(60, 120, 3)
    assert stored[:, :59].max() == 0
    assert stored[:, 61:].min() == 250


@pytest.mark.parametrize(
    ("patch", "path"),
    [
        ({"target": "billboard"}, "patches[0].pattern"),
        ({"target": "billboard", "pattern": "noise", "file": "x.png"}, "patches[0].pattern"),
        ({"target": "tree", "pattern": "noise"}, "patches[0].target"),
        ({"target": "billboard", "pattern": "noise", "size": 2.0}, "patches[0].size"),
        ({"target": "billboard", "pattern": "noise", "size": [0.8, 0.4]}, "patches[0].size"),
        ({"target": "billboard", "pattern": "noise", "distance_m": 900}, "patches[0].distance_m"),
    ],
)
def test_a_wrong_patch_is_refused_with_its_path(patch: dict[str, Any], path: str) -> None:
    with pytest.raises(ConfigError) as caught:
        config(patch)
    assert path in str(caught.value)


def test_files_that_are_no_pictures_are_refused_with_their_path(tmp_path: Path) -> None:
    (tmp_path / "text.png").write_text("no picture")
    Image.new("RGB", (9000, 9000)).save(tmp_path / "huge.png")
    (tmp_path / "cut.png").write_bytes((tmp_path / "huge.png").read_bytes()[:3000])
    for name in ("text.png", "huge.png", "cut.png"):
        with pytest.raises(ConfigError, match=r"patches\[0\].file: .*cannot be read as a picture"):
            planned({"target": "billboard", "file": str(tmp_path / name)})
    for name in ("missing.png", "."):
        with pytest.raises(ConfigError, match=r"patches\[0\].file: .*cannot be read"):
            check_patch_files(config({"target": "billboard", "file": str(tmp_path / name)}))


def test_a_damaged_picture_of_a_specification_is_refused() -> None:
    document = planned({"target": "billboard", "pattern": "noise"})[0].to_json()
    for rgb in ("AAAA", "no base64!", "A" * 200_000):
        document["patches"][0]["picture"]["rgb"] = rgb
        with pytest.raises(SpecError, match=r"spec.patches\[0\].picture.rgb"):
            EpisodeSpec.from_json(document)


@pytest.mark.parametrize("extent", [(0.6, 1.2, 0.01), (0.22, 0.06, 0.16), (0.05, 0.3, 0.9)])
@pytest.mark.parametrize("position", [[0.0, 0.0], [1.0, 1.0], [0.3, 0.6]])
def test_a_patch_keeps_its_shape_and_lies_within_the_board(
    extent: tuple[float, float, float], position: list[float]
) -> None:
    asked = {"target": "billboard", "pattern": "noise", "size": 0.9, "position": position}
    patch: PatchSpec = planned(asked)[0].patches[0]
    place = patch_place(patch, extent)
    assert place.left >= 1
    assert place.left + place.width <= place.columns - 1
    assert place.low >= 1
    assert place.low + place.height <= place.rows - 1
    assert place.width == pytest.approx(place.height, abs=1.5)
