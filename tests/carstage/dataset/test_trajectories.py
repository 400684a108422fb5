"""A committed episode comes back as trajectories."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import analytic_scene
from analytic_dataset import attempt_of, make_dataset
from carstage.dataset.trajectories import read_recording
from carstage.errors import ConfigError


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("recorded")
    return make_dataset(folder / "out", folder / "work")


def test_everybody_moves_as_recorded_and_the_ego_comes_first(dataset: Path) -> None:
    recording = read_recording(attempt_of(dataset))
    ego, *others = recording.tracks
    assert ego.is_ego
    assert ego.attributes["role_name"] == "hero"
    assert [track.blueprint for track in others] == [
        solid.type_id for solid in analytic_scene.SOLIDS if solid.actor_id
    ]
    assert recording.map == "Analytic01"
    assert recording.duration_s == pytest.approx(0.5)
    for k in range(6):
        _, center = analytic_scene.EGO.pose(k / 10)
        pivot = center - [0.0, 0.0, analytic_scene.EGO.extent[2]]
        np.testing.assert_allclose(ego.poses[k, :3], pivot, atol=1e-5)
        assert ego.poses[k, 4] == pytest.approx(analytic_scene.EGO.yaw_deg)


def test_a_dataset_of_one_episode_stands_for_the_episode(dataset: Path) -> None:
    named = read_recording(attempt_of(dataset))
    assert read_recording(dataset).episode_id == named.episode_id
    assert read_recording(attempt_of(dataset).parent).episode_id == named.episode_id


def test_an_ego_whose_motion_was_not_asked_for_has_no_controls(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    header = analytic_scene.header

    def without_motion(*arguments: Any, **options: Any) -> Any:
        made = json.loads(json.dumps(header(*arguments, **options)))
        made["spec"]["ground_truth"]["ego_motion"] = False
        return made

    monkeypatch.setattr(analytic_scene, "header", without_motion)
    made = make_dataset(tmp_path / "out", tmp_path / "work")
    assert read_recording(made).tracks[0].controls is None


@pytest.mark.parametrize("below", ["episodes", "episodes/0000", "runs"])
def test_what_is_no_episode_is_refused_with_those_that_are(dataset: Path, below: str) -> None:
    with pytest.raises(ConfigError, match=r"scenario\.episode: .* is not the folder") as caught:
        read_recording(dataset / below)
    assert attempt_of(dataset).as_posix() in caught.value.hint


def test_a_folder_outside_of_any_dataset_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"scenario\.episode: .* lies in no dataset"):
        read_recording(tmp_path)
