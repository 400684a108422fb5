"""A fleet from configuration to exports: two cars and a roadside unit in one episode."""

from __future__ import annotations

import json
from dataclasses import replace
from operator import attrgetter
from pathlib import Path

import numpy as np
import pytest

from benchmarks.framework.fleet_fusion import measure_fusion, normalised_distances, world_clouds
from carstage.cli.export import FORMATS
from carstage.dataset import Dataset, Episode, FrameSamples
from carstage.errors import BadInputError
from carstage.exporters import ExportOptions, export_dataset
from carstage.report.episodes import EpisodePictures, episode_section
from carstage.spec import EpisodeSpec
from carstage.validation import validate_dataset
from damage import edit_all, moved, put
from fleet_dataset import FRAMES, NOISE_M
from recorded_dataset import linked_copy

pytestmark = [pytest.mark.end_to_end, pytest.mark.xdist_group("fleet")]


@pytest.fixture(scope="module")
def episode(fleet: Path) -> Episode:
    (only,) = Dataset(fleet).episodes
    return only


def test_a_fleet_s_dataset_is_valid(fleet: Path) -> None:
    report = validate_dataset(fleet)
    assert [problem for problem in report.problems if problem.severity == "error"] == []
    assert report.figures["frames"] == FRAMES


def test_agents_are_named_and_have_their_own_sensors(episode: Episode) -> None:
    assert episode.agents == ("car2", "mast")
    assert [sensor.id for sensor in episode.sensors if sensor.kind == "rgb"] == ["CAM_FRONT"]
    car = episode.agent("car2")
    assert [s.id for s in car.sensors if s.kind == "rgb"] == ["CAM_BACK", "CAM_FRONT"]
    assert car.id == episode.id
    with pytest.raises(BadInputError, match="no agent 'bus'"):
        episode.agent("bus")


def test_samples_of_an_agent_s_dataset_are_the_agent_s(fleet: Path, episode: Episode) -> None:
    samples = FrameSamples(Dataset(fleet).as_agent("car2"), attrgetter("ego"))
    rows = [frame.ego for frame in episode.agent("car2").iter_frames()]
    assert [samples[number] for number in range(len(samples))] == rows


def test_the_specification_of_an_agent_can_be_read_from_its_document(episode: Episode) -> None:
    for name in episode.agents:
        document = json.loads((episode.agent(name).folder / "episode.json").read_text())
        assert EpisodeSpec.from_json(document["spec"]) == episode.spec.seen_by(name)
        assert document["agent"] == name
    assert episode.spec.episode_id == episode.id


def test_each_car_labels_the_other_where_it_says_that_it_is(episode: Episode) -> None:
    car = episode.agent("car2")
    own, others = episode.document["ego_id"], car.document["ego_id"]
    for seen, seer in zip(car.iter_frames(), episode.iter_frames(), strict=True):
        assert seer.objects[others]["role_name"] == "car2"
        assert seen.objects[own]["role_name"] == "hero"
        assert own not in seer.objects
        assert others not in seen.objects
        assert seen.ego is not None
        assert seer.objects[others]["actor_location"] == seen.ego["location"]
        relative = np.linalg.inv(seer.world_from_ego) @ seen.world_from_ego
        box = seer.objects[others]["box_center_ego"]
        assert np.linalg.norm(relative[:3, 3] - box) < 1.5


def test_a_roadside_unit_stands_where_the_configuration_says(episode: Episode) -> None:
    unit = episode.agent("mast")
    pose = episode.spec.agent("mast").pose
    assert pose is not None
    for frame in unit.iter_frames():
        assert frame.ego is not None
        assert np.allclose(frame.ego["location"], [pose.x_m, pose.y_m, pose.z_m], atol=1e-4)
        assert np.allclose(frame.ego["rotation_deg"], [pose.pitch_deg, pose.yaw_deg, 0], atol=1e-3)
        assert frame.ego["speed"] == 0.0
        assert frame.ego["throttle"] is None
        assert frame.ego_object is None
        assert episode.document["ego_id"] in frame.objects


def test_an_agent_s_driver_drives_it_and_its_commands_are_kept(episode: Episode) -> None:
    car = episode.agent("car2")
    table = car.controls()
    assert table is not None
    assert table.num_rows == FRAMES
    assert set(table["episode_id"].to_pylist()) == {episode.id}
    assert max(table["throttle"].to_pylist()) > 0.0
    assert episode.controls() is None


NEEDS_MORE = ("kitti-stereo", "opv2v")
"""Formats of two cameras side by side, and of all agents together."""


@pytest.mark.parametrize("name", [name for name in FORMATS if name not in NEEDS_MORE])
def test_every_format_exports_an_agent_alone(name: str, fleet: Path, tmp_path: Path) -> None:
    options = ExportOptions(agent="car2")
    summary = export_dataset(name, fleet, tmp_path / "out", options, workers=0)
    assert summary.frames == FRAMES
    document = json.loads((tmp_path / "out" / "export.json").read_text())
    assert document["options"]["agent"] == "car2"


def test_an_export_of_an_unknown_agent_is_refused(fleet: Path, tmp_path: Path) -> None:
    with pytest.raises(BadInputError, match="Agents: car2, mast"):
        export_dataset("coco", fleet, tmp_path / "out", ExportOptions(agent="car3"))


def test_the_clouds_of_a_fleet_agree_within_the_lidars_noise(fleet: Path) -> None:
    verdict = measure_fusion([fleet])
    assert verdict.ok, verdict.figures


def test_clouds_that_are_shifted_do_not_agree(episode: Episode) -> None:
    clouds = list(world_clouds(episode, next(episode.iter_frames())))
    one, other = clouds[:2]
    assert one.noise_m == NOISE_M
    lifted = replace(other, points=other.points + np.array([0.0, 0.0, 3 * NOISE_M]))
    fitting, off = normalised_distances(one, other), normalised_distances(one, lifted)
    assert np.median(np.abs(off)) > 1.5 * np.median(np.abs(fitting))


def test_an_agent_whose_labels_are_elsewhere_is_found(fleet: Path, tmp_path: Path) -> None:
    copy = linked_copy(fleet, tmp_path / "copy")

    edit_all("agents/car2/objects", put("actor_location", moved(0.01)))(copy)
    found = [p for p in validate_dataset(copy).problems if p.check == "fleet"]
    assert found
    assert "agent car2" in found[0].message


def test_the_report_shows_what_agents_see(fleet: Path, episode: Episode) -> None:
    section = episode_section(EpisodePictures(episode, Dataset(fleet).description))
    for sensor in ("car2, CAM_BACK", "car2, CAM_FRONT", "mast, CAM"):
        assert f"{sensor} with 3D boxes, " in section
