"""V2X messages from configuration to readers: two cars and a roadside unit hear each other."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow.compute as pc
import pytest
from mcap.reader import make_reader

import recorded_dataset
from carstage.dataset import Dataset, Episode
from carstage.exporters import ExportOptions, export_dataset
from carstage.report.messages import messages_section
from carstage.sensor_kinds.columns import Message
from carstage.validation import validate_dataset
from damage import edit_all, put
from recorded_dataset import linked_copy

pytestmark = [pytest.mark.end_to_end, pytest.mark.xdist_group("v2x")]

FRAMES = 15
CONFIG = f"""
name: V2X
seed: 5
duration_s: {FRAMES / 10}
fps: 10
map: {{choice: Stage01}}
vehicles: {{count: 4}}
pedestrians: {{count: 0}}
timing: {{warmup_ticks: 10}}
conversion: {{workers: 1}}
supervision: {{hang_s: 120}}
rig:
  sensors:
    - {{id: IMU, kind: imu}}
    - {{id: V2X, kind: v2x, pose: {{z: 2.0}}}}
agents:
  - name: car2
    driver: route
    rig:
      sensors:
        - {{id: V2X, kind: v2x, pose: {{z: 2.0}}, attributes: {{transmit_power_dbm: 23}}}}
  - name: mast
    kind: roadside
    pose: {{x: -112, y: -111, z: 6}}
    rig:
      sensors:
        - {{id: V2X, kind: v2x, attributes: {{fixed_rate: true}}}}
"""


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return recorded_dataset.record(tmp_path_factory.mktemp("v2x"), CONFIG)


@pytest.fixture(scope="module")
def episode(dataset: Path) -> Episode:
    (only,) = Dataset(dataset).episodes
    return only


def test_every_frame_has_a_row_and_the_dataset_is_valid(dataset: Path, episode: Episode) -> None:
    report = validate_dataset(dataset)
    assert [problem for problem in report.problems if problem.severity == "error"] == []
    for view in (episode, *(episode.agent(name) for name in episode.agents)):
        assert view.sensor("V2X").table["k"].to_pylist() == list(range(FRAMES))
        assert set(view.ledger()["V2X.state"].to_pylist()) == {"ok"}


def test_each_hears_the_others_and_not_itself(episode: Episode) -> None:
    views = {"ego": episode, **{name: episode.agent(name) for name in episode.agents}}
    heard = {name: set(view.messages()["station_type"].to_pylist()) for name, view in views.items()}
    assert heard == {"ego": {5, 15}, "car2": {5, 15}, "mast": {5}}
    senders = {name: set(view.messages()["track_id"].to_pylist()) for name, view in views.items()}
    ego, car = episode.document["ego_id"], episode.agent("car2").document["ego_id"]
    assert ego in senders["car2"]
    assert ego not in senders["ego"]
    assert senders["mast"] == {ego, car}


def test_messages_tell_where_the_sender_is(episode: Episode) -> None:
    car = episode.agent("car2").document["ego_id"]
    found = 0
    for frame in episode.iter_frames():
        for message in frame.read("V2X"):
            if message[Message.STATION_ID] != car:
                continue
            found += 1
            sender = frame.objects[car]
            place = episode.geo_frame.gnss_place(sender["actor_location"])
            assert message[Message.LATITUDE] == pytest.approx(place.latitude_deg, abs=1e-6)
            assert message[Message.LONGITUDE] == pytest.approx(place.longitude_deg, abs=1e-6)
            speed = np.linalg.norm(sender["velocity"])
            assert message[Message.SPEED] == pytest.approx(speed, abs=0.01)
            assert message[Message.LENGTH] == pytest.approx(4.8, abs=0.1)
    assert found >= 3


def test_what_a_roadside_unit_does_not_say_is_null(episode: Episode) -> None:
    table = episode.messages()
    assert table is not None
    units = table.filter(pc.equal(table["station_type"], 15))
    assert units.num_rows >= 2
    assert units["speed_m_s"].null_count == units.num_rows
    assert units["latitude_deg"].null_count == 0


def test_the_same_configuration_gives_the_same_messages(dataset: Path, tmp_path: Path) -> None:
    again = recorded_dataset.record(tmp_path, CONFIG)
    hashes = [
        {file.path: file.hash for file in Dataset(folder).episodes[0].marker.files}
        for folder in (dataset, again)
    ]
    assert hashes[0] == hashes[1]


@pytest.mark.parametrize(
    ("column", "change"),
    [("latitude_deg", 1e-4), ("heading_deg", 30.0), ("speed_m_s", 5.0), ("power_dbm", -90.0)],
)
def test_messages_that_cannot_be_are_found(
    dataset: Path, tmp_path: Path, column: str, change: float
) -> None:
    copy = linked_copy(dataset, tmp_path / "copy")
    edit_all("sensors/V2X", put(column, lambda values: [v + change for v in values]))(copy)
    report = validate_dataset(copy)
    assert {problem.check for problem in report.problems if problem.severity == "error"} == {
        "messages"
    }


def test_the_report_says_who_was_heard(episode: Episode) -> None:
    section = messages_section(episode)
    assert "<h3>V2X messages</h3>" in section
    assert "roadside unit" in section
    assert section.count("<td>mast</td>") == 2
    for name, track in (
        ("ego", episode.document["ego_id"]),
        ("car2", episode.agent("car2").document["ego_id"]),
    ):
        assert section.count(f"<td>{name} (track {track})</td>") == 2


def test_each_message_becomes_one_of_mcap(dataset: Path, tmp_path: Path) -> None:
    export_dataset("mcap", dataset, tmp_path / "out", ExportOptions())
    (path,) = (tmp_path / "out").rglob("*.mcap")
    with path.open("rb") as file:
        channels = [
            c.topic for _, c, _ in make_reader(file).iter_messages(topics=["/V2X/readings"])
        ]
    (only,) = Dataset(dataset).episodes
    assert len(channels) == only.messages().num_rows
