"""The measurements in short, against the embedded simulator: what they find, not how fast it is."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from carstage.bench.comparison import PRESETS, Campaign, judge
from carstage.bench.episodes import looping_server
from carstage.bench.verdict import Verdict
from carstage.server import Endpoint

pytestmark = [pytest.mark.end_to_end, pytest.mark.xdist_group("bench")]


@pytest.fixture(scope="module")
def server() -> Iterator[Endpoint]:
    with looping_server(2) as endpoint:
        yield endpoint


def figures(verdict: Verdict) -> dict[str, Any]:
    return {figure.name: figure.value for figure in verdict.figures}


def test_programs_of_a_comparison_write_the_same_pictures_clouds_and_boxes(
    server: Endpoint, tmp_path: Path
) -> None:
    preset = replace(
        PRESETS["quick"],
        frames=(3,),
        slow_share=1.0,
        lidars=(1,),
        lidar_frames=3,
        cameras=(1,),
        camera_frames=3,
        sides=(1,),
        actors=5,
        image_size=(160, 90),
    )
    others = ["native-threads", "native-tiff", "pillow", "paper", "paper-own-png", "native-async"]
    campaign = Campaign(
        preset,
        ["frames", "lidars", "cameras"],
        tmp_path / "out",
        programs=["native-png", "native-npy", "carstage", *others],
        server=("127.0.0.1", server.port),
        scratch=tmp_path,
    )
    campaign.run()
    assert not campaign.left
    measured = list(campaign.results.values())
    found = figures(judge(preset, measured, "", campaign.machine))
    assert found["pictures and clouds compared between programs"] >= 9 + 3 + 5 * 3
    assert found["pictures and clouds that differ"] == 0
    assert found["boxes compared with native-png's"] >= 1
    assert found["boxes that differ"] == 0
    assert [path.name for path in tmp_path.iterdir() if path.name == "trial"] == []
    # Gone on with, there is nothing left to do.
    again = Campaign(preset, ["lidars"], tmp_path / "out", programs=["native-npy"])
    assert again.left == []
