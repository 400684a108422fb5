"""MCAP exports in the programs that people open them with."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from carstage.dataset import Dataset
from carstage.exporters import ExportOptions, export_dataset

pytest.importorskip("mcap", reason="the extra mcap is not installed")

from mcap.reader import make_reader

pytestmark = pytest.mark.xdist_group("export")


@pytest.fixture(scope="module", params=["foxglove", "ros2"])
def folder(
    request: pytest.FixtureRequest, every_kind: Path, tmp_path_factory: pytest.TempPathFactory
) -> Path:
    out = tmp_path_factory.mktemp("export") / "out"
    export_dataset("mcap", every_kind, out, ExportOptions(messages=request.param), workers=0)
    return out


def channels(folder: Path) -> dict[str, str]:
    """Schema by topic, as the official reader lists them."""
    (path,) = folder.glob("*.mcap")
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    return {c.topic: summary.schemas[c.schema_id].name for c in summary.channels.values()}


@pytest.fixture
def rerun(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Any:
    """Rerun, with a home folder of its own for its settings."""
    monkeypatch.setenv("HOME", str(tmp_path))
    return pytest.importorskip("rerun.chunk", reason="rerun-sdk has no wheel for this Python")


def test_rerun_lists_every_channel(rerun: Any, folder: Path) -> None:
    (path,) = folder.glob("*.mcap")
    reader = rerun.McapReader(path)
    listed = {channel.topic: channel.schema.name for channel in reader.info().channels}
    assert listed == channels(folder)
    rows: dict[str, int] = {}
    for chunk in reader.stream().to_chunks():
        if not chunk.is_static:
            rows[chunk.entity_path] = max(rows.get(chunk.entity_path, 0), chunk.num_rows)
    assert set(listed) <= set(rows)


def test_rerun_makes_pictures_points_and_depths_of_them(
    rerun: Any, folder: Path, every_kind: Path
) -> None:
    """What only its importer makes of messages that it understands, and every depth."""
    (path,) = folder.glob("*.mcap")
    found: dict[str, set[str]] = {}
    depths: dict[int, Any] = {}
    for chunk in rerun.McapReader(path).stream().to_chunks():
        rows = chunk.to_record_batch()
        found.setdefault(chunk.entity_path, set()).update(rows.schema.names)
        buffers = {"DepthImage:buffer", "Image:buffer"} & set(rows.schema.names)
        if chunk.entity_path == "/DEPTH_FRONT/image" and buffers:
            times = rows["message_log_time"].cast("int64").to_pylist()
            depths |= zip(times, rows[buffers.pop()].to_pylist(), strict=True)
    pictures = [topic for topic in found if topic.startswith("/CAM_FRONT/image")]
    assert any("EncodedImage:blob" in found[topic] for topic in pictures)
    for sensor in ("LIDAR_TOP", "SEMLIDAR_TOP", "RADAR_LEFT"):
        assert "Points3D:positions" in found[f"/{sensor}/points"]
    camera = Dataset(every_kind).episodes[0].sensor("DEPTH_FRONT")
    for k in range(6):
        (buffer,) = depths[k * 100_000_000]
        np.testing.assert_array_equal(np.array(buffer, "u1").view("<f4"), camera.read(k).ravel())


def leaves(tree: Any) -> Iterator[str]:
    if isinstance(tree, str):
        yield tree
    else:
        assert tree["direction"] in ("row", "column")
        assert 0 < tree["splitPercentage"] < 100
        yield from leaves(tree["first"])
        yield from leaves(tree["second"])


def test_the_layout_shows_what_the_file_has(folder: Path) -> None:
    known = channels(folder)
    layout = json.loads((folder / "layout.json").read_text())
    panels = layout["configById"]
    assert sorted(leaves(layout["layout"])) == sorted(panels)
    scene = panels["3D!scene"]["topics"]
    assert {topic.split("/")[1] for topic in scene} >= {"LIDAR_TOP", "RADAR_LEFT", "objects"}
    pictures = [panel["imageMode"] for name, panel in panels.items() if name.startswith("Image!")]
    named = {*scene, panels["RawMessages!ego"]["topicPath"], panels["map!fix"]["followTopic"]}
    for picture in pictures:
        camera = picture["imageTopic"].split("/")[1]
        assert picture["calibrationTopic"].split("/")[1] == camera
        assert {topic.split("/")[1] for topic in picture["annotations"]} <= {camera}
        assert "Image" in known[picture["imageTopic"]]
        named |= {picture["imageTopic"], picture["calibrationTopic"], *picture["annotations"]}
    assert len({picture["imageTopic"] for picture in pictures}) == 6
    named |= {path["value"].split(".")[0] for path in panels["Plot!ego"]["paths"]}
    assert named <= set(known)
