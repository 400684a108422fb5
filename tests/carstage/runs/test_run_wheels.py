"""Whole runs on every version of CARLA: its dialect, its client wheel, its interpreter."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from PIL import Image

from carstage.validation import validate_dataset
from client_wheels import wheel_python
from driving import carstage, events

pytestmark = [pytest.mark.end_to_end, pytest.mark.py38, pytest.mark.xdist_group("runs")]

FRAMES = 4
CONFIG = """
name: wheels
duration_s: 0.4
fps: 10
vehicles: {count: 4}
pedestrians: {count: 2}
image_size: [96, 54]
timing: {warmup_ticks: 6}
conversion: {workers: 1}
rig:
  sensors:
    - {id: CAM, kind: rgb, pose: {x: 0.5, z: 1.7}}
    - {id: SEMANTIC, kind: semantic, pose: {x: 0.5, z: 1.7}}
    - {id: INSTANCE, kind: instance, pose: {x: 0.5, z: 1.7}}
    - {id: FLOW, kind: flow, pose: {x: 0.5, z: 1.7}}
    - {id: LIDAR, kind: lidar, pose: {z: 2.2}, attributes: {channels: 8, points_per_second: 20000}}
    - {id: SEMANTIC_LIDAR, kind: semantic_lidar, pose: {z: 2.2}, attributes: {channels: 8}}
    - {id: RADAR, kind: radar, pose: {x: 2.2, z: 1.0}}
    - {id: IMU, kind: imu, pose: {z: 1.0}}
    - {id: GNSS, kind: gnss, pose: {z: 1.0}}
"""
CAR, ROAD = 14, 1  # in the numbering of datasets


def record(version: str, folder: Path, home: Path, *settings: str) -> dict[str, Any]:
    """Run the real command against that version and return the commit marker."""
    config = folder / "wheels.yaml"
    config.write_text(CONFIG)
    chosen = [f"server.carla_version={version}", *settings]
    out = folder / "dataset"
    arguments = ["run", str(config), "--out", str(out)]
    for setting in chosen:
        arguments += ["--set", setting]
    ended = carstage(arguments, home)
    assert ended.code == 0, ended.stderr
    (marker_path,) = (out / "commits").glob("*.json")
    marker: dict[str, Any] = json.loads(marker_path.read_bytes())
    return marker


def check(version: str, python: str, marker: dict[str, Any], out: Path) -> None:
    """The dataset is whole, and made by that client under that Python."""
    assert marker["frames"] == FRAMES
    assert (marker["versions"]["client"], marker["versions"]["server"]) == (version, version)
    assert validate_dataset(out).ok
    started = [event for event in events(out) if event["event"] == "collector_started"]
    assert started[-1]["client_version"] == version
    assert started[-1]["python"].rpartition(".")[0] == python
    (log,) = out.glob("runs/*/logs/server.log")
    assert [line.split()[:2] for line in log.read_text().splitlines()] == [
        ["carstage_sim", "ready"]
    ]
    episode = out / "episodes" / marker["episode_id"] / marker["attempt"]
    document = json.loads((episode / "episode.json").read_bytes())
    assert document["spawned"] == {"vehicles": 4, "pedestrians": 2}
    seen = np.asarray(Image.open(episode / "sensors" / "SEMANTIC" / f"{FRAMES - 1:06d}.png"))
    assert {CAR, ROAD} <= set(np.unique(seen).tolist())
    tags = np.asarray(Image.open(episode / "sensors" / "INSTANCE" / "000000.tag.png"))
    assert {CAR, ROAD} <= set(np.unique(tags).tolist())
    objects = pq.read_table(episode / "objects.parquet").to_pylist()
    ego = next(row for row in objects if row["is_ego"])
    assert ego["semantic_tags"] == [CAR]


def test_run_records_with_wheel_0_9_13_and_its_tags(tmp_path: Path, home: Path) -> None:
    python = f"server.client_python={wheel_python('0.9.13')}"
    marker = record("0.9.13", tmp_path, home, python, "server.self_test=require")
    check("0.9.13", "3.8", marker, tmp_path / "dataset")
    verdict = marker["self_test"]
    assert verdict["ok"]
    found = {entry["name"]: entry["found"] for entry in verdict["checks"]}
    assert found["semantic tags"] == "numbered as up to 0.9.13"


def test_run_finds_the_python_with_wheel_0_9_15(tmp_path: Path, home: Path) -> None:
    wheel_python("0.9.15")
    marker = record("0.9.15", tmp_path, home)
    started = [e for e in events(tmp_path / "dataset") if e["event"] == "collector_started"]
    assert started[-1]["python"].startswith(("3.8.", "3.10."))
    check("0.9.15", started[-1]["python"].rpartition(".")[0], marker, tmp_path / "dataset")
    assert marker["self_test"]["ok"]
    assert marker["self_test"]["gnss"] == {"projection": "spherical_mercator", "north": "-y"}
