"""Frames that meet a quota's condition, counted from the label tables of committed episodes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from analytic_dataset import make_dataset
from carstage.config.campaign import Condition, Quota
from carstage.dataset import Dataset, Episode
from carstage.dataset.quotas import QuotaCounts, frames_where

FRAMES = 3


@pytest.fixture(scope="module")
def episode(tmp_path_factory: pytest.TempPathFactory) -> Episode:
    folder = tmp_path_factory.mktemp("quotas")
    return Dataset(make_dataset(folder / "out", folder, steps=FRAMES)).episodes[0]


def count(episode: Episode, **where: Any) -> int:
    condition = Condition.model_validate(where, strict=False)
    return int(frames_where(episode, condition).sum())


def test_without_a_condition_every_frame_counts(episode: Episode) -> None:
    assert count(episode) == FRAMES


def test_frames_count_that_have_enough_of_the_objects(episode: Episode) -> None:
    assert count(episode, objects="car", min_count=2) == FRAMES  # one drives, one is parked
    assert count(episode, objects="car", min_count=3) == 0
    assert count(episode, objects="vehicle", min_count=3) == FRAMES  # and a truck
    assert count(episode, objects=["truck", "pedestrian"], min_count=2) == FRAMES
    assert count(episode, objects="bus") == 0


@pytest.mark.parametrize("folder", ["", "/Game/Carla/Maps/", "towns/"])
def test_a_map_may_be_named_as_in_the_configuration(episode: Episode, folder: str) -> None:
    name = f"{folder}{episode.spec.map}"
    assert count(episode, maps=["Town99", name]) == FRAMES
    assert count(episode, maps=[f"{name}.xodr"]) == FRAMES
    assert count(episode, maps=["Town99"]) == 0


@pytest.mark.parametrize("cut", [0.5, 1.5])
def test_distance_decides_which_objects_count(episode: Episode, cut: float) -> None:
    rows = episode.objects().to_pylist()
    metres = sorted(
        row["distance_ego"]
        for row in rows
        if row["k"] == 0 and row["class"] in ("car", "truck", "van") and not row["is_ego"]
    )
    bound = float(np.interp(cut, range(len(metres)), metres))
    near = sum(one <= bound for one in metres)
    for row_count in range(1, len(metres) + 1):
        within = frames_where(
            episode,
            Condition(objects="vehicle", min_count=row_count, max_distance_m=bound),
        )
        assert bool(within[0]) is (row_count <= near)
        beyond = frames_where(
            episode,
            Condition(objects="vehicle", min_count=row_count, min_distance_m=bound),
        )
        assert bool(beyond[0]) is (row_count <= len(metres) - near)


def test_objects_that_are_hidden_may_be_left_out(episode: Episode) -> None:
    ratios = [
        row["visibility"]
        for row in episode.objects().to_pylist()
        if row["k"] == 0 and row["class"] == "truck"
    ]
    assert len(ratios) == 1
    seen = count(episode, objects="truck", min_visibility=max(0.0, ratios[0] - 0.01))
    assert seen >= 1
    if ratios[0] < 0.99:
        hidden = frames_where(episode, Condition(objects="truck", min_visibility=ratios[0] + 0.005))
        assert not hidden[0]


def test_map_weather_and_sun_are_those_of_the_frame(episode: Episode) -> None:
    spec = episode.spec
    assert count(episode, maps=[f"Carla/Maps/{spec.map}"]) == FRAMES
    assert count(episode, maps=["Elsewhere"]) == 0
    preset = episode.ego().to_pylist()[0]["weather_preset"]
    other = "DustStorm"
    assert preset != other
    assert count(episode, weathers=[other]) == 0
    if preset is not None:
        assert count(episode, weathers=[other, preset]) == FRAMES


def test_the_sun_is_read_frame_by_frame(episode: Episode, monkeypatch: pytest.MonkeyPatch) -> None:
    table = episode.ego()
    column = table.column_names.index("weather")
    texts = [f'{{"sun_altitude_angle":{10 - 10 * k}}}' for k in range(FRAMES)]
    edited = table.set_column(column, "weather", [texts])
    monkeypatch.setattr(Episode, "ego", lambda self: edited)
    assert count(episode, sun_altitude_below_deg=5) == 2
    assert count(episode, sun_altitude_below_deg=0) == 1
    assert count(episode, sun_altitude_above_deg=-5, sun_altitude_below_deg=5) == 1


def test_quotas_are_met_when_all_are(episode: Episode) -> None:
    counts = QuotaCounts(
        [
            Quota(name="cars", frames=FRAMES, where=Condition(objects="car")),
            Quota(name="buses", frames=1, where=Condition(objects="bus")),
        ]
    )
    counts.add(episode)
    counts.add(episode)  # once more changes nothing
    assert counts.frames == {"cars": FRAMES, "buses": 0}
    assert episode.id in counts
    assert not counts.met
    assert not QuotaCounts([]).met
