"""A small dataset that the real command records from the embedded simulator, and copies of it."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

PATIENCE_S = 280.0
"""The first start on a machine compiles the simulator's kernels."""

FRAMES = 10
CONFIG = f"""
name: two drives
seed: 3
episodes: 2
duration_s: {FRAMES / 10}
fps: 10
map: {{choice: Stage01}}
weather: {{random_from: [ClearNoon, CloudyNoon]}}
vehicles: {{count: 15}}
pedestrians: {{count: 40}}
image_size: [160, 90]
min_lidar_points: 0
timing: {{warmup_ticks: 20}}
conversion: {{workers: 1}}
rig:
  sensors:
    - {{id: CAM_FRONT, kind: rgb, pose: {{x: 1.5, z: 1.6}}}}
    - {{id: CAM_LEFT, kind: rgb, pose: {{x: 1.0, y: -0.4, z: 1.6, yaw_deg: -60}}}}
    - {{id: DEPTH_FRONT, kind: depth, pose: {{x: 1.5, z: 1.6}}}}
    - {{id: SEMANTIC_FRONT, kind: semantic, pose: {{x: 1.5, z: 1.6}}}}
    - {{id: INSTANCE_FRONT, kind: instance, pose: {{x: 1.5, z: 1.6}}}}
    - {{id: FLOW_FRONT, kind: flow, pose: {{x: 1.5, z: 1.6}}}}
    - {{id: LIDAR_TOP, kind: lidar, pose: {{z: 1.9}}, attributes: {{channels: 32}}}}
    - {{id: RADAR_FRONT, kind: radar, pose: {{x: 2.2, z: 0.7}}}}
    - {{id: IMU, kind: imu}}
    - {{id: GNSS, kind: gnss}}
"""


def record(folder: Path, text: str = CONFIG) -> Path:
    """Record a configuration below a folder; the dataset's folder."""
    config, out, home = folder / "drives.yaml", folder / "dataset", folder / "home"
    config.write_text(text)
    home.mkdir()
    cache = os.environ.get("XDG_CACHE_HOME", str(Path.home() / ".cache"))
    # The client writes ~/carlaCache; the compiled kernels stay in the cache of this machine.
    environment = {**os.environ, "HOME": str(home), "XDG_CACHE_HOME": cache}
    ended = subprocess.run(
        [sys.executable, "-m", "carstage.cli", "run", str(config), "--out", str(out)],
        env=environment,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        check=False,
    )
    assert ended.returncode == 0, ended.stderr
    shutil.rmtree(out / "runs")
    return out


def linked_copy(dataset: Path, copy: Path, *, episodes: int | None = None) -> Path:
    """A copy whose sensor files are hard links: replace them, never write into them.

    Args:
        dataset: the folder to copy.
        copy: the new folder.
        episodes: how many episodes of it; the first ones by id.
    """

    def link_or_copy(source: str, target: str) -> None:
        if "/sensors/" in source:
            os.link(source, target)
        else:
            shutil.copyfile(source, target)

    shutil.copytree(dataset, copy, copy_function=link_or_copy)
    markers = sorted((copy / "commits").glob("*.json"))
    for marker in markers[len(markers) if episodes is None else episodes :]:
        marker.unlink()
        shutil.rmtree(copy / "episodes" / marker.stem)
    return copy


def replace_file(path: Path, content: bytes) -> None:
    """Give a name new content; other names of the old content keep it."""
    path.unlink()
    path.write_bytes(content)
