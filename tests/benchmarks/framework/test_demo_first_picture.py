"""What a stranger sees first: people, moving cars and crossing traffic in the first frame."""

from __future__ import annotations

from importlib import resources
from pathlib import Path

import pytest
import yaml

import carstage
from benchmarks.framework.demo import first_picture

pytestmark = [pytest.mark.end_to_end, pytest.mark.xdist_group("bench")]


def test_the_first_picture_of_the_demo_shows_people_moving_cars_and_crossing_traffic(
    tmp_path: Path,
) -> None:
    demo = yaml.safe_load(resources.files("carstage.config").joinpath("demo.yaml").read_text())
    demo["duration_s"] = 1.0 / demo["fps"]
    demo["server"] = {"self_test": "off"}
    carstage.run(demo, tmp_path / "demo")
    figures = first_picture(tmp_path / "demo")
    assert {figure.name: figure.target for figure in figures} == {
        "people_in_the_first_picture": 5, "moving_cars_in_it": 5, "of_them_crossing": 1,
    }  # fmt: skip
    assert all(figure.ok for figure in figures), figures
