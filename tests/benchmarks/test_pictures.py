"""``python -m benchmarks pictures``: what it writes, how large, and what towns show."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

import benchmarks.__main__  # noqa: F401 - registers the commands
from benchmarks.pictures import commands
from benchmarks.pictures.recorded import level_labels_config, surroundings_config
from benchmarks.pictures.saving import MOST_BYTES, save_pictures
from benchmarks.pictures.towns import town_from_above
from benchmarks.registry import app
from carstage.config import Config

ROOT = Path(__file__).parents[2]


def grey() -> Iterator[tuple[str, Image.Image]]:
    """What a drawer of this test draws."""
    yield "grey.jpg", Image.new("RGB", (4, 3), (90, 90, 90))
    yield "below/dots.png", Image.new("RGB", (5, 2), (9, 8, 7))


def test_the_pictures_of_a_drawer_are_written_below_the_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(commands, "DRAWERS", {"one": f"{__name__}:grey", "two": "no_module:none"})
    asked = ["pictures", "one", "--folder", str(tmp_path), "--json"]
    ended = CliRunner().invoke(app, asked)
    assert ended.exit_code == 0, ended.output
    assert json.loads(ended.stdout.splitlines()[-1])["figures"]["pictures"]["value"] == 2
    with Image.open(tmp_path / "grey.jpg") as one, Image.open(tmp_path / "below/dots.png") as other:
        assert (one.size, other.size, other.getpixel((1, 1))) == ((4, 3), (5, 2), (9, 8, 7))


def test_an_unknown_name_is_refused_before_anything_is_drawn(tmp_path: Path) -> None:
    ended = CliRunner().invoke(app, ["pictures", "towns", "twons", "--folder", str(tmp_path)])
    assert ended.exit_code == 2
    assert "No pictures are called 'twons'" in ended.stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", commands.DRAWERS)
def test_every_drawer_is_there(name: str) -> None:
    assert callable(commands.drawer(name))


def test_a_picture_is_as_good_as_its_size_allows(tmp_path: Path) -> None:
    noise = np.random.default_rng(1).integers(0, 256, (400, 700, 3)).astype(np.uint8)
    plain = Image.new("RGB", (700, 400), (200, 20, 20))
    plain.paste((20, 20, 200), (350, 0, 351, 400))
    pictures = [("noise.jpg", Image.fromarray(noise)), ("plain.jpg", plain)]
    large, small = save_pictures(pictures, tmp_path)
    assert small.stat().st_size < large.stat().st_size <= MOST_BYTES
    with Image.open(small) as read:  # a blue line of one pixel stays blue beside red
        red, _, blue = np.asarray(read)[200, 350].tolist()
    assert blue > 150 > red


@pytest.mark.parametrize("exact", [False, True])
def test_what_is_recorded_for_pictures_is_a_configuration(exact: bool, tmp_path: Path) -> None:
    config = Config.model_validate(surroundings_config(exact=exact))
    assert config.labels.birds_eye is not None
    assert config.labels.occupancy is not None
    assert config.labels.occupancy.exact is exact
    Config.model_validate(level_labels_config(tmp_path))


@pytest.mark.xdist_group("kernels")
def test_a_town_from_above_lies_whole_in_its_picture() -> None:
    pixels = np.asarray(town_from_above("Stage01", (84, 70))).astype(int)
    green = pixels[..., 1] - np.maximum(pixels[..., 0], pixels[..., 2])
    border = np.concatenate([green[0], green[-1], green[:, 0], green[:, -1]])
    assert (border > 8).mean() > 0.7  # meadows around it
    assert (green[30:36, 10:74] < 8).mean() > 0.7  # the street through its middle, and houses
