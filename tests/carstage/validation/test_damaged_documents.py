"""Documents that hold something else than the format says are reported, whatever it is."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest

from analytic_dataset import attempt_of, make_dataset, recommit
from carstage.dataset import Dataset
from carstage.errors import DatasetError
from carstage.validation import validate_dataset

STRANGE: list[Any] = [None, "x", -3, 0.5, True, [], [7], {}]


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("documents")
    return make_dataset(folder / "out", folder / "raw", steps=1, size=(48, 32))


@pytest.fixture
def dataset(whole: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(whole, tmp_path / "out"))


def put(path: Path, place: tuple[Any, ...], value: Any) -> None:
    document = json.loads(path.read_text())
    inner = document
    for key in place[:-1]:
        inner = inner[key]
    inner[place[-1]] = value
    path.write_text(json.dumps(document))


def said(dataset: Path, check: str) -> list[str]:
    problems = validate_dataset(dataset, workers=0).problems
    return [problem.message for problem in problems if problem.check == check]


@pytest.mark.parametrize(
    "place",
    [
        ("server_version",),
        ("map",),
        ("ego_id",),
        ("geo_reference",),
        ("requested",),
        ("requested", "vehicles"),
        ("spawned", "pedestrians"),
        ("actors",),
        ("actors", "41"),
        ("actors", "41", "attributes"),
    ],
)
def test_an_episode_s_document_is_no_crash(dataset: Path, place: tuple[Any, ...]) -> None:
    path = attempt_of(dataset) / "episode.json"
    whole = path.read_text()
    for value in STRANGE:
        put(path, place, value)
        recommit(dataset)
        validate_dataset(dataset, workers=0)
        path.write_text(whole)
    put(path, place, None)
    recommit(dataset)
    assert any("episode.json" in message for message in said(dataset, "unreadable"))


@pytest.mark.parametrize(
    "key",
    ["kind", "attributes", "attach_to", "labelled", "depth", "instance", "width", "height", "K",
     "carrier_from_sensor"],
)  # fmt: skip
def test_a_calibration_is_no_crash(dataset: Path, key: str) -> None:
    path = attempt_of(dataset) / "calibration.json"
    whole = path.read_text()
    for value in STRANGE:
        put(path, ("sensors", "CAM_FRONT", key), value)
        recommit(dataset)
        validate_dataset(dataset, workers=0)
        path.write_text(whole)
    put(path, ("sensors", "CAM_FRONT", key), 0.5)
    recommit(dataset)
    assert any("calibration.json is damaged" in one for one in said(dataset, "unreadable"))


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("fov_deg", 60.0),
        ("fov_deg", float("nan")),
        ("K", [[30.0, 0.0, 24.0], [0.0, 30.0, 16.0], [0.0, 0.0, 1.0]]),
        ("attach_to", "world"),
        ("attachment", "follow"),
        ("blueprint", "sensor.camera.dvs"),
    ],
)
def test_what_the_spec_says_otherwise_is_found(dataset: Path, key: str, value: Any) -> None:
    """Of a camera that is not labelled, too, whose pictures nothing else is compared with."""
    assert said(dataset, "sensor_poses") == []
    put(attempt_of(dataset) / "calibration.json", ("sensors", "INST_FRONT", key), value)
    recommit(dataset)
    assert any(key in message for message in said(dataset, "sensor_poses"))


@pytest.mark.parametrize("key", ["depth", "instance"])
@pytest.mark.parametrize("twin", ["CAM_LEFT", "SEM_FRONT", "LIDAR_TOP", "IMU", "NOBODY"])
def test_a_twin_that_is_none_is_named(dataset: Path, key: str, twin: str) -> None:
    put(attempt_of(dataset) / "calibration.json", ("sensors", "CAM_FRONT", key), twin)
    recommit(dataset)
    (message,) = set(said(dataset, "unreadable"))
    assert f"{key} of CAM_FRONT is {twin!r}" in message


@pytest.mark.parametrize("key", ["ego_box", "sensors"])
@pytest.mark.parametrize("value", [None, "x", 7, []])
def test_a_calibration_of_another_kind_is_damaged(dataset: Path, key: str, value: Any) -> None:
    put(attempt_of(dataset) / "calibration.json", (key,), value)
    with pytest.raises(DatasetError, match=r"calibration\.json is damaged"):
        _ = Dataset(dataset).episodes[0].calibration


def test_a_place_on_the_globe_of_another_kind_is_damaged(dataset: Path) -> None:
    put(attempt_of(dataset) / "episode.json", ("geo_reference",), None)
    with pytest.raises(DatasetError, match=r"episode\.json is damaged"):
        _ = Dataset(dataset).episodes[0].geo_frame


@pytest.mark.parametrize("value", [*STRANGE, [{"value": []}], ["Car"]])
def test_a_table_of_tags_of_another_kind_is_found(dataset: Path, value: Any) -> None:
    put(dataset / "dataset.json", ("tags",), value)
    assert said(dataset, "tag_table")


@pytest.mark.parametrize("value", ["x", 7])
def test_a_marker_whose_verdict_is_no_object_is_named(dataset: Path, value: Any) -> None:
    put(next((dataset / "commits").glob("*.json")), ("self_test",), value)
    with pytest.raises(DatasetError, match=r"marker .*\.json is damaged \(self_test"):
        said(dataset, "self_test")


@pytest.mark.parametrize("value", [{}, {"checks": 3}, {"checks": [{}]}])
def test_a_verdict_on_the_server_of_another_kind_is_a_warning(dataset: Path, value: Any) -> None:
    put(next((dataset / "commits").glob("*.json")), ("self_test",), value)
    assert any("is damaged" in message for message in said(dataset, "self_test"))
